# frozen_string_literal: true

# The doctor: whether an oracle is what it should be, and how large epsilon may be. A server asks the
# questions, for clients in all languages alike.
module Stellate
  # Probes an oracle for its contract, before a mesh is made of its answers: a V1::CheckReport with `ok`,
  # `findings`, `text`, `reach` and more (doctor.proto). What it raises is a finding, too. `epsilon`: that a
  # mesh is planned with. A private server asks; see Client#check for another.
  def self.check(oracle, epsilon: 0)
    Server.start { |server| Client.new(server).check(oracle, epsilon:) }
  end

  # A quarter of the reach that `check` finds, to two digits, and a word about it: what `mesh` takes for the
  # epsilon "auto". Raises OracleError where the oracle breaks its contract.
  def self.choose_epsilon(oracle)
    report = check(oracle)
    return [report.epsilon, report.epsilon_reason] if report.has_epsilon?

    problem = report.no_epsilon
    raise error_class(problem.reason).new(problem.message, reason: problem.reason)
  end
end
