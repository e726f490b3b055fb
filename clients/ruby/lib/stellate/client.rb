# frozen_string_literal: true

require 'securerandom'

module Stellate
  # TLS, and a token, for a server that wants them. Files are PEM; all may be left out.
  #   token: sent with every call; over plain text only within this machine
  #   ca: the authority that signed the server's certificate; certificate, key: the client's own
  #   tls: TLS with the system's authorities; implied by ca and certificate
  Credentials = Struct.new(:token, :ca, :certificate, :key, :tls, keyword_init: true) do
    def channel(address)
      raise Stellate.invalid('a client certificate and its key go together: give both') if
        certificate.nil? != key.nil?

      if tls || ca || certificate
        read = ->(path) { path && File.read(path) }
        return GRPC::Core::ChannelCredentials.new(read.call(ca), read.call(key), read.call(certificate))
      end
      return :this_channel_is_insecure if token.nil? || Credentials.stays_on_this_machine?(address)

      raise Stellate.invalid("the token would go to #{address} in plain text, for others to read: turn TLS on")
    end

    def metadata
      token ? { 'authorization' => "Bearer #{token}" } : {}
    end

    def self.stays_on_this_machine?(address)
      address.match?(/\A(unix:|localhost:|\[::1\]:|127(\.\d+){3}:)/)
    end

    def inspect
      "#<Credentials ca=#{ca.inspect} certificate=#{certificate.inspect} tls=#{tls.inspect}>"
    end
    alias_method :to_s, :inspect
  end

  def self.invalid(message)
    InvalidArgument.new(message, reason: 'INVALID_ARGUMENT')
  end

  # A connection to a server; any thread may use it. The service, call by call.
  class Client
    NO_PINGS = 2_000_000_000 # milliseconds

    attr_reader :address, :patience, :stub, :metadata

    # `server`: "host:port", "unix:/path" or a Server. `reconnect_seconds`: how long one that was there and
    # went away is waited for; `keepalive_seconds`: how long a silent one is trusted before it is pinged;
    # `on_outage` is called when it is lost and when it is back.
    def initialize(server, credentials: Credentials.new, reconnect_seconds: RECONNECT[:give_up],
                   keepalive_seconds: RECONNECT[:keepalive], on_outage: ->(said) { warn("stellate: #{said}") })
      own = server.is_a?(Server) ? server : nil
      @address = own ? own.address : server.to_s
      raise Stellate.invalid("server has to be host:port or unix:/path: #{@address}") unless
        @address.match?(%r{\Aunix:|\A[^/]*:[0-9]+\z})

      @metadata = credentials.metadata
      @stub = V1::Stellate::Stub.new(@address, credentials.channel(@address),
                                     channel_args: channel_args(own&.private? ? nil : keepalive_seconds))
      @patience = Patience.new(reconnect_seconds, method(:connect), -> { own&.why_gone }, on_outage, false)
    end

    # Declares a mesh, which waits to be served; options as for Stellate.mesh. Repeated when the server is
    # lost: an id of its own lets the server know the mesh again.
    def create(oracle, epsilon:, **options)
      create_from(spec(oracle, epsilon, options))
    end

    # What `create` asks for: a V1::MeshSpec.
    def spec(oracle, epsilon, options)
      options[:speculative] = true unless options.key?(:speculative) || Credentials.stays_on_this_machine?(address)
      Spec.from(CheckedOracle.new(oracle), epsilon, options)
    end

    # As `create`, in the protocol's own message.
    def create_from(spec)
      call(:create_mesh, V1::CreateMeshRequest.new(spec:, mesh_id: SecureRandom.hex(16)))
    end

    # A mesh as it stands, without its geometry.
    def get(name)
      call(:get_mesh, V1::GetMeshRequest.new(name:))
    end

    # All meshes, oldest first, fetched page by page.
    def list(page_size: 0, &block)
      return enum_for(:list, page_size:) unless block_given?

      request = V1::ListMeshesRequest.new(page_size:)
      loop do
        page = call(:list_meshes, request)
        page.meshes.each(&block)
        break if page.next_page_token.empty?

        request.page_token = page.next_page_token
      end
    end

    # Ends a mesh; what there is of it stays readable. With `once` a lost server is an error.
    def cancel(name, once: false)
      call(:cancel_mesh, V1::CancelMeshRequest.new(name:), once:)
    end

    # Cancels a mesh if it runs, and forgets it.
    def delete(name, once: false)
      outage = Outage.new(patience)
      call(:delete_mesh, V1::DeleteMeshRequest.new(name:), once:, outage:)
    rescue StellateError => e
      # Else an attempt whose answer was lost has done it.
      raise unless e.reason == 'MESH_NOT_FOUND' && outage.lasts?
    end

    # What the server is and allows.
    def info
      call(:get_server_info, V1::GetServerInfoRequest.new)
    end

    # Has this server examine an oracle: see Stellate.check.
    def check(oracle, epsilon: 0)
      request = V1::ExamineRequest.new(spec: spec(oracle, epsilon, {}))
      examination = stub.examine(request, metadata:, return_op: true)
      failure = report = nil
      examination.execute.each do |event|
        failure = why_left(oracle, event.mesh.name) if event.mesh
        report = event.report || report
      end
      report or raise Stellate.protocol_error('it ended an examination without a report')
    rescue GRPC::BadStatus => e
      raise failure || Stellate.from_rpc(e) # there was no examination
    ensure
      examination&.cancel
    end

    # Serves a mesh with this oracle until it is over; the state that it ended in, e.g. "SUCCEEDED".
    def serve(oracle, name, worker: '', max_chunk: nil)
      Worker.new(self, CheckedOracle.new(oracle), name, Outage.new(patience), worker:, max_chunk:).run
    end

    # Yields a stream's messages, opening it again where it breaks off, until the block says :last.
    # `running` is given each call, to be cancelled from elsewhere.
    def stream(method, request, outage: Outage.new(patience), on_resume: -> {}, running: ->(call) {})
      loop do
        call = stub.public_send(method, request, metadata:, return_op: true)
        running.call(call)
        call.execute.each do |message|
          outage.heard
          return call.cancel if yield(message) == :last
        end
        raise Stellate.protocol_error('it ended a stream too early')
      rescue GRPC::BadStatus => e
        outage.wait(e)
        on_resume.call
      rescue GRPC::Core::CallError
        # gRPC's own, where another thread cancelled the call while it was read.
        raise unless outage.stopped?

        raise Stellate.from_rpc(GRPC::Cancelled.new('cancelled by this client'))
      end
    end

    private

    # Answers until the examination is over; what ended that early, which the server knows of.
    def why_left(oracle, name)
      serve(oracle, name, worker: 'check')
      nil
    rescue Interrupt
      raise
    rescue Exception => e # rubocop:disable Lint/RescueException
      e
    end

    def channel_args(keepalive_seconds)
      ping = keepalive_seconds ? (1000 * keepalive_seconds).to_i : NO_PINGS
      lost = (RECONNECT[:ping_patience] * ping).to_i
      { 'grpc.max_receive_message_length' => 64 << 20, 'grpc.max_send_message_length' => 64 << 20,
        'grpc.keepalive_time_ms' => ping, 'grpc.keepalive_timeout_ms' => [lost, NO_PINGS].min,
        'grpc.http2.max_pings_without_data' => 0,
        # The pauses between attempts are ours; gRPC's own would be up to two minutes.
        'grpc.initial_reconnect_backoff_ms' => (1000 * RECONNECT[:first_connection_pause]).to_i,
        'grpc.max_reconnect_backoff_ms' => (1000 * RECONNECT[:longest_connection_pause]).to_i,
        'grpc.service_config' => RETRIES, # a reply that was lost on the way
        # Proxies are for the outside.
        'grpc.enable_http_proxy' => Credentials.stays_on_this_machine?(address) ? 0 : 1 }
    end

    # Waits a moment for a connection; what is wrong the next attempt will tell.
    def connect
      stub.get_server_info(V1::GetServerInfoRequest.new, metadata:, deadline: Time.now + RECONNECT[:connect])
    rescue GRPC::BadStatus
      nil
    end

    def call(method, request, once: false, outage: Outage.new(patience))
      outage.stop if once
      loop do
        reply = stub.public_send(method, request, metadata:, deadline: Time.now + RECONNECT[:call])
        outage.heard
        return reply
      rescue GRPC::BadStatus => e
        outage.wait(e)
      end
    end
  end

  # From an oracle and options to the protocol's MeshSpec. Ranges are the server's to check.
  module Spec
    CRITERIA = V1::Criteria.descriptor.map { |field| field.name.to_sym }.freeze
    LIMITS = V1::MeshLimits.descriptor.map { |field| field.name.to_sym }.freeze
    OTHERS = { random_seed: :random_seed, label: :label, box_seeds: :box_seeds, components: :components,
               cover_box: :cover_box, reach: :declared_reach }.freeze
    AUDITS = { 'standard' => :AUDIT_STANDARD, 'thorough' => :AUDIT_THOROUGH }.freeze

    module_function

    def from(checked, epsilon, options)
      d = checked.d
      spec = V1::MeshSpec.new(dimension: checked.k, ambient_dimension: d, epsilon: epsilon.to_f,
                              oracle: checked.capabilities, walls: checked.walls,
                              criteria: V1::Criteria.new, limits: V1::MeshLimits.new)
      box, seeds = checked.whereabouts.values_at(:bounding_box, :seeds)
      if box
        lower, upper = box.map { |corner| Wire.to_wire(corner, corner.size) }
        spec.bounding_box = V1::BoundingBox.new(lower:, upper:)
      end
      options.compact.each { |name, value| set(spec, name, value) }
      seeds = options[:seeds] || seeds
      spec.seeds = Wire.to_wire(seeds.flatten, seeds.size, d) if seeds
      spec
    end

    def set(spec, name, value)
      if CRITERIA.include?(name) then spec.criteria[name.to_s] = value
      elsif LIMITS.include?(name) then spec.limits[name.to_s] = value
      elsif OTHERS.key?(name) then spec[OTHERS[name].to_s] = value
      elsif name == :audit then spec.audit = AUDITS.fetch(value.to_s)
      elsif name != :seeds
        raise Stellate.invalid("no option #{name}; known: #{(CRITERIA + LIMITS + OTHERS.keys).sort.join(', ')}")
      end
    rescue TypeError, RangeError, KeyError => e
      raise Stellate.invalid("#{name} cannot be #{value.inspect}: #{e.message}")
    end
  end
end
