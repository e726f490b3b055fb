package stellate;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.Arrays;
import java.util.Collections;
import java.util.List;
import java.util.concurrent.atomic.AtomicBoolean;
import java.util.concurrent.atomic.AtomicInteger;
import org.junit.jupiter.api.Test;
import stellate.StellateException.Kind;
import stellate.v1.CertificateLevel;

/** Reconstruction from points, against the real server. */
final class PointsTest {
  /** n points of the unit sphere down to a height, evenly; -1: all of it. */
  private static double[] sphere(int n, double lowest) {
    double[] points = new double[3 * n];
    for (int i = 0; i < n; i++) {
      double z = 1 - (1 - lowest) * (i + 0.5) / n;
      double turn = i * Math.PI * (3 - Math.sqrt(5));
      double around = Math.sqrt(1 - z * z);
      points[3 * i] = around * Math.cos(turn);
      points[3 * i + 1] = around * Math.sin(turn);
      points[3 * i + 2] = z;
    }
    return points;
  }

  private static ReconstructOptions exact(Client client) {
    ReconstructOptions options = ReconstructOptions.on(client);
    options.spec.setNoise(0);
    return options;
  }

  @Test
  void sphereThroughOneServerOrItsOwn() {
    double[] points = sphere(600, -1);
    try (Server server = Server.start();
        Client client = new Client(server)) {
      AtomicInteger heard = new AtomicInteger();
      ReconstructOptions options = exact(client);
      options.requireCertified = true;
      options.onProgress = progress -> heard.incrementAndGet();
      Mesh mesh = Stellate.reconstruct(points, 2, 3, options);
      assertArrayEquals(points, mesh.points);
      assertEquals(2 * 600 - 4, mesh.simplexCount());
      assertTrue(mesh.orientedSimplices().isPresent());
      assertEquals(Collections.nCopies(600, "OK"), mesh.places().orElseThrow());
      assertTrue(mesh.smoothed().isEmpty());
      assertTrue(heard.get() > 0);
      Mesh again = Stellate.reconstruct(points, 2, 3, exact(null));
      assertArrayEquals(mesh.simplices, again.simplices);
      assertEquals(List.of(), client.list());
    }
  }

  @Test
  void tangentSpacesAndReachAreProof() {
    double[] points = sphere(2500, -1);
    double[] tangents = new double[2 * points.length];
    for (int i = 0; i < points.length; i += 3) {
      double x = points[i];
      double y = points[i + 1];
      double z = points[i + 2];
      double around = Math.hypot(x, y);
      double[] basis = {-y / around, -z * x / around, x / around, -z * y / around, 0, around};
      System.arraycopy(basis, 0, tangents, 2 * i, 6);
    }
    ReconstructOptions options = exact(null);
    options.tangents = tangents;
    options.spec.setDeclaredReach(1);
    var certificate =
        Stellate.reconstruct(points, 2, 3, options).report().orElseThrow().getCertificate();
    assertEquals(
        CertificateLevel.CERTIFICATE_LEVEL_PROVED, certificate.getLevel(), certificate::getVerdict);
  }

  @Test
  void whereTheSampleEndsAndNoise() {
    try (Server server = Server.start();
        Client client = new Client(server)) {
      double[] cap = sphere(600, -0.2);
      Mesh mesh = Stellate.reconstruct(cap, 2, 3, exact(client));
      assertFalse(mesh.certified());
      assertTrue(mesh.places().orElseThrow().contains("EDGE"));
      ReconstructOptions open = exact(client);
      open.spec.setOpen(true);
      assertTrue(Stellate.reconstruct(cap, 2, 3, open).boundary().length > 0);
      ReconstructOptions strict = exact(client);
      strict.requireCertified = true;
      var error =
          assertThrows(StellateException.class, () -> Stellate.reconstruct(cap, 2, 3, strict));
      assertEquals(Kind.NOT_CERTIFIED, error.kind());
      assertEquals(600, error.mesh().orElseThrow().vertexCount());
      double[] shaken = sphere(900, -1);
      Arrays.setAll(shaken, i -> shaken[i] + 0.01 * Math.sin(12.9898 * i));
      Mesh noisy = Stellate.reconstruct(shaken, 2, 3, ReconstructOptions.on(client));
      assertArrayEquals(shaken, noisy.points);
      assertEquals(shaken.length, noisy.smoothed().orElseThrow().length);
    }
  }

  @Test
  void whatCannotBeTaken() {
    try (Server server = Server.start();
        Client client = new Client(server)) {
      double[] points = sphere(50, -1);
      double[] broken = points.clone();
      broken[7] = Double.NaN;
      ReconstructOptions odd = ReconstructOptions.on(client);
      odd.tangents = new double[3];
      refused("no whole points of R^3", Arrays.copyOf(points, 149), 2, exact(client));
      refused("point 2 is not finite", broken, 2, exact(client));
      refused("need 300", points, 2, odd);
      refused("from 1 on", points, 0, exact(client));
      refused("k must be less than d", points, 3, exact(client));
      refused("needs 4 at least", Arrays.copyOf(points, 9), 2, exact(client));

      ReconstructOptions left = exact(client);
      left.onProgress = progress -> left.cancel.complete(null);
      var error =
          assertThrows(
              StellateException.class, () -> Stellate.reconstruct(sphere(20_000, -1), 2, 3, left));
      assertEquals(Kind.CANCELLED, error.kind());
      assertEquals(List.of(), client.list());
    }
  }

  private static void refused(String words, double[] points, int k, ReconstructOptions options) {
    var error =
        assertThrows(
            StellateException.class, () -> Stellate.reconstruct(points, k, 3, options), words);
    assertEquals(Kind.INVALID_ARGUMENT, error.kind(), words);
    assertTrue(error.getMessage().contains(words), error::getMessage);
  }

  @Test
  void uploadGoesOnAfterKill() throws Exception {
    try (Live.RestartingServer server = new Live.RestartingServer();
        Client client = new Client(server.address, Credentials.NONE).onOutage(said -> {})) {
      AtomicBoolean killed = new AtomicBoolean();
      ReconstructOptions options = exact(client);
      options.onProgress =
          progress -> {
            if (!killed.getAndSet(true)) {
              server.restart();
            }
          };
      double[] points = sphere(40_000, -1);
      Mesh mesh = Stellate.reconstruct(points, 2, 3, options);
      assertArrayEquals(points, mesh.points);
      assertEquals(2 * 40_000 - 4, mesh.simplexCount());
      assertTrue(killed.get());
    }
  }
}
