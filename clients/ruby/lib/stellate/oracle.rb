# frozen_string_literal: true

module Stellate
  # An oracle as the server sees it: answers are checked, with clear words.
  #
  # An oracle is any object with `dimension`, `ambient_dimension`, `bounding_box` ([lower, upper]) or
  # `seeds` (points near M), and these methods on whole batches, arrays of points; the last three
  # are optional:
  #   closest_point(points): a point of M nearest to each; nil where there is none
  #   intersect_flat(centers, bases, radii): the point of M nearest to each center in the flat through it
  #     that is orthogonal to the columns of its basis (d rows of k), within the radius; else nil
  #   tangent_basis(points): at points of M d rows of k numbers, orthonormal columns; or these d k numbers
  #     in one array, which is quicker
  #   local_size(points): at points of M the local feature size, or any positive lengths
  # The answer to a query must not depend on the rest of its batch. Calls come one at a time.
  #
  # A manifold with boundary has `walls`, their number: it is where all walls are at least 0 on M^, a manifold
  # without boundary, which the methods above describe; it may be R^d itself. It needs tangent_basis, and:
  #   face_point(points, face): as closest_point, of points of M^ where the walls of the face, their numbers
  #     ascending, are 0, whatever the others are
  #   clearances(points): at each point the walls' values, whose signs count
  #   conormals(points, face): at points of a face, of each of its walls the unit normal within the tangent
  #     space along which the wall's value falls, one after the other in one array
  class CheckedOracle
    attr_reader :k, :d, :walls

    def initialize(oracle)
      @oracle = oracle
      @k, @d = oracle.dimension, oracle.ambient_dimension
      @walls = oracle.respond_to?(:walls) ? oracle.walls : 0
      @turn = Mutex.new
      lacking = %i[tangent_basis face_point clearances conormals].reject { |name| oracle.respond_to?(name) }
      raise Stellate.invalid("an oracle with walls needs #{lacking.join(' and ')}") if walls != 0 && lacking.any?

      unless oracle.respond_to?(:closest_point)
        raise InvalidArgument.new("#{oracle.class} has no method closest_point", reason: 'INVALID_ARGUMENT')
      end
    rescue NoMethodError => e
      raise InvalidArgument.new("an oracle needs #{e.name}", reason: 'INVALID_ARGUMENT')
    end

    def capabilities
      V1::OracleCapabilities.new(
        **%i[intersect_flat tangent_basis local_size].to_h { |name| [name, @oracle.respond_to?(name)] },
        conormals: walls.positive?
      )
    end

    def whereabouts
      { bounding_box: @oracle.respond_to?(:bounding_box) ? @oracle.bounding_box : nil,
        seeds: @oracle.respond_to?(:seeds) ? @oracle.seeds : nil }
    end

    # The answers to one chunk. Raises whatever the oracle does.
    def answer(chunk)
      @turn.synchronize { asked(chunk) }
    end

    private

    def asked(chunk)
      x = Wire.numbers(chunk.points, nil, d).each_slice(d).to_a
      n = x.size
      points, data = checked(method_of(chunk), ask(chunk, x), n, d)
      reply = V1::AnswerChunk.new(lease: chunk.lease)
      unless data
        reply.found = points.map { |point| point ? 1 : 0 }.pack('C*')
        nowhere = [0.0] * d
        data = points.flat_map { |point| point || nowhere }.pack('E*')
      end
      reply.points = Wire.packed(data, n, d)
      if chunk.want_tangents
        anywhere = Array.new(d) { |row| Array.new(k) { |column| row == column ? 1.0 : 0.0 } }.flatten
        reply.tangents = Wire.packed(at_found(:tangent_basis, points, anywhere), n, d, k)
      end
      reply.sizes = Wire.packed(at_found(:local_size, points, [1.0]), n) if chunk.want_sizes
      add_walls(reply, chunk.face.to_a, points) if chunk.want_clearances
      reply
    end

    # What the walls are at the points, and, on a face, its conormals.
    def add_walls(reply, face, points)
      n = points.size
      reply.clearances = Wire.packed(at_found(:clearances, points, [0.0] * walls), n, walls)
      return if face.empty?

      normals = at_found(:conormals, points, [0.0] * (face.size * d), face)
      reply.conormals = Wire.packed(normals, n, face.size, d)
    end

    def method_of(chunk)
      case chunk.kind
      when :QUERY_KIND_CLOSEST_POINT then chunk.face.empty? ? :closest_point : :face_point
      when :QUERY_KIND_INTERSECT_FLAT then :intersect_flat
      else raise "the server asks a question of kind #{chunk.kind}, unknown to this client"
      end
    end

    def ask(chunk, x)
      return @oracle.face_point(x, chunk.face.to_a) unless chunk.face.empty?
      return @oracle.closest_point(x) if chunk.kind == :QUERY_KIND_CLOSEST_POINT

      bases = Wire.numbers(chunk.bases, x.size, d, k).each_slice(k).each_slice(d).to_a
      @oracle.intersect_flat(x, bases, Wire.numbers(chunk.radii, x.size))
    end

    # What the method says of the points that were found, and `anywhere` for the others, as bytes.
    def at_found(method, points, anywhere, *more)
      on = points.include?(nil) ? points.compact : points
      values, data = if on.empty?
                       []
                     else
                       checked(method, @oracle.public_send(method, on, *more), on.size,
                               anywhere.size)
                     end
      return data || values.flatten.pack('E*') if on.size == points.size

      points.flat_map { |point| point ? [values.shift].flatten : anywhere }.pack('E*')
    end

    # The answer with n rows of `width` finite numbers, or nil; and all of these as bytes, where none is nil.
    def checked(method, answer, n, width)
      raise wrong(method, "#{answer.class}, not an array of #{n} answers", 'SHAPE') unless answer.is_a?(Array)
      raise wrong(method, "#{answer.size} answers to #{n} questions", 'SHAPE') unless answer.size == n

      data = sound(answer, n, width) # looked at as a whole, which is quicker
      return [answer, data] if data

      rows = answer.map do |row|
        next if row.nil? && %i[closest_point intersect_flat face_point].include?(method)

        numbers = [row].flatten
        raise wrong(method, "#{row.inspect}, not #{width} numbers", 'SHAPE') unless
          numbers.size == width && numbers.all?(Numeric)
        raise wrong(method, row.inspect, 'NOT_FINITE') unless numbers.all?(&:finite?)

        numbers
      end
      [rows, rows.include?(nil) ? nil : rows.flatten.pack('E*')]
    end

    # The bytes of all numbers, where they are what they should be; else nil. Rows of numbers are laid out
    # much faster than rows of rows.
    def sound(answer, n, width)
      first = answer.first
      each = first.is_a?(Array) ? first.size : 1
      return unless answer.all? { |row| row.is_a?(Array) ? row.size == each : each == 1 }

      flat = first.is_a?(Array) && first.first.is_a?(Array) ? answer.flatten : answer.flatten(1)
      flat.pack('E*') if flat.size == n * width && flat.sum.finite?
    rescue TypeError, RangeError, NoMethodError # something is no number
      nil
    end

    def wrong(method, what, reason)
      OracleError.new("#{method} returned #{what}", reason: "ORACLE_#{reason}")
    end
  end
end
