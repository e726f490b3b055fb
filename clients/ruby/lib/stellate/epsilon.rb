# frozen_string_literal: true

module Stellate
  # An epsilon; if 'auto' chose it, why, and how many finer ones may follow.
  Choice = Struct.new(:epsilon, :reason, :retries) do
    # What an oracle is meshed with at first.
    def self.of(oracle, epsilon)
      return new(epsilon, '', 0) unless epsilon == 'auto'

      new(*Stellate.choose_epsilon(oracle), AUTO[:retries])
    end

    # What follows a mesh of this choice that is over; nil: nothing that a smaller epsilon would mend.
    def finer(report)
      found = report&.finer if retries.positive?
      found && Choice.new(found.epsilon, found.reason, retries - 1)
    end
  end
end
