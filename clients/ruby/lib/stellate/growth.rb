# frozen_string_literal: true

module Stellate
  # The client's copy of a mesh that grows by deltas: vertices and simplices as of the last complete
  # revision. A delta that does not fit what came before is a StellateError with the reason PROTOCOL.
  class Growth
    UNSETTLED = 64 << 20 # bytes
    private_constant :UNSETTLED

    attr_reader :revision

    def initialize(k, d)
      @k, @d = k, d
      reset
    end

    # Back to the empty mesh.
    def reset
      @revision, @points, @rows, @pending, @unsettled, @size = 0, [], {}, [], [], 0
      @arrays = @arrays_of = nil
    end

    # Takes one chunk; true when a revision is complete with it.
    def absorb(chunk)
      revision = chunk.delta ? chunk.delta.revision : 0
      if revision <= @revision || (@pending.any? && @pending.first.revision != revision)
        raise Stellate.protocol_error("revision #{revision} is out of order")
      end

      @pending << chunk.delta
      return false unless chunk.complete

      @unsettled << @pending
      @size += @pending.sum { |delta| [delta.points, delta.added, delta.removed].sum { |a| a ? a.data.size : 0 } }
      @pending = []
      @revision = revision
      settle if @size > UNSETTLED
      true
    end

    # Looks into what has come: many revisions at once, when nobody waits for this thread.
    def settle
      whole, @unsettled, @size = @unsettled, [], 0
      whole.each do |deltas|
        deltas.each { |delta| add_points(delta.first_vertex, delta.points) }
        deltas.each { |delta| change(delta.added, delta.removed) }
        Thread.pass # to workers that have been asked something
      end
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
      most = added ? added.data.unpack('V*').max : nil
      return if @rows.size == before + rows.size && (most || -1) < @points.size / @d

      raise Stellate.protocol_error('a delta adds simplices that are there, or vertices that are not')
    end

    # The points and simplices of mesh(), as arrays of rows, for when nobody waits for this thread.
    def arrays
      settle
      @arrays = nil if @arrays_of != @revision
      @arrays_of = @revision
      @arrays ||= [@points.each_slice(@d).to_a, sorted_rows]
    end

    # The mesh as of the last complete revision, or, of a download, of another.
    def mesh(revision = @revision, **more)
      Mesh.new(@k, @d, *arrays, revision, **more)
    end

    private

    def sorted_rows
      # Big-endian bytes sort as the numbers do.
      sorted = Wire.split(@rows.keys.join.unpack('V*').pack('N*'), @k + 1).sort!
      sorted.join.unpack('N*').each_slice(@k + 1).to_a
    end
  end
end
