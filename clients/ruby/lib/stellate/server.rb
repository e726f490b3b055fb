# frozen_string_literal: true

require 'fileutils'
require 'tmpdir'

module Stellate
  # The server binary: $STELLATED, else build/ of the source tree, else PATH.
  def self.find_stellated
    named = ENV.fetch('STELLATED', '')
    on_path = ->(name) { ENV.fetch('PATH', '').split(':').map { |folder| File.join(folder, name) } }
    built = Dir[File.join(__dir__, '../../../../build/*/bin/stellated')]
    candidates = built.sort_by { |path| path.include?('/release/') ? 0 : 1 } + on_path.call('stellated')
    candidates = [named, *on_path.call(named)] unless named.empty?
    candidates.find { |path| File.file?(path) && File.executable?(path) } or
      raise ServerNotFound.new(
        "no server was given and no stellated found to start: pass server: 'host:port', or set $STELLATED to " \
        'the binary, or put it on PATH, or build it (clients/quickstart does)', reason: 'SERVER_NOT_FOUND'
      )
  end

  # A stellated of this process's own, which ends with it whatever happens.
  class Server
    SAID = /\Astellated listening on /
    STOP_SECONDS = 10
    # When its client goes no client is left to finish a mesh for. One that answers no pings is merely
    # busy in an oracle.
    OWN_FLAGS = %w[--drain-seconds 0].freeze
    PRIVATE_FLAGS = %w[--keepalive 600 --keepalive-timeout 600].freeze

    # Where clients reach it, "unix:/path" or "host:port".
    attr_reader :address

    # Starts it, and returns when it listens: on a unix socket that only this user may enter, or at
    # `listen`. `flags` are more of stellated's. With a block it is closed afterwards. (The block has a
    # name since Ruby 3.1 forwards none without where there are keywords.)
    def self.start(*flags, listen: nil, binary: Stellate.find_stellated, &block)
      own = OWN_FLAGS + (listen ? [] : PRIVATE_FLAGS)
      closing(new(binary, listen, own + flags), &block)
    end

    # The server, or, with a block, what that makes of it before it is closed.
    def self.closing(server)
      return server unless block_given?

      begin
        yield server
      ensure
        server.close
      end
    end

    def initialize(binary, listen, flags)
      @folder = Dir.mktmpdir('stellate-')
      @log = File.join(@folder, 'log')
      @private = listen.nil?
      address = listen || "unix:#{File.join(@folder, 'socket')}"
      command = [binary, '--exit-with-parent', '--listen', address, *flags]
      # A group of its own: Ctrl-C is for the client, which cancels its meshes first.
      said, write = IO.pipe
      @pid = Process.spawn(*command, in: :close, out: write, err: @log, pgroup: true)
      write.close
      line = said.gets.to_s
      return @address = line.sub(SAID, '').strip if line.match?(SAID)

      sleep 0.01 while alive?
      gone = why_gone
      close
      raise gone
    end

    def private?
      @private
    end

    def alive?
      @status.nil? && Process.wait2(@pid, Process::WNOHANG).then { |ended| @status = ended&.last }.nil?
    end

    # With the last words of a server that is no more; nil for one that runs.
    def why_gone
      return if alive?

      words = File.exist?(@log) ? File.read(@log)[-2000..] || File.read(@log) : ''
      Unavailable.new("stellated ended (#{@status}): #{words.strip}", reason: 'SERVER_GONE')
    end

    # Stops it and removes its directory. May be called again.
    def close
      if alive?
        Process.kill('TERM', @pid)
        finish = Time.now + STOP_SECONDS
        sleep 0.005 while alive? && Time.now < finish
        Process.kill('KILL', @pid) if alive?
        sleep 0.005 while alive?
      end
      FileUtils.rm_rf(@folder)
    end
  end
end
