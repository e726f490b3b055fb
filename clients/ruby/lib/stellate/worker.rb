# frozen_string_literal: true

require 'English'

module Stellate
  # A worker: a ServeOracle stream, on which the server asks and an oracle answers.
  class Worker
    ANSWER_BYTES = 3_000_000 # an answer has to stay below the server's 4 MB
    MESSAGE_BYTES = 4000
    BUSY_SHARE = 0.25 # of the time that the server bears silence

    # Gets what the oracle raised; returns whether the server gets it as well.
    attr_writer :on_failure

    def initialize(client, oracle, mesh, outage, worker: '', max_chunk: nil)
      numbers = (oracle.d * (oracle.k + 1 + [oracle.k, oracle.walls].min)) + oracle.walls
      most = [ANSWER_BYTES / ((8 * numbers) + 9), 1].max
      unless max_chunk.nil? || (max_chunk.is_a?(Integer) && max_chunk.positive?)
        raise Stellate.invalid("max_chunk has to be a whole number from 1 on, and is #{max_chunk.inspect}")
      end

      @client, @oracle, @outage, @stopped = client, oracle, outage, false
      @hello = V1::Hello.new(mesh:, worker:, max_chunk_queries: [most, max_chunk || most].min)
      @on_failure = ->(_error) { true }
    end

    # The state that the mesh ended in, "" when stopped before. Raises what the oracle raises.
    def run
      loop do
        return serve
      rescue GRPC::BadStatus => e
        return '' if @stopped

        state = Stellate.from_rpc(e).is_a?(FailedPrecondition) ? how_it_ended : ''
        return state unless state.empty? # before this worker came, or while it was away

        @outage.wait(e)
      end
    end

    # Ends the stream: what is unanswered goes to another worker.
    def stop
      @stopped = true
      @outage.stop
      @call&.cancel
    end

    private

    def how_it_ended
      300.times do
        mesh = @client.get(@hello.mesh)
        return Wire.name(mesh.state, 'MESH_STATE_') if mesh.end_time

        sleep 0.1 # it is just about to end
      end
      ''
    end

    def say(**message)
      @outbox << V1::ServeOracleRequest.new(**message)
    end

    # The outbox closed ends our half: grpc waits for that before it reports the end of the stream.
    def serve
      outbox = @outbox = Queue.new
      requests = Enumerator.new do |sent|
        while (request = outbox.pop)
          sent << request
        end
      end
      say(hello: @hello)
      @call = @client.stub.serve_oracle(requests, metadata: @client.metadata, return_op: true)
      inbox = read_ahead(@call)
      @call.cancel if @stopped
      answer_all(inbox)
    ensure
      @teller&.kill
      @teller = nil
      outbox.close
      @call.cancel if $ERROR_INFO
    end

    # The next chunk is on its way while one is answered.
    def read_ahead(call)
      inbox = Queue.new
      responses = call.execute
      Thread.new do
        responses.each { |response| inbox << response }
        inbox << nil
      rescue GRPC::BadStatus => e
        inbox << e
      end
      inbox
    end

    def answer_all(inbox)
      state = ''
      while (response = inbox.pop)
        raise response if response.is_a?(GRPC::BadStatus)

        @outage.heard
        case response.message
        when :queries then answer(response.queries, inbox)
        when :welcome then welcome(response.welcome)
        when :over
          state = response.over.state.delete_prefix('MESH_STATE_')
          @outbox.close
        end
      end
      state
    end

    def answer(chunk, inbox)
      @lease = chunk.lease
      answers = @oracle.answer(chunk)
      @lease = nil
      say(answers:)
    rescue Exception => e # rubocop:disable Lint/RescueException
      @lease = nil
      raise if e.is_a?(Interrupt) # no failure of the oracle: another worker may go on

      say_failure(chunk.lease, e) if @on_failure.call(e)
      @outbox.close # without a word as a worker that has to go
      nil while inbox.pop.is_a?(V1::ServeOracleResponse) # until the server has taken note
      raise
    end

    def say_failure(lease, error)
      said = "#{error.class}: #{error.message}".encode('UTF-8', invalid: :replace, undef: :replace)
      say(failure: V1::OracleFailure.new(lease:, message: said.byteslice(0, MESSAGE_BYTES).scrub('')))
    end

    def welcome(said)
      compare(said)
      return if @teller || !said.answer_seconds.positive?

      @teller = Thread.new do
        loop do
          sleep(BUSY_SHARE * said.answer_seconds)
          lease = @lease
          say(busy: V1::Busy.new(lease:)) if lease
        end
      rescue ClosedQueueError
        nil
      end
    end

    # Leaves the mesh alone if this oracle is not of its kind.
    def compare(said)
      able = @oracle.capabilities
      missing = %w[intersect_flat tangent_basis local_size].select { |name| said.oracle[name] && !able[name] }
      wanted, have = [said.dimension, said.ambient_dimension], [@oracle.k, @oracle.d]
      problem =
        if wanted != have
          format("the mesh has dimension %d in R^%d, and this oracle's manifold has dimension %d in R^%d",
                 *wanted, *have)
        elsif said.walls != @oracle.walls
          "the mesh has #{said.walls} walls, and this oracle's manifold has #{@oracle.walls}"
        elsif missing.any?
          "the mesh was declared with #{missing.join(' and ')}, which this oracle lacks"
        end
      raise Stellate.invalid("#{problem}: all workers of a mesh have to serve one manifold") if problem
    end
  end
end
