# frozen_string_literal: true

module Stellate
  # An epsilon; if 'auto' chose it, why, and how many finer ones may follow.
  Choice = Struct.new(:epsilon, :reason, :retries) do
    # What an oracle is meshed with at first.
    def self.of(oracle, epsilon)
      return new(epsilon, '', 0) unless epsilon == 'auto'

      new(*Stellate.choose_epsilon(oracle), DOCTOR[:auto_retries])
    end

    # What follows a mesh of this choice that is over; nil: nothing that a smaller epsilon would mend.
    def finer(report)
      found = retries.positive? ? Choice.finer_epsilon(epsilon, report) : nil
      found && Choice.new(*found, retries - 1)
    end

    # A quarter of the reach that a certificate shows, and why, where its mesh is too coarse for it; else nil.
    def self.finer_epsilon(epsilon, report)
      proved = report&.certificate
      return if proved.nil? || proved.certified || proved.reach_refuted ||
                !%i[TERMINATION_CONVERGED TERMINATION_NO_PROGRESS].include?(report.termination)

      reach = proved.estimated_reach
      coarsest = DOCTOR[:safe_ratio] * reach
      return unless coarsest.positive? && coarsest < epsilon

      why = format('a quarter of the reach, about %.3g by the certificate of epsilon %g, which was too coarse',
                   reach, epsilon)
      quarter, least = rounded(reach / DOCTOR[:auto_epsilon]), rounded(DOCTOR[:auto_least_share] * epsilon)
      quarter < least ? [least, "no finer in one step, though #{why}"] : [quarter, why]
    end

    def self.rounded(length)
      Float(format('%.2g', length))
    end
    private_class_method :rounded
  end
end
