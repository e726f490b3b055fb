# frozen_string_literal: true

module Stellate
  # A simplicial k-complex in R^d. `points` and `simplices` are arrays of rows; ids count from zero,
  # ascend in each row, and rows are in lexicographic order. `walls` are, as bits, those that each vertex lies
  # on; nil without a boundary. `turned` is the protocol's Orientation.turned: see oriented_simplices.
  class Mesh
    attr_reader :dimension, :ambient_dimension, :points, :simplices, :revision, :progress, :report, :walls, :turned
    # What a mesh that is over was made with, and why it is that where 'auto' chose it, else ''; nil of others.
    attr_accessor :epsilon, :epsilon_reason
    # Of a reconstruction: what became of each point, 'OK' or another Place of mesh.proto; and, where the points
    # were noisy, the positions that it was built on, in rows. Else nil.
    attr_accessor :places, :smoothed

    def initialize(k, d, points, simplices, revision, progress: nil, report: nil, walls: nil, turned: nil)
      @dimension, @ambient_dimension, @points, @simplices = k, d, points, simplices
      @revision, @progress, @report, @walls, @turned = revision, progress, report, walls, turned
    end

    # Reads the .txt format back, to the last bit.
    def self.load_txt(path)
      words = File.read(path).split
      k, d, vertices, simplices = words.shift(4).map { |word| Integer(word) }
      points = words.shift(d * vertices).map { |word| Float(word) }
      ids = words.shift((k + 1) * simplices).map { |word| Integer(word) }
      new(k, d, points.each_slice(d).to_a, ids.each_slice(k + 1).to_a, 0)
    end

    # Whether the mesh is finished and proved good.
    def certified?
      report&.certificate&.certified || false
    end

    # The (k-1)-faces that are in one simplex alone; each lies on the walls that all its vertices have in common.
    def boundary
      faces = simplices.flat_map { |row| row.each_index.map { |i| row[0, i] + row[(i + 1)..] } }
      faces.tally.filter_map { |face, count| face if count == 1 }.sort!
    end

    # Raises SaveError if a mesh of that kind cannot have the name.
    def self.check_save(path, k, d)
      return if path.end_with?('.txt') || (path.end_with?('.obj') && k <= 2 && d <= 3)

      raise SaveError.new('.obj holds curves and surfaces of the plane and of space', reason: 'FORMAT') if
        path.end_with?('.obj')

      raise SaveError.new("#{path} has to end in .txt or .obj; stellate download writes others", reason: 'FORMAT')
    end

    # Writes .txt (any k and d, exact: "k d nv ns", coordinates, ids from zero) or .obj (oriented as
    # oriented_simplices are). The file takes its name when it is whole.
    def save(path)
      Mesh.check_save(path, dimension, ambient_dimension)
      text = path.end_with?('.txt') ? to_txt : to_obj
      File.write("#{path}.part", text)
      File.rename("#{path}.part", path)
    end

    # The simplices with the last two vertices of some exchanged so that neighbours agree, and the normals of a
    # hypersurface point outwards. The server tells it of meshes that are over. nil if the mesh is not
    # orientable, and where that is not known: while it grows, and of a .txt file.
    def oriented_simplices
      return unless turned

      simplices.each_with_index.map do |row, i|
        (turned.getbyte(i / 8) >> (i % 8)).odd? ? [*row[...-2], row[-1], row[-2]] : row
      end
    end

    private

    def lines(rows, format)
      rows.map { |row| format(format, *row) }
    end

    def coordinates
      lines(points, (['%.17g'] * ambient_dimension).join(' '))
    end

    def to_txt
      head = [dimension, ambient_dimension, points.size, simplices.size].join(' ')
      [head, *coordinates, *simplices.map { |row| row.join(' ') }, ''].join("\n")
    end

    def to_obj
      filled = ' 0' * (3 - ambient_dimension)
      letter = dimension == 1 ? 'l' : 'f'
      cells = (oriented_simplices || simplices).map { |row| "#{letter} #{row.map(&:succ).join(' ')}" }
      [*coordinates.map { |line| "v #{line}#{filled}" }, *cells, ''].join("\n")
    end
  end
end
