# frozen_string_literal: true

module Stellate
  # The client's copy of a mesh that grows by deltas: vertices and simplices as of the last complete
  # revision. A delta that does not fit what came before is a StellateError with the reason PROTOCOL.
  class Growth
    attr_reader :revision

    def initialize(k, d)
      @k, @d = k, d
      reset
    end

    # Back to the empty mesh.
    def reset
      @revision, @points, @rows, @pending = 0, [], {}, []
    end

    # Takes one chunk; true when a revision is complete with it.
    def absorb(chunk)
      revision = chunk.delta ? chunk.delta.revision : 0
      if revision <= @revision || (@pending.any? && @pending.first.revision != revision)
        raise Stellate.protocol_error("revision #{revision} is out of order")
      end

      @pending << chunk.delta
      return false unless chunk.complete

      whole, @pending = @pending, []
      whole.each { |delta| add_points(delta.first_vertex, delta.points) }
      whole.each { |delta| change(delta.added, delta.removed) }
      @revision = revision
      true
    end

    # Drops the chunks of a revision that was cut short: it will be sent again.
    def forget_pending
      @pending = []
    end

    def add_points(first, array)
      block = Wire.numbers(array, nil, @d)
      count = @points.size / @d
      unless block.empty? || first == count
        raise Stellate.protocol_error("a delta starts at vertex #{first}, and there are #{count}")
      end

      @points.concat(block)
    end

    def change(added, removed)
      Wire.rows(removed, @k + 1).each do |row|
        @rows.delete(row) or raise Stellate.protocol_error('a delta removes simplices that are not there')
      end
      rows = Wire.rows(added, @k + 1)
      before = @rows.size
      rows.each { |row| @rows[row] = true }
      return if @rows.size == before + rows.size && known?(rows)

      raise Stellate.protocol_error('a delta adds simplices that are there, or vertices that are not')
    end

    # The mesh as of the last complete revision: its points and simplices are arrays of rows.
    def mesh(revision = @revision, **more)
      simplices = @rows.keys.sort.join.unpack('N*').each_slice(@k + 1).to_a
      Mesh.new(@k, @d, @points.each_slice(@d).to_a, simplices, revision, **more)
    end

    private

    def known?(rows)
      (rows.join.unpack('N*').max || -1) < @points.size / @d
    end
  end
end
