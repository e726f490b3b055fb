# frozen_string_literal: true

require 'fileutils'

module Stellate
  # A directory in which one mesh outlives the processes that make it:
  #   mesh     the mesh's name on the private server, and, on the next line, what is meshed
  #   server/  that server's --data-dir
  class Checkpoint
    LAST_SERVER_SECONDS = 20 # that the server of a killed process may take to end

    attr_reader :folder

    def initialize(folder)
      @folder = folder.to_s
      @record = File.join(@folder, 'mesh')
    end

    # Starts the private server, once that of a killed process has come to its end.
    def server(&)
      if File.exist?(File.join(folder, 'mesh.json'))
        raise Stellate.invalid("#{folder} is a checkpoint of the Python client: take another directory")
      end

      FileUtils.mkdir_p(folder, mode: 0o700)
      Server.closing(start, &)
    end

    # The mesh that is there, or a new one.
    def declare(client, spec)
      essence = spec.dup
      essence.label = ''
      wanted = V1::MeshSpec.encode(essence)
      name, there = File.exist?(@record) ? File.binread(@record).split("\n", 2) : nil
      if name && there != wanted
        raise Stellate.invalid("the checkpoint #{folder} is of a mesh of another specification: " \
                               'take another directory, or remove it')
      end

      others, found = client.list.partition { |info| info.name != name }
      others.each { |info| client.delete(info.name) } # were forgotten, or never put down
      found.first || client.create_from(spec).tap { |info| note("#{info.name}\n".b + wanted) }
    end

    # Has the next call begin anew where this mesh has failed for good.
    def forget_after(error)
      return unless error.is_a?(StellateError) && error.mesh&.report
      return if error.reason.start_with?('JOURNAL_') # with more room it goes on

      FileUtils.rm_f(@record)
    end

    private

    def start
      deadline = Time.now + LAST_SERVER_SECONDS
      begin
        Server.start('--data-dir', File.join(folder, 'server'), '--keep-finished-seconds', '31536000')
      rescue Unavailable => e
        raise unless e.message.include?('another server uses')
        raise in_use if Time.now > deadline

        sleep 0.1
        retry
      end
    end

    def in_use
      FailedPrecondition.new("another process is meshing in the checkpoint #{folder}: wait for its end, or take " \
                             'another directory', reason: 'FAILED_PRECONDITION')
    end

    # All of it or nothing.
    def note(record)
      File.binwrite("#{@record}.new", record)
      File.rename("#{@record}.new", @record)
    end
  end
end
