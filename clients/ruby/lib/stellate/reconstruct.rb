# frozen_string_literal: true

module Stellate
  class << self
    # Makes a mesh of points on a manifold, or near it: rows of d numbers. Point i is vertex i of the mesh, and
    # `mesh.places[i]` says what became of it.
    #   dimension: k of the manifold, 1 to 3, below d
    #   tangents: of each point orthonormal tangent vectors, the columns of d rows of k; else they are estimated
    #   noise: the standard deviation of each coordinate, a length, 0: exact; else as the points show
    #   reach: a promise: the manifold's reach is at least this length. Exact points may then be proved
    #   drop: the share of the points that may be left out, 0 to 0.5; closed: false for a manifold that may
    #     have a boundary: the mesh ends where the points do
    #   weights: 'only' for the weighted tangential Delaunay complex: stars are made to agree by weights of points
    #     alone, or the mesh is refused; else 'auto'
    #   steiner: true: points may be added where nothing else makes stars agree, vertices after the points
    #   server, credentials, on_progress, require_certified, save: as for `mesh`; label, worker_wait_seconds,
    #     answer_seconds: see mesh.proto
    # Ctrl-C cancels the mesh, and is Cancelled.
    def reconstruct(points, dimension:, tangents: nil, server: nil, credentials: nil, on_progress: nil,
                    require_certified: false, save: nil, **options)
      cloud = Cloud.new(points, dimension, tangents, options)
      Mesh.check_save(save, dimension, cloud.ambient_dimension) if save
      mesh = connect(server, credentials) { |client| Upload.new(client, cloud).run(on_progress) }
      mesh.save(save) if save
      insist_on_certified(mesh) if require_certified
      mesh
    end
  end

  # Points on their way to a server, and their mesh, which is watched meanwhile and deleted in the end.
  class Upload
    def initialize(client, cloud)
      @client, @cloud = client, cloud
      @watching = Outage.new(client.patience)
      @sending = Outage.new(client.patience, quiet: true) # the watch tells
      @calls, @failure = {}, nil
    end

    # The mesh.
    def run(on_progress)
      @name = declare
      sender = Thread.new { send_all }
      watch(on_progress)
      Stellate.download(@name, server: @client)
    rescue Interrupt
      raise Cancelled.new('the reconstruction is cancelled', reason: 'CANCELLED')
    ensure
      leave(@sending, :upload)
      sender&.join
      delete if @name
    end

    private

    # Once: whether the mesh was made would not be known.
    def declare
      mesh = sent([V1::PointsChunk.new(spec: @cloud.spec)]).mesh
      @client.patience.reached = true
      mesh.name
    rescue GRPC::BadStatus => e
      raise Stellate.from_rpc(e)
    end

    # One call of Reconstruct: these messages, the server's reply.
    def sent(chunks)
      call = @client.stub.reconstruct(chunks, metadata: @client.metadata, return_op: true)
      note(call, @sending, :upload)
      call.execute
    end

    def note(call, outage, what)
      @calls[what] = call
      call.cancel if outage.stopped?
    end

    def leave(outage, what)
      outage.stop
      @calls[what]&.cancel
    end

    # After a break it goes on from what the server has recorded.
    def send_all
      most = @client.info.max_message_bytes
      loop do
        rows = sent([V1::PointsChunk.new(mesh: @name)]).rows
        sent(@cloud.chunks(@name, rows, most))
        break @sending.heard
      rescue GRPC::BadStatus => e
        @sending.wait(e)
      end
    rescue FailedPrecondition
      nil # the mesh is over, and the watch says how it ended
    rescue StellateError => e
      @failure = e
      leave(@watching, :watch)
    end

    # Returns once the mesh is over.
    def watch(on_progress)
      request = V1::WatchMeshRequest.new(name: @name, progress_only: true)
      running = ->(call) { note(call, @watching, :watch) }
      @client.stream(:watch_mesh, request, outage: @watching, running:) do |event|
        on_progress&.call(event.progress) if event.progress
        :last if event.final
      end
    rescue StellateError
      # How the mesh ended says more than why its upload was refused then.
      raise if @failure.nil?
      raise @failure unless @client.get(@name).end_time
    end

    def delete
      @client.delete(@name, once: true)
    rescue StellateError
      nil # it ends with its server, or somebody else was first
    end
  end
end
