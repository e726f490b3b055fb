package stellate;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.stream.DoubleStream;
import org.junit.jupiter.api.Test;
import stellate.v1.CheckReport;
import stellate.v1.Finding;
import stellate.v1.Severity;

final class DoctorTest {
  private static Finding finding(CheckReport report, String code) {
    return report.getFindingsList().stream()
        .filter(one -> one.getCode().equals(code))
        .findFirst()
        .orElseThrow(() -> new AssertionError(report.getText()));
  }

  @Test
  void aTorusAndItsEpsilon() {
    CheckReport report = Doctor.check(Live.TORUS, 0.3);
    assertTrue(report.getOk(), report.getText());
    assertEquals(0.4, report.getReach(), 0.01);
    assertEquals(1, report.getPieces());
    assertEquals(Severity.SEVERITY_WARNING, finding(report, "COARSE_EPSILON").getSeverity());
    var chosen = Doctor.chooseEpsilon(Live.TORUS);
    assertEquals(0.1, chosen.epsilon());
    assertTrue(chosen.reason().startsWith("a quarter of the reach, about 0.4"), chosen.reason());
  }

  @Test
  void whatIsWrong() {
    CheckReport report = Doctor.check(moving(), 0);
    assertFalse(report.getOk());
    Finding found = finding(report, "NOT_IDEMPOTENT");
    assertEquals(Severity.SEVERITY_ERROR, found.getSeverity());
    assertTrue(found.getAdvice().contains("Answer with points of M"), found.getAdvice());
    var error = assertThrows(StellateException.class, () -> Doctor.chooseEpsilon(moving()));
    assertEquals(StellateException.Kind.ORACLE, error.kind());
    assertEquals("ORACLE_BREAKS_CONTRACT", error.reason());
    Oracle raises =
        Live.spoilt(
            points -> {
              throw new ArithmeticException("no such surface");
            });
    String raised = finding(Doctor.check(raises, 0), "RAISED").getMessage();
    assertTrue(raised.contains("no such surface"), raised);
  }

  private static Oracle moving() {
    return Live.spoilt(points -> DoubleStream.of(points).map(x -> 1.01 * x).toArray());
  }
}
