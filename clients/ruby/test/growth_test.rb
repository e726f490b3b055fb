# frozen_string_literal: true

require_relative 'live'

# Deltas, without a server.
class GrowthTest < Minitest::Test
  V1 = Stellate::V1

  def setup
    @growth = Stellate::Growth.new(1, 2)
    @revision = 0
  end

  def test_simplices_that_come_back
    grow(points: 3, added: [[0, 1], [1, 2]])
    grow(removed: [[0, 1]])
    grow(added: [[0, 1]])
    grow(added: [[0, 2]], removed: [[0, 1]])
    grow(added: [[0, 1]])
    assert_equal [[0, 1], [0, 2], [1, 2]], @growth.mesh.simplices
    grow(removed: [[0, 2]])
    assert_equal [[0, 1], [1, 2]], @growth.mesh.simplices
  end

  def test_deltas_that_do_not_fit
    { /removes simplices that are not there/ => { removed: [[1, 2]] },
      /adds simplices that are there already/ => { added: [[0, 1]] },
      /vertex 3 of 3/ => { added: [[0, 3]] } }.each do |words, delta|
      setup
      grow(points: 3, added: [[0, 1]])
      error = assert_raises(Stellate::StellateError) do
        grow(**delta)
        @growth.mesh
      end
      assert_equal 'PROTOCOL', error.reason
      assert_match words, error.message
    end
  end

  def test_more_vertices_than_fit_into_a_word
    @growth = Stellate::Growth.new(6, 7)
    first, last = (0..6).to_a, (994..1000).to_a
    grow(points: 7, d: 7, added: [first])
    grow(points: 993, d: 7, added: [(1..6).to_a + [999]])
    grow(points: 1, d: 7, added: [last], removed: [first])
    assert_equal [[1, 2, 3, 4, 5, 6, 999], last], @growth.mesh.simplices
  end

  private

  def grow(points: 0, d: 2, added: [], removed: [])
    @count = @revision.zero? ? 0 : @count
    delta = V1::MeshDelta.new(
      revision: @revision += 1, first_vertex: @count, added: rows(added), removed: rows(removed),
      points: Stellate::Wire.to_wire([0.5] * (points * d), points, d)
    )
    @count += points
    @growth.absorb(V1::DeltaChunk.new(delta:, complete: true))
  end

  def rows(all)
    V1::IndexArray.new(shape: [all.size, all.first.size], data: all.flatten.pack('V*')) unless all.empty?
  end
end
