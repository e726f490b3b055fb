# frozen_string_literal: true

require 'digest'

module Stellate
  # Points on a manifold or near it, and what is asked of their mesh: checked, and as they travel.
  class Cloud
    CHUNK_BYTES = 1 << 20 # of the points in a message, where the server takes as much
    OPTIONS = { noise: :noise, reach: :declared_reach, drop: :drop, steiner: :steiner, label: :label }.freeze
    WEIGHTINGS = { 'auto' => :WEIGHTING_AUTO, 'only' => :WEIGHTING_ONLY }.freeze
    LIMITS = %i[worker_wait_seconds answer_seconds].freeze
    private_constant :CHUNK_BYTES, :OPTIONS, :WEIGHTINGS, :LIMITS

    # A V1::Reconstruction. Its ranges are the server's to check.
    attr_reader :spec

    # `points`: rows of d numbers; `tangents`: nil, or of each point a basis of its tangent space, d rows of k.
    def initialize(points, dimension, tangents, options)
      unless dimension.is_a?(Integer) && dimension.positive?
        raise Stellate.invalid("dimension has to be a whole number from 1 on, and is #{dimension.inspect}")
      end

      @n, @d, @k = points.size, points.first.to_a.size, dimension
      @points = packed(points, 'points', @d)
      @tangents = packed(tangents, 'tangents', @d * @k) if tangents
      raise Stellate.invalid("there are #{tangents.size} tangents and #{@n} points") if tangents&.size&.!= @n

      @spec = V1::Reconstruction.new(dimension:, ambient_dimension: @d, points: @n, tangents: !tangents.nil?,
                                     limits: V1::MeshLimits.new)
      options.compact.each { |name, value| set(name, value) }
    end

    # d
    def ambient_dimension
      @d
    end

    # The messages of an upload, from a point on. `most_bytes`: that the server takes in one.
    def chunks(mesh, first, most_bytes)
      width = 8 * @d * (@tangents ? 1 + @k : 1)
      rows = [[CHUNK_BYTES, most_bytes / 2].min / width, 1].max
      Enumerator.new do |sent|
        sent << V1::PointsChunk.new(mesh:)
        first.step(@n - 1, rows) { |row| sent << V1::PointsChunk.new(points: block(row, [rows, @n - row].min)) }
        sent << V1::PointsChunk.new(end: V1::PointsEnd.new(**digests))
      end
    end

    private

    def packed(rows, name, width)
      rows.each_with_index do |row, i|
        numbers = row.flatten
        if numbers.size != width
          raise Stellate.invalid("row #{i} of #{name} has #{numbers.size} numbers, and needs #{width}")
        end
        next if numbers.all? { |x| x.is_a?(Numeric) && x.to_f.finite? }

        raise Stellate.invalid("row #{i} of #{name} is #{row.inspect}: it has to be finite numbers")
      end
      rows.flatten.pack('E*')
    end

    def set(name, value)
      if OPTIONS.key?(name) then @spec[OPTIONS[name].to_s] = value
      elsif LIMITS.include?(name) then @spec.limits[name.to_s] = value
      elsif name == :closed then @spec.open = !value
      elsif name == :weights then @spec.weights = weighting(value)
      else
        known = (OPTIONS.keys + LIMITS + %i[closed weights]).sort
        raise Stellate.invalid("no option #{name}; known: #{known.join(', ')}")
      end
    rescue TypeError, RangeError => e
      raise Stellate.invalid("#{name} cannot be #{value.inspect}: #{e.message}")
    end

    def weighting(value)
      WEIGHTINGS.fetch(value.to_s) do
        raise Stellate.invalid("weights has to be 'auto' or 'only', and is #{value.inspect}")
      end
    end

    def block(row, count)
      part = V1::Points.new(first_row: row, points: rows_of(@points, row, count, @d))
      part.tangents = rows_of(@tangents, row, count, @d, @k) if @tangents
      part
    end

    def rows_of(data, row, count, *shape)
      width = 8 * shape.inject(:*)
      Wire.packed(data.byteslice(row * width, count * width), count, *shape)
    end

    def digests
      digests = { points_sha256: Digest::SHA256.digest(@points) }
      digests[:tangents_sha256] = Digest::SHA256.digest(@tangents) if @tangents
      digests
    end
  end
end
