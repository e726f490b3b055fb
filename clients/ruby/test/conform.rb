# frozen_string_literal: true

# Obeys `stellate conform`, whose help says what each line wants.
require_relative '../lib/stellate'

$stdout.sync = true
SERVER = ARGV.shift
CLIENT = Stellate::Client.new(SERVER, on_outage: ->(_said) {})

# The unit circle of the first two coordinates of R^d.
Circle = Struct.new(:ambient_dimension) do
  def dimension
    1
  end

  def closest_point(points)
    points.map do |x, y|
      length = Math.hypot(x, y)
      [x / length, y / length] + ([0.0] * (ambient_dimension - 2))
    end
  end

  def tangent_basis(points)
    points.map { |x, y| [[-y], [x]] + Array.new(ambient_dimension - 2) { [0.0] } }
  end
end

# The unit sphere, which meets lines; its sizes are 1 + z / 2.
class Sphere
  def dimension
    2
  end

  def ambient_dimension
    3
  end

  def closest_point(points)
    points.map { |point| point.map { |x| x / Math.sqrt(dot(point, point)) } }
  end

  def tangent_basis(points)
    points.map do |x, y, z|
      s = z.negative? ? -1.0 : 1.0
      a = -1 / (s + z)
      b = x * y * a
      [[1 + (s * x * x * a), b], [s * b, s + (y * y * a)], [-s * x, -y]]
    end
  end

  def local_size(points)
    points.map { |point| 1 + (point[2] / 2) }
  end

  def intersect_flat(centers, bases, radii)
    centers.zip(bases, radii).map do |center, ((a, p), (b, q), (e, r)), radius|
      along = [(b * r) - (e * q), (e * p) - (a * r), (a * q) - (b * p)]
      middle = dot(along, center)
      root = (middle * middle) - dot(center, center) + 1
      next if root.negative?

      step = (middle.positive? ? Math.sqrt(root) : -Math.sqrt(root)) - middle
      center.zip(along).map { |x, u| x + (step * u) } if step.abs <= radius
    end
  end

  private

  def dot(one, other)
    one.zip(other).sum { |x, y| x * y }
  end
end

# The part of the sphere where z and y are not negative, its two walls.
class Lune < Sphere
  AXES = [2, 1].freeze
  undef_method :local_size, :intersect_flat

  def walls = 2
  def bounding_box = [[-1.1] * 3, [1.1] * 3]

  def face_point(points, face)
    axes = AXES.values_at(*face)
    flat = points.map { |point| point.each_with_index.map { |x, axis| axes.include?(axis) ? 0.0 : x } }
    closest_point(flat).map { |point| point unless point.any?(&:nan?) }
  end

  def clearances(points) = points.map { |point| point.values_at(*AXES) }

  def conormals(points, face)
    one_row = AXES.values_at(*face).flat_map { |axis| Array.new(3) { |i| i == axis ? -1.0 : 0.0 } }
    points.map { one_row }
  end
end

# A torus whose closest point the block may refuse.
class Spoiled < Stellate::Torus
  def initialize(&spoil)
    super()
    @spoil = spoil
  end

  def closest_point(points)
    @spoil.call(points, super)
  end
end

def manifold(name)
  return Circle.new(Integer(name.split(':').last)) if name.start_with?('circle:')

  case name
  when 'torus' then Stellate::Torus.new
  when 'clifford' then Stellate::ProductOfCircles.new
  when 'sphere' then Sphere.new
  when 'lune' then Lune.new
  when 'half' then Spoiled.new { |x, found| x.zip(found).map { |from, point| point if from[0] >= 0 } }
  when 'raises' then Spoiled.new { |_x, _found| raise 'on purpose' }
  when 'slow' then Spoiled.new { |_x, found| sleep(2) && found }
  end
end

def create(label, how = '')
  torus = how == 'walls' ? Lune.new : Stellate::Torus.new
  torus.define_singleton_method(:bounding_box) { nil } if how == 'seeds'
  seeds = how == 'seeds' ? [[1.4, 0.0, 0.0]] : nil
  token = how.delete_prefix('token=') if how.start_with?('token=')
  known = Stellate::Client.new(SERVER, credentials: Stellate::Credentials.new(token:))
  "created #{known.create(torus, epsilon: 0.5, label:, seeds:).name}"
end

def watch(name, path, *_dimensions)
  mesh = nil
  begin
    Stellate.watch(name, server: CLIENT) { |grown| mesh = grown }
  rescue Stellate::Cancelled => e
    raise unless (mesh = e.mesh)
  end
  mesh.save(path)
  File.write("#{path}.walls", mesh.walls.map { |bits| "#{bits}\n" }.join) if mesh.walls
  "mesh #{mesh.revision} #{ended(mesh)}"
end

def ended(mesh)
  level = Stellate::Wire.name(mesh.report.certificate&.level || 0, 'CERTIFICATE_LEVEL_')
  "#{Stellate::Wire.name(mesh.report.termination, 'TERMINATION_')} #{level}"
end

def reconstruct(path, dimension, _ambient)
  points = File.foreach(path).map { |line| line.split.map { |word| Float(word) } }
  "mesh - #{ended(Stellate.reconstruct(points, dimension: Integer(dimension), server: CLIENT))}"
end

def save(mesh, path)
  Stellate::Mesh.load_txt(mesh).save(path)
  'saved'
end

def serve(mesh, name)
  oracle = manifold(name)
  oracle ? "over #{CLIENT.serve(oracle, mesh)}" : 'unsupported'
rescue RuntimeError => e
  raise if e.is_a?(Stellate::StellateError)

  "error oracle RAISED #{e.message}"
end

$stdin.each_line do |line|
  command, *words = line.split
  begin
    puts %w[serve watch create reconstruct save].include?(command) ? send(command, *words) : 'unsupported'
  rescue Stellate::StellateError => e
    puts "error #{e.class.name.split('::').last} #{e.reason} #{e.message.tr("\n", ' ')}"
  end
end
