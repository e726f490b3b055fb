# frozen_string_literal: true

# Meshes: from an oracle, as they grow, or as they are on a server.
module Stellate
  FAREWELL_SECONDS = 2 # that a worker may take to end when no call waits for it

  class << self
    # Meshes the oracle's manifold. `epsilon` is the largest circumradius of a simplex, a length, or 'auto':
    # what `choose_epsilon` says, and, where the mesh came out too coarse to certify, a quarter of the reach
    # that its certificate shows, twice at most.
    #   on_epsilon: a proc of each epsilon that 'auto' takes, before it is meshed with, and why
    #   server: "host:port", a Server or Client; without it one is started, and stopped afterwards
    #   credentials: for a server that wants them; on_progress: a proc that is called in this thread
    #   workers: streams that call the oracle in parallel; max_chunk: most points in one call
    #   checkpoint: a directory, made if it is not there, in which the mesh outlives this program: the same
    #     call goes on from where the last one was interrupted or killed, or its oracle raised, and gives a
    #     mesh that is finished immediately. For a private server; one that is named keeps meshes itself
    #   require_certified: a mesh that is not proved good is NotCertified; save: a file to write
    #   and size_rate, max_deviation, max_vertices, random_seed, label, reach...: see mesh.proto
    # Ctrl-C cancels the mesh, or leaves it to the checkpoint, and is Cancelled with the mesh so far.
    def mesh(oracle, epsilon:, require_certified: false, save: nil, **options)
      Mesh.check_save(save, oracle.dimension, oracle.ambient_dimension) if save
      finished = nil
      run(oracle, epsilon, false, options) { |mesh| finished = mesh }
      finished.save(save) if save
      insist_on_certified(finished) if require_certified
      finished
    end

    # Yields the mesh as it grows, at every revision; the last one has its report. Where epsilon 'auto' was
    # too coarse a finer mesh begins after that, from nothing. Leaving the block with `break` cancels
    # the mesh. With a name in place of an oracle a mesh of others is watched.
    def watch(what, epsilon: nil, **options, &each)
      return run(what, epsilon, true, options, &each) unless what.is_a?(String)

      connect(options.delete(:server), options.delete(:credentials)) do |client|
        follow(client, client.get(what), options[:on_progress], true, &each)
      end
    end

    # One more worker for a mesh, until it is over; the state that it ended in.
    def serve(oracle, name, server:, credentials: nil, **options)
      connect(server, credentials) { |client| client.serve(oracle, name, **options) }
    end

    # Fetches a mesh that is on a server: one that is over, or, with a revision, as it was then.
    def download(name, server:, credentials: nil, revision: 0)
      connect(server, credentials) do |client|
        info = client.get(name)
        unless info.end_time || revision.positive?
          raise FailedPrecondition.new("#{name} is not over: #{info.state}", reason: 'FAILED_PRECONDITION')
        end

        mesh = assemble(client, info, revision)
        revision.positive? ? mesh : judged(mesh, info)
      end
    end

    private

    def insist_on_certified(mesh)
      return if mesh.certified?

      verdict = mesh.report.certificate&.verdict
      raise NotCertified.new("the mesh is not certified: #{verdict}", reason: 'NOT_CERTIFIED', mesh:)
    end

    def connect(server, credentials)
      return yield(server) if server.is_a?(Client)
      return Server.start { |own| yield(Client.new(own)) } if server.nil?

      yield Client.new(server, credentials: credentials || Credentials.new)
    end

    def growth_of(info)
      k = info.spec.dimension - (info.spec.boundary_only ? 1 : 0) # the boundary alone
      Growth.new(k, info.spec.ambient_dimension)
    end

    def assemble(client, info, revision)
      growth = growth_of(info)
      request = V1::DownloadMeshRequest.new(name: info.name, revision:)
      client.stream(:download_mesh, request) do |part|
        request.revision, request.position = part.revision, part.next_position
        growth.add_points(part.first_vertex, part.points)
        growth.add_walls(part.boundary_vertices, part.boundary_walls)
        growth.add_cells(part.cells, part.orientation)
        growth.add_places(part.places) if part.places
        :last if part.complete
      end
      more = revision.zero? ? { progress: info.progress, report: info.report } : {}
      growth.downloaded(request.revision, **more)
    end

    # Yields a mesh at every revision and at its end. Raises how it failed.
    def follow(client, info, on_progress, every, **stream)
      growth, progress = growth_of(info), nil
      request = V1::WatchMeshRequest.new(name: info.name)
      on_resume = -> { growth.forget_pending }
      client.stream(:watch_mesh, request, on_resume:, **stream) do |event|
        case event.event
        when :delta
          complete = growth.absorb(event.delta)
          request.from_revision = growth.revision
          yield growth.mesh(progress:) if complete && every
        when :reset_mesh
          growth.reset
          request.from_revision = 0
        when :orientation
          growth.orient(event.orientation)
        when :progress
          progress = event.progress
          on_progress&.call(progress)
          growth.arrays if progress.phase == :PHASE_CERTIFYING # while the server is busy
        when :final
          final = event.final
          on_progress&.call(final.progress) if final.progress
          yield judged(growth.finished(progress: final.progress, report: final.report), final)
          next :last
        end
      end
    rescue StellateError => e
      e.mesh ||= growth&.mesh
      raise
    end

    def judged(mesh, info)
      mesh.epsilon, mesh.epsilon_reason = info.spec&.epsilon, '' unless info.spec&.reconstruction
      case info.state
      when :MESH_STATE_CANCELLED
        raise Cancelled.new('the mesh was cancelled', reason: 'CANCELLED', mesh:)
      when :MESH_STATE_FAILED
        failure = info.report&.failure || V1::Failure.new(reason: 'ORACLE_FAILED')
        raise error_class(failure.reason).new(failure.message, reason: failure.reason, mesh:)
      end
      mesh
    end

    def run(oracle, epsilon, every, options, &each)
      mine = %i[server credentials on_progress on_epsilon workers max_chunk checkpoint].to_h do |name|
        [name, options.delete(name)]
      end
      kept, last = mine[:checkpoint] && Checkpoint.new(mine[:checkpoint]), nil
      reached(kept, mine) do |client|
        choice = (kept&.choice if epsilon == 'auto') || Choice.of(oracle, epsilon)
        while choice
          mine[:on_epsilon]&.call(choice.epsilon, choice.reason) unless choice.reason.empty?
          spec = client.spec(oracle, choice.epsilon, options)
          info = kept ? kept.declare(client, spec, choice, again: !last.nil?) : client.create_from(spec)
          last = one_mesh(client, oracle, info, every, mine, choice.reason, &each)
          choice = choice.finer(last.report)
        end
      end
    rescue StellateError => e
      kept&.forget_after(e)
      e.mesh ||= last
      raise
    end

    # Yields a mesh as `follow` does, and returns it when it is over.
    def one_mesh(client, oracle, info, every, mine, reason)
      last = nil
      Session.new(client, CheckedOracle.new(oracle), info, mine).run do |stream|
        follow(client, info, mine[:on_progress], every, **stream) do |mesh|
          last = mesh
          mesh.epsilon_reason = reason if mesh.report
          yield mesh
        end
      end
      last
    end

    def reached(kept, mine, &)
      return connect(mine[:server], mine[:credentials], &) unless kept
      raise invalid('a checkpoint is for a private server: one that is named keeps meshes itself') if
        mine[:server] || mine[:credentials]

      kept.server { |own| connect(Client.new(own), nil, &) }
    end
  end

  # A mesh that is served and watched side by side, and deleted in the end, or left to its checkpoint.
  class Session
    def initialize(client, oracle, info, options)
      @client, @info, @failure, @checkpoint = client, info, nil, options[:checkpoint]
      @watching = Outage.new(client.patience)
      @workers = Array.new(options[:workers] || 1) do |i|
        outage = Outage.new(client.patience, quiet: true)
        max_chunk = options[:max_chunk]
        worker = Worker.new(client, oracle, info.name, outage, worker: "ruby-#{i + 1}", max_chunk:)
        worker.on_failure = ->(error) { note(error) }
        worker
      end
    end

    def run
      threads = @workers.map { |worker| Thread.new { serve(worker) } }
      over = false
      result = yield({ outage: @watching, running: method(:watch) })
      over = true
      result
    rescue Interrupt
      raise interrupted
    rescue StellateError => e
      raise e if @failure.nil? || (e.is_a?(Cancelled) && @checkpoint.nil?)

      @failure.mesh = e.mesh if @failure.is_a?(StellateError)
      raise @failure # our own says more than the server's account of it
    ensure
      leave(threads, over)
    end

    private

    # Whether the server is to hear of it; a mesh with a checkpoint waits for a better oracle.
    def note(error)
      @failure ||= error
      return true unless @checkpoint

      @watching.stop
      @watch&.cancel
      false
    end

    def watch(call)
      @watch = call
      call.cancel if @watching.stopped?
    end

    def serve(worker)
      worker.run
    rescue Exception # rubocop:disable Lint/RescueException
      nil # noted; what the server refuses, or its absence, the watch reports
    end

    # Ctrl-C: the mesh is cancelled, unless it is kept, and fetched as far as it came.
    def interrupted
      @client.cancel(@info.name, once: true) unless @checkpoint
      revision = @client.get(@info.name).revision
      mesh = revision.positive? ? Stellate.download(@info.name, server: @client, revision:) : nil
      what = @checkpoint ? "kept in #{@checkpoint}: the same call goes on from there" : 'cancelled'
      Cancelled.new("the mesh is #{what}; what there was of it is the mesh of this error", reason: 'CANCELLED',
                                                                                           mesh:)
    end

    def leave(threads, over)
      threads&.each { |thread| thread.join(FAREWELL_SECONDS) } if over
      @workers.each(&:stop)
      @client.delete(@info.name, once: true) unless @checkpoint
    rescue StellateError
      nil # it ends with its server, or somebody else was first
    end
  end
end
