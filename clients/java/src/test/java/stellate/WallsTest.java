package stellate;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.Arrays;
import java.util.stream.IntStream;
import java.util.stream.LongStream;
import org.junit.jupiter.api.Test;

final class WallsTest {
  /** The part of the unit sphere where z is not negative. */
  private static final class Hemisphere implements Oracle.WithWalls {
    @Override
    public int dimension() {
      return 2;
    }

    @Override
    public int ambientDimension() {
      return 3;
    }

    @Override
    public int walls() {
      return 1;
    }

    @Override
    public double[][] boundingBox() {
      return new double[][] {{-1.1, -1.1, -1.1}, {1.1, 1.1, 1.1}};
    }

    private static void normalise(double[] x, double height, double[] points) {
      for (int i = 0; i < x.length; i += 3) {
        double z = height * x[i + 2];
        double length = Math.sqrt(x[i] * x[i] + x[i + 1] * x[i + 1] + z * z);
        points[i] = x[i] / length;
        points[i + 1] = x[i + 1] / length;
        points[i + 2] = z / length;
      }
    }

    @Override
    public void closestPoint(double[] x, double[] points, boolean[] found) {
      normalise(x, 1, points);
    }

    @Override
    public void facePoint(double[] x, int[] face, double[] points, boolean[] found) {
      normalise(x, 0, points);
    }

    @Override
    public void tangentBasis(double[] p, double[] bases) {
      for (int i = 0; i < p.length; i += 3) {
        double s = Math.copySign(1, p[i + 2]);
        double a = -1 / (s + p[i + 2]);
        double b = p[i] * p[i + 1] * a;
        double top = 1 + s * p[i] * p[i] * a;
        double[] basis = {top, b, s * b, s + p[i + 1] * p[i + 1] * a, -s * p[i], -p[i + 1]};
        System.arraycopy(basis, 0, bases, 2 * i, 6);
      }
    }

    @Override
    public void clearances(double[] points, double[] values) {
      for (int i = 0; i < values.length; i++) {
        values[i] = points[3 * i + 2];
      }
    }

    @Override
    public void conormals(double[] points, int[] face, double[] normals) {
      for (int i = 2; i < normals.length; i += 3) {
        normals[i] = -1;
      }
    }
  }

  @Test
  void manifoldsWithBoundary() {
    try (Server server = Server.start();
        Client client = new Client(server)) {
      Mesh mesh = Stellate.mesh(new Hemisphere(), 0.2, Options.on(client));
      assertTrue(mesh.certified());
      String counts = mesh.vertexCount() + " " + mesh.simplexCount();
      assertEquals(Live.fromEnvironment("STELLATE_TEST_HEMISPHERE"), counts);
      assertEquals(mesh.vertexCount(), mesh.walls.length);
      for (int i = 0; i < mesh.walls.length; i++) {
        double z = mesh.points[3 * i + 2];
        assertTrue(z >= 0);
        assertEquals(z == 0 ? 1 : 0, mesh.walls[i]);
      }
      int[] edges = mesh.boundary();
      assertEquals(2 * LongStream.of(mesh.walls).sum(), edges.length); // a circle
      assertTrue(edges.length > 0 && IntStream.of(edges).allMatch(i -> mesh.walls[i] == 1));

      String name = client.create(new Hemisphere(), 0.2, new Options()).getName();
      var other =
          assertThrows(StellateException.class, () -> client.serve(Live.TORUS, name, "", 0));
      assertEquals(StellateException.Kind.INVALID_ARGUMENT, other.kind());
      assertEquals("SUCCEEDED", client.serve(new Hemisphere(), name, "", 0));
      Mesh fetched = Stellate.download(client, name, 0);
      assertArrayEquals(mesh.walls, fetched.walls);
      assertTrue(Arrays.equals(mesh.simplices, fetched.simplices));
    }
  }
}
