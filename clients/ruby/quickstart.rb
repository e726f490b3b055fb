# frozen_string_literal: true

# Meshes a torus through an oracle of its own, and writes torus.obj and torus.txt.
#
# Usage: ruby quickstart.rb [EPSILON] [OUTPUT_DIRECTORY]; exit status 0: certified.
require_relative 'lib/stellate'

# A torus in space; points are arrays.
class Torus
  def dimension = 2
  def ambient_dimension = 3
  def bounding_box = [[-1.5, -1.5, -0.5], [1.5, 1.5, 0.5]]

  def closest_point(points)
    points.map do |x, y, z|
      ring = Math.hypot(x, y)
      tube = Math.hypot(ring - 1, z)
      scale = (1 + (0.4 * (ring - 1) / tube)) / ring
      [x * scale, y * scale, 0.4 * z / tube]
    end
  end
end

mesh = Stellate.mesh(Torus.new, epsilon: (ARGV[0] || 0.1).to_f, on_progress: Stellate::ProgressBar.new)
puts mesh.report.text
%w[torus.obj torus.txt].each { |name| mesh.save(File.join(ARGV[1] || '.', name)) }
exit(mesh.certified?)
