# frozen_string_literal: true

module Stellate
  # What the calls and streams of one client share. `hopeless` says why the server will not come back, if
  # that is known; `reached`: something was heard of it, so it was there.
  Patience = Struct.new(:give_up_seconds, :connect, :hopeless, :on_outage, :reached)

  # The attempts at one call or stream while the server may be away. A quiet one leaves it to others to
  # report it.
  class Outage
    def initialize(patience, quiet: false)
      @patience, @quiet = patience, quiet
      @attempts, @stopped = 0, Queue.new
    end

    # Whether the attempt under way follows on one that was broken off.
    def lasts?
      @attempts.positive?
    end

    def stopped?
      @stopped.closed?
    end

    # Ends the wait, and lets no other begin.
    def stop
      @stopped.close
    end

    # The attempt brought something: the server is there.
    def heard
      @patience.reached = true
      return unless lasts?

      tell("the server is back after #{gone.round(1)} s")
      @attempts = 0
    end

    # Returns when it is time for another attempt; else raises what the error comes to.
    def wait(error)
      ours = Stellate.from_rpc(error)
      raise lost_mesh(ours) if ours.is_a?(MeshNotFound) && lasts?
      raise ours unless transient?(error)

      hopeless = @patience.hopeless.call
      raise hopeless if hopeless

      @patience.reached = true if ours.reason == 'SHUTTING_DOWN' # said by a server
      raise ours if stopped? || !@patience.reached

      begin_waiting(ours) unless lasts?
      left = @patience.give_up_seconds - gone
      raise given_up(ours) if left <= 0

      full = [RECONNECT[:first_pause] * (RECONNECT[:pause_growth]**@attempts), RECONNECT[:longest_pause]].min
      @attempts += 1
      # Shortened at random: the clients of a server that comes back do not come all together.
      pause([full * (1 - (rand * RECONNECT[:pause_jitter])), left].min)
      raise ours if stopped?

      @patience.connect.call
    end

    private

    def begin_waiting(ours)
      @lost_at = now
      most = @patience.give_up_seconds
      tell("lost the server (#{ours.message}): trying again for up to #{most} s") if most.positive?
    end

    def pause(seconds)
      finish = now + seconds
      sleep([finish - now, 0.05].min) while now < finish && !stopped?
    end

    # What a server drops arrives as CANCELLED where this side cancelled nothing.
    def transient?(error)
      [GRPC::Core::StatusCodes::UNAVAILABLE, GRPC::Core::StatusCodes::CANCELLED].include?(error.code) ||
        (error.code == GRPC::Core::StatusCodes::UNKNOWN && error.details.to_s.include?('Stream removed'))
    end

    def lost_mesh(ours)
      Unavailable.new('the server went away and came back without the mesh; it keeps meshes only with --data-dir',
                      reason: ours.reason)
    end

    def given_up(ours)
      waited = lasts? ? "; waited #{gone.round(1)} s for it" : ''
      Unavailable.new(ours.message + waited, reason: ours.reason)
    end

    def gone
      now - @lost_at
    end

    def now
      Process.clock_gettime(Process::CLOCK_MONOTONIC)
    end

    def tell(said)
      @patience.on_outage.call(said) unless @quiet
    end
  end
end
