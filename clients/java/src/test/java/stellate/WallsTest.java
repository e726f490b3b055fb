package stellate;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.Arrays;
import java.util.stream.IntStream;
import java.util.stream.LongStream;
import org.junit.jupiter.api.Test;
import stellate.examples.Surface;

final class WallsTest {
  private static final Oracle HEMISPHERE = new Surface.CutSphere(1);

  @Test
  void manifoldsWithBoundary() {
    try (Server server = Server.start();
        Client client = new Client(server)) {
      Mesh mesh = Stellate.mesh(HEMISPHERE, 0.2, Options.on(client));
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

      String name = client.create(HEMISPHERE, 0.2, new Options()).getName();
      var other =
          assertThrows(StellateException.class, () -> client.serve(Live.TORUS, name, "", 0));
      assertEquals(StellateException.Kind.INVALID_ARGUMENT, other.kind());
      assertEquals("SUCCEEDED", client.serve(HEMISPHERE, name, "", 0));
      Mesh fetched = Stellate.download(client, name, 0);
      assertArrayEquals(mesh.walls, fetched.walls);
      assertTrue(Arrays.equals(mesh.simplices, fetched.simplices));
    }
  }
}
