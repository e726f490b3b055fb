# frozen_string_literal: true

module Stellate
  # The torus of tube radius `minor` around a circle of radius `major`: k = 2, d = 3.
  class Torus
    attr_reader :dimension, :ambient_dimension, :bounding_box

    def initialize(major = 1.0, minor = 0.4)
      @major, @minor, @dimension, @ambient_dimension = major, minor, 2, 3
      corner = [major + minor, major + minor, minor].map { |x| 1.1 * x }
      @bounding_box = [corner.map(&:-@), corner]
    end

    def closest_point(points)
      points.map do |x, y, z|
        ring = Math.sqrt((x * x) + (y * y))
        off = ring - @major
        tube = Math.sqrt((off * off) + (z * z))
        next unless ring > 1e-12 && tube > 1e-12

        scale = (@major + (@minor * off / tube)) / ring
        [x * scale, y * scale, @minor * z / tube]
      end
    end

    def tangent_basis(points)
      points.map do |x, y, z|
        ring = Math.sqrt((x * x) + (y * y))
        c, s, out, up = x / ring, y / ring, (ring - @major) / @minor, z / @minor
        [-s, -c * up, c, -s * up, 0.0, out]
      end
    end
  end

  # T^k as a product of unit circles in R^2k; for k = 2 the Clifford torus. It is flat.
  class ProductOfCircles
    attr_reader :dimension, :ambient_dimension, :bounding_box

    def initialize(dimension = 2)
      @dimension, @ambient_dimension = dimension, 2 * dimension
      @bounding_box = [[-1.1] * (2 * dimension), [1.1] * (2 * dimension)]
    end

    def closest_point(points)
      points.map do |point|
        lengths = point.each_slice(2).map { |x, y| Math.sqrt((x * x) + (y * y)) }
        next unless lengths.all? { |length| length > 1e-12 }

        point.each_with_index.map { |x, i| x / lengths[i / 2] }
      end
    end

    def tangent_basis(points)
      points.map do |point|
        basis = [0.0] * (ambient_dimension * dimension)
        dimension.times do |a|
          row = (2 * a * dimension) + a
          basis[row], basis[row + dimension] = -point[(2 * a) + 1], point[2 * a]
        end
        basis
      end
    end
  end
end
