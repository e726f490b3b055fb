package stellate;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.EnumSet;
import java.util.HashSet;
import java.util.List;
import java.util.Set;
import java.util.concurrent.CompletableFuture;
import java.util.concurrent.atomic.AtomicInteger;
import java.util.stream.Stream;
import org.junit.jupiter.api.AfterAll;
import org.junit.jupiter.api.BeforeAll;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import stellate.examples.Surface;
import stellate.v1.Certificate;
import stellate.v1.Phase;

final class MeshesTest {
  private static Server server;
  private static Client client;

  @BeforeAll
  static void start() {
    server = Server.start();
    client = new Client(server);
  }

  @AfterAll
  static void stop() {
    client.close();
    server.close();
  }

  @Test
  void sameMeshesAsPython() {
    Mesh torus = Stellate.mesh(Live.TORUS, 0.1, new Options()); // on a server of its own
    assertEquals(Live.expected(0), Live.counts(torus));
    assertTrue(torus.certified());
    Options options = Options.on(client);
    options.requireCertified = true;
    Mesh clifford = Stellate.mesh(new ProductOfCircles(2), 0.3, options);
    assertEquals(Live.expected(2), Live.counts(clifford));
    Certificate proved = clifford.report().orElseThrow().getCertificate();
    assertEquals(0, proved.getEulerCharacteristic());
  }

  /** Answers everything but tangents, and has seeds instead of a box. */
  private static final class Sphere extends Surface.Sphere {
    private final AtomicInteger intersections = new AtomicInteger();
    private final AtomicInteger most = new AtomicInteger();

    @Override
    public double[] seeds() {
      return new double[] {0, 0, 1};
    }

    @Override
    public void intersectFlat(
        double[] centers, double[] bases, double[] radii, double[] points, boolean[] found) {
      intersections.addAndGet(found.length);
      most.accumulateAndGet(found.length, Math::max);
      super.intersectFlat(centers, bases, radii, points, found);
    }

    @Override
    public void localSize(double[] points, double[] sizes) {
      java.util.Arrays.fill(sizes, 1);
    }
  }

  @Test
  void intersectionsAndSizesBySeveralWorkers() {
    Sphere sphere = new Sphere();
    Options options = Options.on(client);
    options.criteria.setSizeRate(0.25);
    options.workers = 3;
    options.maxChunk = 50;
    Mesh mesh = Stellate.mesh(sphere, 0.3, options);
    Certificate proved = mesh.report().orElseThrow().getCertificate();
    assertTrue(proved.getCertified(), proved.getVerdict());
    assertEquals(2, proved.getEulerCharacteristic());
    assertTrue(proved.getMaxCircumradius() <= 0.25);
    assertTrue(sphere.intersections.get() > 0 && sphere.most.get() <= 50);
  }

  @Test
  void growing() {
    List<Mesh> all = new ArrayList<>();
    Set<Phase> phases = EnumSet.noneOf(Phase.class);
    Options options = Options.on(client);
    options.onProgress = progress -> phases.add(progress.getPhase());
    Stellate.watch(Live.TORUS, 0.1, options, all::add);
    List<Integer> sizes = all.stream().map(Mesh::vertexCount).toList();
    assertTrue(sizes.size() > 5);
    assertEquals(sizes.stream().sorted().toList(), sizes);
    assertEquals(Live.expected(0), Live.counts(all.get(all.size() - 1)));
    assertTrue(phases.containsAll(Set.of(Phase.PHASE_REFINING, Phase.PHASE_DONE)));

    AtomicInteger seen = new AtomicInteger(); // who leaves takes the mesh along
    Options left = Options.on(client);
    left.spec.setLabel("left");
    Stellate.watch(Live.TORUS, 0.02, left, mesh -> seen.incrementAndGet() < 1);
    assertEquals(1, seen.get());
    assertTrue(client.list().stream().noneMatch(mesh -> mesh.getSpec().getLabel().equals("left")));
  }

  @Test
  void callByCall() {
    Options options = new Options();
    options.spec.setLabel("by hand").setRandomSeed(7);
    String name = client.create(Live.TORUS, 0.1, options).getName();
    var state = CompletableFuture.supplyAsync(() -> client.serve(Live.TORUS, name, "by hand", 0));
    List<Mesh> all = new ArrayList<>();
    Stellate.watch(client, name, all::add);
    assertEquals("SUCCEEDED", state.join());
    assertEquals("SUCCEEDED", client.serve(Live.TORUS, name, "", 0)); // too late, and no error
    Mesh fetched = Stellate.download(client, name, 0);
    Mesh watched = all.get(all.size() - 1);
    assertArrayEquals(watched.points, fetched.points);
    assertArrayEquals(watched.simplices, fetched.simplices);
    assertTrue(fetched.certified());
    assertTrue(
        client.list().stream().anyMatch(mesh -> mesh.getSpec().getLabel().equals("by hand")));
    client.delete(name);
    var error = assertThrows(StellateException.class, () -> client.get(name));
    assertEquals(StellateException.Kind.MESH_NOT_FOUND, error.kind());
  }

  @Test
  void cancelledWithTheMeshSoFar() {
    CompletableFuture<Void> cancel = new CompletableFuture<>();
    Options options = Options.on(client);
    options.cancel = cancel;
    options.onProgress =
        progress -> {
          if (progress.getVertices() > 500) {
            cancel.complete(null);
          }
        };
    var error =
        assertThrows(StellateException.class, () -> Stellate.mesh(Live.TORUS, 0.01, options));
    assertEquals(StellateException.Kind.CANCELLED, error.kind());
    assertTrue(error.mesh().orElseThrow().vertexCount() > 500);
  }

  @Test
  void files(@TempDir Path folder) throws Exception {
    Mesh mesh = Stellate.mesh(Live.TORUS, 0.3, Options.on(client));
    mesh.save(folder.resolve("torus.txt"));
    String text = Files.readString(folder.resolve("torus.txt"));
    double[] numbers = Stream.of(text.split("\\s+")).mapToDouble(Double::parseDouble).toArray();
    double[] head = {2, 3, mesh.vertexCount(), mesh.simplexCount()};
    assertArrayEquals(head, java.util.Arrays.copyOf(numbers, 4));
    int end = 4 + mesh.points.length;
    assertArrayEquals(mesh.points, java.util.Arrays.copyOfRange(numbers, 4, end));
    for (int i = 0; i < mesh.simplices.length; i++) {
      assertEquals(mesh.simplices[i], numbers[end + i]);
    }
    mesh.save(folder.resolve("torus.obj"));
    Set<String> directed = new HashSet<>();
    for (String line : Files.readAllLines(folder.resolve("torus.obj"))) {
      String[] words = line.split(" ");
      for (int i = 0; words[0].equals("f") && i < 3; i++) {
        String edge = words[1 + i] + " " + words[1 + (i + 1) % 3];
        assertTrue(directed.add(edge), "two triangles run along an edge the same way");
      }
    }
    assertEquals(3 * mesh.simplexCount(), directed.size());
    Path other = folder.resolve("torus.vtu");
    var error = assertThrows(StellateException.class, () -> mesh.save(other));
    assertEquals(StellateException.Kind.SAVE, error.kind());
  }
}
