package stellate;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertSame;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import java.nio.file.attribute.PosixFilePermissions;
import java.util.concurrent.CompletableFuture;
import java.util.concurrent.atomic.AtomicLong;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import stellate.examples.Surface;

final class CheckpointTest {
  /** The torus, and how often it was asked. */
  private static final class Counting extends Surface.OfTorus {
    private final AtomicLong asked = new AtomicLong();

    @Override
    public double[][] boundingBox() {
      return Live.TORUS.boundingBox();
    }

    @Override
    public void closestPoint(double[] x, double[] points, boolean[] found) throws Exception {
      asked.addAndGet(found.length);
      super.closestPoint(x, points, found);
    }
  }

  private static Options in(Path checkpoint) {
    Options options = new Options();
    options.checkpoint = checkpoint;
    return options;
  }

  @Test
  void goesOn(@TempDir Path folder) throws Exception {
    Path checkpoint = folder.resolve("torus");
    Options cancelling = in(checkpoint);
    CompletableFuture<Void> cancel = new CompletableFuture<>();
    cancelling.cancel = cancel;
    cancelling.onProgress =
        progress -> {
          if (progress.getVertices() > 500) {
            cancel.complete(null);
          }
        };
    Counting first = new Counting();
    var error = assertThrows(StellateException.class, () -> Stellate.mesh(first, 0.05, cancelling));
    assertEquals(StellateException.Kind.CANCELLED, error.kind());
    assertTrue(error.getMessage().contains("the same call goes on from there"));
    assertTrue(error.mesh().orElseThrow().vertexCount() > 0);

    Options relabelled = in(checkpoint);
    relabelled.spec.setLabel("another label is no other mesh");
    Counting second = new Counting();
    Mesh mesh = Stellate.mesh(second, 0.05, relabelled);
    Mesh straight = Stellate.mesh(new Counting(), 0.05, new Options());
    assertArrayEquals(straight.points, mesh.points);
    assertArrayEquals(straight.simplices, mesh.simplices);
    long queries = straight.report().orElseThrow().getCounts().getQueries();
    assertTrue(first.asked.get() > 0 && second.asked.get() < queries);

    // The record of another language's client: it chose epsilon, says why, writes out an empty
    // label.
    Path record = checkpoint.resolve("mesh");
    String kept = Files.readString(record, StandardCharsets.ISO_8859_1);
    String theirs = kept.replaceFirst("\n", " 2 a quarter of the reach\n") + "R\0";
    Files.writeString(record, theirs, StandardCharsets.ISO_8859_1);
    Counting third = new Counting();
    Mesh again = Stellate.mesh(third, 0.05, in(checkpoint));
    assertEquals(0, third.asked.get());
    assertTrue(again.certified());
    assertEquals(Live.counts(mesh), Live.counts(again));
    var other =
        assertThrows(StellateException.class, () -> Stellate.mesh(third, 0.06, in(checkpoint)));
    assertEquals(StellateException.Kind.INVALID_ARGUMENT, other.kind());
  }

  @Test
  void waitsForABetterOracle(@TempDir Path folder) {
    ArithmeticException mine = new ArithmeticException("no such surface");
    Oracle throwing =
        Live.spoilt(
            points -> {
              throw mine;
            });
    var caught =
        assertThrows(ArithmeticException.class, () -> Stellate.mesh(throwing, 0.1, in(folder)));
    assertSame(mine, caught);
    // As the failing one, which has tangents and a box: the specification is the same.
    assertEquals(Live.expected(0), Live.counts(Stellate.mesh(Live.TORUS, 0.1, in(folder))));
  }

  private static void refused(Path checkpoint, String words) {
    var error =
        assertThrows(StellateException.class, () -> Stellate.mesh(Live.TORUS, 0.3, in(checkpoint)));
    assertEquals(StellateException.Kind.INVALID_ARGUMENT, error.kind());
    assertTrue(error.getMessage().contains(words), error.getMessage());
  }

  @Test
  void believesNobodyElse(@TempDir Path folder) throws Exception {
    Path open = Files.createDirectory(folder.resolve("open"));
    Files.setPosixFilePermissions(open, PosixFilePermissions.fromString("rwxrwxrwx"));
    refused(open, "chmod go-w");
    Path link = Files.createSymbolicLink(folder.resolve("link"), folder);
    refused(link, "is a link");

    Path precious = Files.writeString(folder.resolve("precious"), "mine");
    Path checkpoint = Files.createDirectory(folder.resolve("planted"));
    Files.setPosixFilePermissions(checkpoint, PosixFilePermissions.fromString("rwx------"));
    Files.createSymbolicLink(checkpoint.resolve("mesh.new"), precious);
    Stellate.mesh(Live.TORUS, 0.3, in(checkpoint));
    assertEquals("mine", Files.readString(precious));
    Path record = checkpoint.resolve("mesh");
    Files.move(record, folder.resolve("elsewhere"));
    Files.createSymbolicLink(record, folder.resolve("elsewhere"));
    refused(checkpoint, "is a link");
  }
}
