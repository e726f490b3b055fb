# frozen_string_literal: true

require_relative 'live'

# The part of the unit sphere where z is not negative.
class Hemisphere
  def dimension = 2
  def ambient_dimension = 3
  def walls = 1
  def bounding_box = [[-1.1] * 3, [1.1] * 3]

  def closest_point(points)
    points.map do |x, y, z|
      length = Math.sqrt((x * x) + (y * y) + (z * z))
      [x / length, y / length, z / length]
    end
  end

  def face_point(points, _face) = closest_point(points.map { |x, y, _| [x, y, 0.0] })

  def tangent_basis(points)
    points.map do |x, y, z|
      s = z.negative? ? -1.0 : 1.0
      a = -1 / (s + z)
      [1 + (s * x * x * a), x * y * a, s * x * y * a, s + (y * y * a), -s * x, -y]
    end
  end

  def clearances(points) = points.map(&:last)
  def conormals(points, _face) = points.map { [0.0, 0.0, -1.0] }
end

# Manifolds with boundary.
class WallsTest < Minitest::Test
  def test_a_hemisphere
    Stellate::Server.start do |server|
      client = Stellate::Client.new(server)
      mesh = Stellate.mesh(Hemisphere.new, epsilon: 0.2, server: client)
      assert_predicate mesh, :certified?
      assert_equal Live.from_environment('STELLATE_TEST_HEMISPHERE'), Live.counts(mesh).join(' ')
      assert_equal mesh.points.size, mesh.walls.size
      mesh.points.zip(mesh.walls) { |(_, _, z), walls| assert_equal [z >= 0, z.zero? ? 1 : 0], [true, walls] }
      on = mesh.walls.sum
      assert_operator on, :>, 0
      assert_equal on, mesh.boundary.size # a circle
      assert(mesh.boundary.flatten.all? { |vertex| mesh.walls[vertex] == 1 })

      name = client.create(Hemisphere.new, epsilon: 0.2).name
      assert_raises(Stellate::InvalidArgument) { client.serve(Live::TORUS, name) }
      assert_equal 'SUCCEEDED', client.serve(Hemisphere.new, name)
      assert_equal mesh.walls, Stellate.download(name, server: client).walls
    end
  end

  def test_walls_without_what_they_need
    bare = Class.new(Stellate::Torus) { def walls = 1 }
    error = assert_raises(Stellate::InvalidArgument) { Stellate::CheckedOracle.new(bare.new) }
    assert_includes error.message, 'face_point and clearances and conormals'
  end
end
