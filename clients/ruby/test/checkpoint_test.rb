# frozen_string_literal: true

require_relative 'live'

# Meshes that outlive their programs.
class CheckpointTest < Minitest::Test
  # The torus, and how often it was asked.
  class Counting < Stellate::Torus
    attr_reader :asked

    def closest_point(points)
      @asked = asked.to_i + points.size
      super
    end
  end

  def setup
    @folder = Dir.mktmpdir('stellate-test-')
    @checkpoint = File.join(@folder, 'torus')
  end

  def teardown
    FileUtils.rm_rf(@folder)
  end

  def test_an_interrupted_mesh_goes_on
    first, second, third = Array.new(3) { Counting.new }
    on_progress = ->(progress) { raise Interrupt if progress.vertices > 500 }
    error = assert_raises(Stellate::Cancelled) { kept(first, on_progress:) }
    assert_includes error.message, 'the same call goes on from there'
    assert_operator error.mesh.points.size, :>, 0
    mesh = kept(second, label: 'another label is no other mesh')
    straight = Stellate.mesh(Live::TORUS, epsilon: 0.05)
    assert_equal [straight.points, straight.simplices], [mesh.points, mesh.simplices]
    assert_operator first.asked, :>, 0
    assert_operator second.asked, :<, straight.report.counts.queries
    # The record of another language's client writes out an empty label.
    File.open(File.join(@checkpoint, 'mesh'), 'ab') { |record| record.write("R\0") }
    again = kept(third)
    assert_nil third.asked
    assert_predicate again, :certified?
    assert_equal Live.counts(mesh), Live.counts(again)
    assert_raises(Stellate::InvalidArgument) { Stellate.mesh(third, epsilon: 0.06, checkpoint: @checkpoint) }
  end

  def test_a_folder_in_which_others_write_is_refused
    Dir.mkdir(@checkpoint)
    File.chmod(0o777, @checkpoint)
    assert_includes refused, 'chmod go-w'
    File.chmod(0o700, @checkpoint)
    File.rename(@checkpoint, "#{@checkpoint}.elsewhere")
    File.symlink("#{@checkpoint}.elsewhere", @checkpoint)
    assert_includes refused, 'is a link'
    assert_empty Dir.children("#{@checkpoint}.elsewhere")
  end

  def test_a_planted_link_leads_nowhere
    precious = File.join(@folder, 'precious')
    File.write(precious, 'mine')
    Dir.mkdir(@checkpoint, 0o700)
    File.symlink(precious, File.join(@checkpoint, 'mesh.new'))
    kept(Counting.new)
    assert_equal 'mine', File.read(precious)
    record = File.join(@checkpoint, 'mesh')
    File.rename(record, precious)
    File.symlink(precious, record)
    assert_includes refused, 'mesh is a link'
  end

  def test_a_better_oracle_goes_on
    raising = Spoilt.new { raise 'no such surface' }
    error = assert_raises(RuntimeError) { Stellate.mesh(raising, epsilon: 0.1, checkpoint: @checkpoint) }
    assert_equal 'no such surface', error.message
    mesh = Stellate.mesh(Live::TORUS, epsilon: 0.1, checkpoint: @checkpoint)
    assert_equal Live.expected.first, Live.counts(mesh)
    assert_raises(Stellate::InvalidArgument) do
      Stellate.mesh(Live::TORUS, epsilon: 0.1, checkpoint: @checkpoint, server: 'localhost:1')
    end
  end

  private

  def refused
    assert_raises(Stellate::InvalidArgument) { kept(Counting.new) }.message
  end

  def kept(oracle, **options)
    Stellate.mesh(oracle, epsilon: 0.05, checkpoint: @checkpoint, **options)
  end
end
