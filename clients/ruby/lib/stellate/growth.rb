# frozen_string_literal: true

module Stellate
  # The client's copy of a mesh that grows by deltas: vertices and simplices as of the last complete
  # revision. A delta that does not fit what came before is a StellateError with the reason PROTOCOL.
  #
  # A simplex is one number here, its vertices from the first on in digits of so many bits: numbers are
  # compared, counted and sorted a row at a time, without an object for each.
  class Growth
    WORD_BITS = 62 # of numbers that are no objects
    UNSETTLED = 1_000_000 # simplices that have gone, and are still here
    private_constant :WORD_BITS, :UNSETTLED

    attr_reader :revision

    def initialize(k, d)
      @k, @d = k, d
      reset
    end

    # Back to the empty mesh.
    def reset
      @revision, @points, @pending, @simplices, @gone = 0, [], [], [], []
      @bits = WORD_BITS / (@k + 1)
      @arrays = @arrays_of = @turned = nil
      @walls, @turned_simplices = {}, []
      @places, @smoothed = [], []
    end

    # Takes one chunk; true when a revision is complete with it.
    def absorb(chunk)
      revision = chunk.delta ? chunk.delta.revision : 0
      if revision <= @revision || (@pending.any? && @pending.first.revision != revision)
        raise Stellate.protocol_error("revision #{revision} is out of order")
      end

      @turned = nil
      @pending << chunk.delta
      return false unless chunk.complete

      whole, @pending = @pending, []
      whole.each do |delta|
        add_points(delta.first_vertex, delta.points)
        add_walls(delta.boundary_vertices, delta.boundary_walls)
      end
      whole.each do |delta|
        change(delta.added, delta.removed)
        Thread.pass # to workers that have been asked something
      end
      @revision = revision
      settle if @gone.size > UNSETTLED
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
      widen while @points.size / @d > (1 << @bits)
    end

    # Which of the vertices lie on which walls.
    def add_walls(vertices, walls)
      count = @points.size / @d
      unless vertices.size == walls.size && (vertices.max || -1) < count
        raise Stellate.protocol_error("walls of #{vertices.size} vertices do not fit the #{count} that there are")
      end

      @walls.update(vertices.zip(walls.to_a).to_h)
    end

    # What goes is put aside, and taken out for many revisions together.
    def change(added, removed)
      @gone.concat(numbered(removed))
      @simplices.concat(numbered(added))
    end

    # Takes a chunk of the orientation, which comes after the last revision.
    def orient(chunk)
      return @turned = nil unless chunk.orientable

      @turned = ''.b if chunk.first_simplex.zero?
      unless @turned && chunk.first_simplex == 8 * @turned.bytesize
        raise Stellate.protocol_error("the orientation of simplex #{chunk.first_simplex} is out of order")
      end

      @turned << chunk.turned
    end

    # Takes the simplices of a part of a download, oriented where it says so.
    def add_cells(cells, orientation)
      change(cells, nil)
      count = cells ? cells.data.bytesize / (4 * (@k + 1)) : 0
      return if count.zero?
      return @untold = true unless orientation&.orientable

      turned = orientation.turned
      check_bits(turned, count)
      @simplices.last(count).each_with_index do |simplex, i|
        @turned_simplices << simplex if (turned.getbyte(i / 8) >> (i % 8)).odd?
      end
    end

    # Takes what became of the points of a part of a download.
    def add_places(part)
      part.codes.each_byte { |code| @places << (V1::Place.lookup(code) || code).to_s.delete_prefix('PLACE_') }
      @smoothed.concat(Wire.numbers(part.smoothed, part.codes.bytesize, @d)) if part.smoothed
    end

    # The points and simplices of mesh(), as arrays of rows, for when no thread waits for this one.
    def arrays
      @arrays = nil if @arrays_of != @revision
      @arrays_of = @revision
      @arrays ||= [@points.each_slice(@d).to_a, rows(settle.sort!)]
    end

    # The mesh as of the last complete revision, or, of a download, of another.
    def mesh(revision = @revision, **more)
      walls = Array.new(@points.size / @d) { |vertex| @walls.fetch(vertex, 0) } unless @walls.empty?
      Mesh.new(@k, @d, *arrays, revision, walls:, **more)
    end

    # The mesh at its end, with its orientation.
    def finished(**more)
      check_bits(@turned, arrays[1].size) if @turned
      mesh(turned: @turned, **more)
    end

    # The mesh of a download that is complete.
    def downloaded(revision, **more)
      settle.sort!
      unless @untold
        turned = @turned_simplices.to_h { |simplex| [simplex, 1] }
        bits = @simplices.map { |simplex| turned.fetch(simplex, 0) }.join
      end
      mesh = mesh(revision, turned: bits && [bits].pack('b*'), **more)
      mesh.places = @places if @places.size == mesh.points.size
      mesh.smoothed = @smoothed.each_slice(@d).to_a if @smoothed.size == @points.size && @smoothed.any?
      mesh
    end

    private

    def check_bits(turned, count)
      return if turned.bytesize == (count + 7) / 8

      raise Stellate.protocol_error("an orientation of #{turned.bytesize} bytes came for #{count} simplices")
    end

    # The simplices that are there.
    def settle
      left = @simplices - @gone
      # Where none came twice, this is right if as many went as should have.
      once = @simplices.uniq.size == @simplices.size
      left = counted unless once && left.size == @simplices.size - @gone.size
      @gone = []
      @simplices = left
    end

    # The same where a simplex may have come and gone several times.
    def counted
      counts = @simplices.tally
      @gone.each { |simplex| counts[simplex] = counts.fetch(simplex, 0) - 1 }
      least, most = counts.each_value.minmax
      raise Stellate.protocol_error('a delta removes simplices that are not there') if least&.negative?
      raise Stellate.protocol_error('a delta adds simplices that are there already') if most.to_i > 1

      counts.filter_map { |simplex, count| simplex if count == 1 }
    end

    # The rows of an array, each as one number.
    def numbered(array)
      ids = Wire.bytes(array, 4, nil, @k + 1).unpack('V*')
      if (ids.max || -1) >= @points.size / @d
        raise Stellate.protocol_error("a simplex has vertex #{ids.max} of #{@points.size / @d}")
      end

      numbers, i, bits, width = [], 0, @bits, @k + 1
      while i < ids.size # three times as fast as each_slice
        number, last = ids[i], i + width
        number = (number << bits) | ids[i] while (i += 1) < last
        numbers << number
      end
      numbers
    end

    # Numbers as the rows that they stand for.
    def rows(numbers)
      shifts, mask = @k.downto(0).map { |place| place * @bits }, (1 << @bits) - 1
      numbers.map { |number| shifts.map { |shift| (number >> shift) & mask } }
    end

    # Makes room for more vertices. Numbers may be of any size, but large ones are objects.
    def widen
      wider = lambda do |row|
        row.inject { |number, id| (number << (2 * @bits)) | id }
      end
      @simplices, @gone, @turned_simplices =
        [@simplices, @gone, @turned_simplices].map { |numbers| rows(numbers).map(&wider) }
      @bits *= 2
    end
  end
end
