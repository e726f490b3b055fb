package stellate;

import stellate.v1.CheckReport;
import stellate.v1.Failure;

/**
 * Whether an oracle is what it should be, and how large epsilon may be. A private server asks the
 * questions, for clients in all languages alike; Client.check has another one ask.
 */
public final class Doctor {
  private Doctor() {}

  /** A quarter of the reach that check() finds, to two digits, and a word about it. */
  public record ChosenEpsilon(double epsilon, String reason) {}

  /**
   * Probes an oracle for its contract, before a mesh is made of its answers; what it throws is a
   * finding, too. epsilon: that a mesh is planned with, 0: none yet. doctor.proto says what the
   * report has.
   */
  public static CheckReport check(Oracle oracle, double epsilon) {
    try (Server server = Server.start();
        Client client = new Client(server)) {
      return client.check(oracle, epsilon);
    }
  }

  /** Throws an exception of kind ORACLE where the oracle breaks its contract. */
  public static ChosenEpsilon chooseEpsilon(Oracle oracle) {
    CheckReport report = check(oracle, 0);
    if (report.hasEpsilon()) {
      return new ChosenEpsilon(report.getEpsilon(), report.getEpsilonReason());
    }
    Failure problem = report.getNoEpsilon();
    throw new StellateException(
        StellateException.Kind.ofReason(problem.getReason()),
        problem.getReason(),
        problem.getMessage());
  }
}
