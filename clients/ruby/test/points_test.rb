# frozen_string_literal: true

require_relative 'live'

# Reconstruction from points, against the real server.
class PointsTest < Minitest::Test
  def setup
    @server = Stellate::Server.start
  end

  def teardown
    @server.close
  end

  # n points of the unit sphere down to a height, evenly; -1: all of it.
  def sphere(n, lowest = -1)
    Array.new(n) do |i|
      z = 1 - ((1 - lowest) * (i + 0.5) / n)
      turn, around = i * Math::PI * (3 - Math.sqrt(5)), Math.sqrt(1 - (z * z))
      [around * Math.cos(turn), around * Math.sin(turn), z]
    end
  end

  def reconstructed(points, **options)
    Stellate.reconstruct(points, dimension: 2, server: @server, **options)
  end

  def test_a_sphere
    points, phases = sphere(600), []
    mesh = reconstructed(points, noise: 0, require_certified: true, on_progress: ->(now) { phases |= [now.phase] })
    assert_equal points, mesh.points
    assert_equal (2 * 600) - 4, mesh.simplices.size
    assert_equal 2, mesh.report.certificate.euler_characteristic
    assert_equal mesh.simplices.size, mesh.oriented_simplices.size
    assert_equal ['OK'] * 600, mesh.places
    assert_nil mesh.smoothed
    refute_empty phases
    assert_equal mesh.simplices, Stellate.reconstruct(points, dimension: 2, noise: 0).simplices # on its own server
    assert_empty Stellate::Client.new(@server).list.to_a
  end

  def test_weights_alone
    mesh = reconstructed(sphere(600), noise: 0, weights: 'only', steiner: true, require_certified: true)
    assert_equal (2 * 600) - 4, mesh.simplices.size
    error = assert_raises(Stellate::InvalidArgument) { reconstructed(sphere(600), weights: 'heavy') }
    assert_includes error.message, "weights has to be 'auto' or 'only'"
    assert_raises(Stellate::InvalidArgument) { reconstructed(sphere(600), steiner: 'often') }
  end

  def test_tangent_spaces_and_a_reach_are_a_proof
    points = sphere(2500)
    tangents = points.map do |x, y, z|
      around = Math.hypot(x, y)
      [[-y / around, -z * x / around], [x / around, -z * y / around], [0, around]]
    end
    mesh = reconstructed(points, tangents:, noise: 0, reach: 1)
    assert_equal :CERTIFICATE_LEVEL_PROVED, mesh.report.certificate.level, mesh.report.certificate.verdict
  end

  def test_where_the_sample_ends_and_noise
    cap = sphere(600, -0.2)
    mesh = reconstructed(cap, noise: 0)
    refute_predicate mesh, :certified?
    assert_includes mesh.places, 'EDGE'
    open = reconstructed(cap, noise: 0, closed: false)
    assert_equal 1, open.report.certificate.euler_characteristic
    refute_empty open.boundary
    error = assert_raises(Stellate::NotCertified) { reconstructed(cap, noise: 0, require_certified: true) }
    assert_equal cap, error.mesh.points
    shaken = sphere(900).each_with_index.map do |row, i|
      row.each_with_index.map { |x, j| x + (0.01 * Math.sin(12.9898 * ((3 * i) + j))) }
    end
    noisy = reconstructed(shaken)
    assert_equal shaken, noisy.points
    assert_equal [900, 3], [noisy.smoothed.size, noisy.smoothed.first.size]
    refute_equal shaken, noisy.smoothed
  end

  def test_what_cannot_be_taken
    points = sphere(50)
    { 'row 7 of points has 2 numbers' => [[*points[0, 7], [1, 0], *points[8..]], {}],
      'row 2 of points is' => [[*points[0, 2], [1, 0, Float::NAN], *points[3..]], {}],
      'row 0 of points is' => [[%w[1 0 0]] * 50, {}],
      'there are 1 tangents' => [points, { tangents: [[[1, 0], [0, 1], [0, 0]]] }],
      'no option epsilon' => [points, { epsilon: 0.1 }],
      'noise cannot be' => [points, { noise: 'much' }],
      'k must be less than d' => [points, { dimension: 3 }],
      'dimension has to be' => [points, { dimension: 1.5 }],
      'needs 4 at least' => [points[0, 3], {}] }.each do |words, (rows, more)|
      error = assert_raises(Stellate::InvalidArgument, words) { reconstructed(rows, **more) }
      assert_includes error.message, words
    end
  end

  def test_an_interrupt_cancels
    leaving = ->(_) { raise Interrupt }
    error = assert_raises(Stellate::Cancelled) { reconstructed(sphere(2000), on_progress: leaving) }
    assert_includes error.message, 'cancelled'
    assert_empty Stellate::Client.new(@server).list.to_a
  end

  def test_an_upload_goes_on_after_a_kill
    Live.restarting_server do |address, restart|
      client, points, killed = Stellate::Client.new(address, on_outage: ->(_) {}), sphere(20_000), false
      on_progress = lambda do |_|
        restart.call unless killed
        killed = true
      end
      mesh = Stellate.reconstruct(points, dimension: 2, noise: 0, server: client, on_progress:)
      assert_equal points, mesh.points
      assert_equal (2 * 20_000) - 4, mesh.simplices.size
      assert killed
    end
  end
end
