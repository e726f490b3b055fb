# frozen_string_literal: true

require 'minitest/autorun'
require 'tmpdir'
require_relative '../lib/stellate'

# What the tests share: servers, and how large the meshes have to be.
module Live
  TORUS = Stellate::Torus.new

  module_function

  def from_environment(name)
    ENV.fetch(name) { raise "tests/languages/run sets #{name}" }
  end

  def secret(name)
    File.join(from_environment('STELLATE_TEST_SECRETS'), name)
  end

  # Vertices and simplices of the torus, and of the Clifford torus, as the Python client has them.
  def expected
    from_environment('STELLATE_TEST_COUNTS').split.map(&:to_i).each_slice(2).to_a
  end

  def counts(mesh)
    [mesh.points.size, mesh.simplices.size]
  end

  # A server that can be killed and started again, by a line.
  def restarting_server(*flags)
    IO.popen([from_environment('STELLATE_TEST_RESTARTING_SERVER'), *flags], 'r+') do |pipe|
      yield pipe.gets.strip, -> { pipe.puts && pipe.flush }
    end
  end
end

# A torus whose answers are spoilt after a while.
class Spoilt < Stellate::Torus
  def initialize(&spoil)
    super()
    @spoil, @asked = spoil, 0
  end

  def closest_point(points)
    @asked += points.size
    answer = super
    @asked > 300 ? @spoil.call(answer) : answer
  end
end

# Answers everything but tangents, and has seeds instead of a box.
class Sphere
  attr_reader :sizes

  def dimension = 2
  def ambient_dimension = 3
  def seeds = [[0.0, 0.0, 1.0]]

  def closest_point(points)
    points.map do |point|
      length = Math.sqrt(point.sum { |x| x * x })
      point.map { |x| x / length } if length > 1e-9
    end
  end

  def intersect_flat(centers, bases, radii)
    (@sizes ||= []) << centers.size
    centers.zip(bases, radii).map do |c, b, radius|
      # The flat is the line along u = t0 x t1 through c: |c + s u| = 1.
      u = [(b[1][0] * b[2][1]) - (b[2][0] * b[1][1]), (b[2][0] * b[0][1]) - (b[0][0] * b[2][1]),
           (b[0][0] * b[1][1]) - (b[1][0] * b[0][1])]
      cu = c.zip(u).sum { |x, y| x * y }
      root = (cu * cu) - c.sum { |x| x * x } + 1
      next if root.negative?

      along = (cu.negative? ? -Math.sqrt(root) : Math.sqrt(root)) - cu
      c.zip(u).map { |x, y| x + (along * y) } if along.abs <= radius
    end
  end

  def local_size(points) = points.map { 1.0 }
end
