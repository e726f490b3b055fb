# frozen_string_literal: true

require 'fileutils'

module Stellate
  # A directory in which one mesh outlives the processes that make it: clients/shared/checkpoint.toml.
  class Checkpoint
    attr_reader :folder

    def initialize(folder)
      @folder = folder.to_s.sub(%r{(?<=.)/+\z}, '') # "link/" would be followed
      @record = File.join(@folder, CHECKPOINT[:record])
    end

    # Starts the private server, once that of a killed process has come to its end.
    def server(&)
      FileUtils.mkdir_p(folder, mode: 0o700)
      insist_on_own
      if File.exist?(File.join(folder, CHECKPOINT[:python_record]))
        raise Stellate.invalid("#{folder} is a checkpoint of the Python client: take another directory")
      end

      Server.closing(start, &)
    end

    # The epsilon that was chosen for the mesh that is there; nil: none was.
    def choice
      _, retries, reason, there = read
      Choice.new(there.epsilon, reason, Integer(retries)) if reason && there
    end

    # The mesh that is there, or a new one; with `again` a new one in its place.
    def declare(client, spec, choice, again:)
      essence = spec.dup
      essence.label = ''
      name, _, _, there = read
      if name && !again && there != essence
        raise Stellate.invalid("the checkpoint #{folder} is of a mesh of another specification: " \
                               'take another directory, or remove it')
      end

      others, found = client.list.partition { |info| info.name != name }
      others.each { |info| client.delete(info.name) } # were forgotten, or never put down
      return found.first unless again || found.empty?

      made = client.create_from(spec)
      chosen = choice.reason.empty? ? [] : [choice.retries, choice.reason]
      note("#{[made.name, *chosen].join(' ')}\n".b + V1::MeshSpec.encode(essence))
      found.each { |info| client.delete(info.name) }
      made
    end

    # Has the next call begin from the start where this mesh has failed for good.
    def forget_after(error)
      return unless error.is_a?(StellateError) && error.mesh&.report
      return if error.reason.start_with?('JOURNAL_') # with more room it goes on

      FileUtils.rm_f(@record)
    end

    private

    def start
      deadline = Time.now + CHECKPOINT[:last_server_seconds]
      begin
        Server.start('--data-dir', File.join(folder, CHECKPOINT[:server]),
                     '--keep-finished-seconds', CHECKPOINT[:keep_finished_seconds].to_s)
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

    # Refuses a folder in which others could have put what we would believe.
    def insist_on_own
      found = File.lstat(folder)
      wrong = if found.symlink? then 'is a link: name the directory that it leads to'
              elsif !found.owned? then 'belongs to another user: take another directory'
              elsif found.mode.anybits?(0o022)
                format('may be written by others (mode %04o): take another directory, or, if all in it is yours, ' \
                       'chmod go-w', found.mode & 0o7777)
              end
      raise Stellate.invalid("the checkpoint #{folder} #{wrong}") if wrong
    end

    # The name, retries and reason of a choice, and what is meshed; nil for what was not put down.
    def read
      first, there = read_own&.split("\n", 2)
      return [] if first.nil?

      [*first.force_encoding('UTF-8').split(' ', 3), nil, nil].first(3) << spec_of(there)
    end

    # nil for what is none.
    def spec_of(bytes)
      bytes && V1::MeshSpec.decode(bytes)
    rescue Google::Protobuf::ParseError
      nil
    end

    # The record, if it is a file of this user's and no link; nil if there is none.
    def read_own
      # NONBLOCK: a pipe without another end would wait for it.
      File.open(@record, File::RDONLY | File::NOFOLLOW | File::NONBLOCK) do |file|
        return file.binmode.read if file.stat.file? && file.stat.owned?
      end
      raise Stellate.invalid("#{@record} is no file of this user's: take another directory")
    rescue Errno::ENOENT
      nil
    rescue Errno::ELOOP
      raise Stellate.invalid("#{@record} is a link, which no checkpoint has: remove it")
    end

    # All of it or nothing.
    def note(record)
      draft = File.join(folder, CHECKPOINT[:draft])
      FileUtils.rm_f(draft) # of a process that was killed; a link itself, not where it leads
      File.open(draft, File::WRONLY | File::CREAT | File::EXCL | File::BINARY, 0o600) { |file| file.write(record) }
      File.rename(draft, @record)
    end
  end
end
