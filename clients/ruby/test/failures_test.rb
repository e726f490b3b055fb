# frozen_string_literal: true

require_relative 'live'

# What goes wrong, against the real server.
class FailuresTest < Minitest::Test
  def meshed(oracle, server, **options)
    Stellate.mesh(oracle, epsilon: 0.1, server:, **options)
  end

  def test_refusals
    Stellate::Server.start do |server|
      error = assert_raises(Stellate::InvalidArgument) { Stellate.mesh(Live::TORUS, epsilon: -1, server:) }
      assert_equal 'INVALID_ARGUMENT', error.reason
      assert_match(/epsilon/, error.fields.to_s)
      assert_raises(Stellate::InvalidArgument) { meshed(Live::TORUS, server, size_rat: 1) }
      assert_raises(Stellate::InvalidArgument) { meshed(Live::TORUS, server, max_vertices: 'many') }
      client, nobody = Stellate::Client.new(server), "meshes/#{'0' * 32}"
      assert_raises(Stellate::MeshNotFound) { client.get(nobody) }
      assert_raises(Stellate::MeshNotFound) { client.serve(Live::TORUS, nobody) }

      # A worker of another manifold leaves the mesh alone.
      name = client.create(Live::TORUS, epsilon: 0.1).name
      assert_raises(Stellate::InvalidArgument) { client.serve(Stellate::ProductOfCircles.new, name) }
      assert_equal 'SUCCEEDED', client.serve(Live::TORUS, name)
    end
  end

  def test_oracles_that_fail
    mine = IndexError.new('no such surface')
    Stellate::Server.start do |server|
      assert_same(mine, assert_raises(IndexError) { meshed(Spoilt.new { raise mine }, server) })
      {
        'ORACLE_NOT_FINITE' => ->(points) { points.map { |point| point&.map { Float::NAN } } },
        'ORACLE_SHAPE' => ->(points) { points[1..] },
        'ORACLE_BAD_TANGENT' => ->(points) { points.map { |point| point&.map { |x| 1.1 * x } } }
      }.each do |reason, spoil|
        error = assert_raises(Stellate::OracleError) { meshed(Spoilt.new(&spoil), server) }
        assert_equal reason, error.reason
      end
    end
  end

  def test_a_server_that_comes_back_is_waited_for
    gone = Live.restarting_server do |address, restart|
      said, kills = [], 0
      oracle = Spoilt.new do |answer|
        restart.call if (kills += 1) == 1
        answer
      end
      client = Stellate::Client.new(address, on_outage: ->(line) { said << line })
      mesh = meshed(oracle, client)
      assert_equal Live.expected.first, Live.counts(mesh)
      assert_predicate mesh, :certified?
      assert(said.any? { |line| line.start_with?('lost the server') }, said.inspect)
      assert(said.any? { |line| line.start_with?('the server is back') }, said.inspect)
      address
    end
    assert_raises(Stellate::Unavailable) { meshed(Live::TORUS, gone) }
  end

  def test_tls_and_a_token
    pem, tokens, ca = %w[proxy.pem tokens ca.pem].map { |name| Live.secret(name) }
    token = File.read(Live.secret('me.token')).strip
    Live.restarting_server('--tls-cert', pem, '--tls-key', pem, '--token-file', tokens) do |address, _|
      ask = ->(**some) { meshed(Live::TORUS, address, credentials: Stellate::Credentials.new(**some)) }
      assert_predicate ask.call(ca:, token:), :certified?
      refused = assert_raises(Stellate::Unauthenticated) { ask.call(ca:) }
      assert_includes refused.message, 'give a token'
      assert_raises(Stellate::Unauthenticated) { ask.call(ca:, token: 'guessed') }
      assert_raises(Stellate::Unavailable) { ask.call(tls: true, token:) }
    end
    credentials = Stellate::Credentials.new(token: 'secret')
    assert_raises(Stellate::InvalidArgument) { Stellate::Client.new('mesh.example.org:7717', credentials:) }
  end
end
