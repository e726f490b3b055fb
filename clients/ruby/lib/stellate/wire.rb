# frozen_string_literal: true

module Stellate
  # Arrays as they travel.
  module Wire
    module_function

    # The bytes of an array of that shape, nil standing for any extent; absent: no rows.
    def bytes(array, width, *shape)
      given, data = array ? [array.shape.to_a, array.data] : [[], '']
      return data if given.empty? && data.empty? && [nil, 0].include?(shape.first)

      fits = given.size == shape.size && given.zip(shape).all? { |is, wanted| wanted.nil? || is == wanted }
      return data if fits && given.inject(:*) * width == data.bytesize

      raise Stellate.protocol_error("an array of shape #{given} and #{data.bytesize} bytes came, not #{shape}")
    end

    def numbers(array, *shape)
      bytes(array, 8, *shape).unpack('E*')
    end

    def to_wire(values, *shape)
      packed(values.pack('E*'), *shape)
    end

    def packed(data, *shape)
      V1::Array.new(shape:, data:)
    end

    # An enumerator without its prefix; "UNKNOWN" for one of a newer server.
    def name(value, prefix)
      value.is_a?(Symbol) ? value.to_s.delete_prefix(prefix) : 'UNKNOWN'
    end
  end
end
