# frozen_string_literal: true

module Stellate
  # An on_progress that keeps one live line on a terminal, and else prints few plain lines.
  class ProgressBar
    def initialize(file = $stderr)
      @file, @live, @shown, @phase = file, file.tty?, 0, nil
    end

    def call(progress)
      now = Process.clock_gettime(Process::CLOCK_MONOTONIC)
      return if progress.phase == @phase && now - @shown < (@live ? 0.05 : 5)

      @shown, @phase = now, progress.phase
      line = format('%<phase>s %<share>3.0f%%  %<vertices>d vertices  %<simplices>d simplices  %<time>.1f s',
                    phase: Wire.name(@phase, 'PHASE_').downcase, share: 100 * progress.fraction,
                    vertices: progress.vertices, simplices: progress.simplices, time: progress.elapsed_seconds)
      line = "\r#{line}\e[K" if @live
      line += "\n" if !@live || @phase == :PHASE_DONE
      @file.write(line)
    end
  end
end
