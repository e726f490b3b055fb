# frozen_string_literal: true

require_relative 'live'

# The doctor.
class CheckTest < Minitest::Test
  def test_a_torus_and_its_epsilon
    report = Stellate.check(Live::TORUS, epsilon: 0.3)
    assert report.ok, report.text
    assert_in_delta 0.4, report.reach, 0.01
    assert_equal 1, report.pieces
    codes = report.findings.to_h { |finding| [finding.code, finding.severity] }
    assert_equal %i[SEVERITY_WARNING SEVERITY_NOTE], codes.values_at('COARSE_EPSILON', 'REACH')
    assert_includes report.text, 'keeps its contract'
    epsilon, reason = Stellate.choose_epsilon(Live::TORUS)
    assert_in_delta 0.1, epsilon, 0
    assert_match(/\Aa quarter of the reach, about 0\.4/, reason)
    assert_equal Live.expected.first, Live.counts(Stellate.mesh(Live::TORUS, epsilon: 'auto'))
  end

  def test_what_is_wrong
    moving = Spoilt.new { |points| points.map { |point| point&.map { |x| 1.01 * x } } }
    report = Stellate.check(moving)
    refute report.ok
    found = report.findings.find { |finding| finding.code == 'NOT_IDEMPOTENT' }
    assert_equal :SEVERITY_ERROR, found.severity
    assert_includes found.advice, 'Answer with points of M'
    error = assert_raises(Stellate::OracleError) { Stellate.choose_epsilon(moving) }
    assert_equal 'ORACLE_BREAKS_CONTRACT', error.reason
    assert_includes error.message, 'NOT_IDEMPOTENT'
    first = Stellate.check(Spoilt.new { raise 'no such surface' }).findings.first
    assert_equal 'RAISED', first.code
    assert_includes first.message, 'no such surface'
  end

  def test_a_server_that_is_named_is_asked_and_left_as_it_was
    Stellate::Server.start do |server|
      client = Stellate::Client.new(server)
      assert client.check(Live::TORUS).ok
      assert_empty client.list.to_a
      error = assert_raises(Stellate::InvalidArgument) { client.check(Live::TORUS, epsilon: -1) }
      assert_includes error.message, 'epsilon'
    end
  end
end
