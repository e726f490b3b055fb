# frozen_string_literal: true

require_relative 'live'

# The epsilon 'auto', and what it goes on with.
class EpsilonTest < Minitest::Test
  # The unit circle, and a small one beside it that few questions of the doctor fall upon.
  class TwoCircles
    attr_reader :asked

    def dimension = 1
    def ambient_dimension = 2
    def bounding_box = [[-1.1, -1.1], [1.2, 1.1]]
    def seeds = [[-1.0, 0.0], [1.05, 0.01]]

    def closest_point(points)
      @asked = asked.to_i + points.size
      points.map do |x, y|
        away, beside = Math.sqrt((x * x) + (y * y)), Math.sqrt(((x - 1.05) * (x - 1.05)) + (y * y))
        from, scale = (away - 1).abs <= (beside - 0.01).abs ? [0, 1 / away] : [1.05, 0.01 / beside]
        [from + (scale * (x - from)), scale * y]
      end
    end
  end

  def test_a_mesh_is_followed_by_what_its_report_says_so_often
    report = Stellate::V1::Report.new(finer: { epsilon: 0.05, reason: 'so' })
    assert_equal [0.05, 'so', 1], Stellate::Choice.new(0.1, '', 2).finer(report).to_a
    assert_nil Stellate::Choice.new(0.1, '', 0).finer(report)
    assert_nil Stellate::Choice.new(0.1, '', 2).finer(Stellate::V1::Report.new)
  end

  def test_auto_goes_on_and_a_checkpoint_knows_of_it
    Dir.mktmpdir('stellate-test-') do |checkpoint|
      told, ends = [], []
      options = { epsilon: 'auto', checkpoint:, on_epsilon: ->(*choice) { told << choice } }
      on_progress = ->(_progress) { raise Interrupt if told.size == 2 }
      error = assert_raises(Stellate::Cancelled) do
        Stellate.watch(TwoCircles.new, on_progress:, **options) { |mesh| ends << mesh if mesh.report }
      end
      assert_includes error.message, 'the same call goes on from there'
      coarse = ends.first
      assert_equal [1, false, told[0]], [ends.size, coarse.certified?, [coarse.epsilon, coarse.epsilon_reason]]
      finer = coarse.report.finer
      assert_equal told[1], [finer.epsilon, finer.reason]
      see_it_finished(told, options)
    end
  end

  private

  def see_it_finished(told, options)
    second, third = TwoCircles.new, TwoCircles.new
    mesh = Stellate.mesh(second, **options)
    assert_equal told[1], told[2]
    assert mesh.certified?, mesh.report.certificate.verdict
    assert_equal 2, mesh.report.certificate.components
    assert_equal told.last, [mesh.epsilon, mesh.epsilon_reason]
    again = Stellate.mesh(third, **options)
    assert_nil third.asked
    assert_equal mesh.points, again.points
    straight = Stellate.mesh(third, epsilon: mesh.epsilon)
    assert_equal [mesh.points, ''], [straight.points, straight.epsilon_reason]
    assert_operator second.asked, :<=, third.asked # nobody examined it
  end
end
