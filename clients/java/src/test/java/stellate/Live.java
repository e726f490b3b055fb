package stellate;

import static org.junit.jupiter.api.Assertions.assertNotNull;

import java.io.BufferedReader;
import java.io.IOException;
import java.io.OutputStream;
import java.nio.charset.StandardCharsets;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.function.UnaryOperator;
import java.util.stream.Stream;
import stellate.examples.Surface;

/** What the tests share: servers, and how large the meshes have to be. */
final class Live {
  static final Torus TORUS = new Torus(1, 0.4);

  private Live() {}

  static String fromEnvironment(String name) {
    String value = System.getenv(name);
    assertNotNull(value, "tests/languages/run sets " + name);
    return value;
  }

  static Path secret(String name) {
    return Path.of(fromEnvironment("STELLATE_TEST_SECRETS"), name);
  }

  /** Vertices and simplices of the torus, then of the Clifford torus, as Python has them. */
  static List<Integer> expected(int first) {
    List<Integer> all =
        Stream.of(fromEnvironment("STELLATE_TEST_COUNTS").strip().split(" "))
            .map(Integer::valueOf)
            .toList();
    return all.subList(first, first + 2);
  }

  static List<Integer> counts(Mesh mesh) {
    return List.of(mesh.vertexCount(), mesh.simplexCount());
  }

  /** The torus, its answers spoilt after a while. */
  static Oracle spoilt(UnaryOperator<double[]> spoil) {
    return new Surface.OfTorus() {
      private int asked;

      @Override
      public double[][] boundingBox() {
        return TORUS.boundingBox();
      }

      @Override
      public void closestPoint(double[] x, double[] points, boolean[] found) throws Exception {
        super.closestPoint(x, points, found);
        asked += found.length;
        if (asked > 300) {
          double[] spoilt = spoil.apply(points.clone());
          System.arraycopy(spoilt, 0, points, 0, points.length);
        }
      }
    };
  }

  /** A server that can be killed and started again; or one that loses replies. */
  static final class RestartingServer implements AutoCloseable {
    final String address;
    private final Process process;
    private final OutputStream in;

    RestartingServer(String... flags) throws IOException {
      this("STELLATE_TEST_RESTARTING_SERVER", List.of(flags));
    }

    /** One behind a proxy that loses every second reply. */
    static RestartingServer lossy() throws IOException {
      return new RestartingServer("STELLATE_TEST_LOSSY_SERVER", List.of());
    }

    private RestartingServer(String program, List<String> flags) throws IOException {
      List<String> command = new ArrayList<>();
      command.add(fromEnvironment(program));
      command.addAll(flags);
      process = new ProcessBuilder(command).start();
      in = process.getOutputStream();
      BufferedReader out = process.inputReader(StandardCharsets.UTF_8);
      address = out.readLine().strip();
    }

    void restart() {
      try {
        in.write('\n');
        in.flush();
      } catch (IOException error) {
        throw new java.io.UncheckedIOException(error);
      }
    }

    @Override
    public void close() throws IOException {
      in.close();
      process.onExit().join();
    }
  }
}
