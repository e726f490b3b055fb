package stellate;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertSame;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import io.grpc.Status;
import java.nio.channels.ClosedChannelException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.List;
import java.util.Set;
import java.util.TreeSet;
import java.util.concurrent.CopyOnWriteArrayList;
import java.util.concurrent.atomic.AtomicBoolean;
import java.util.stream.DoubleStream;
import org.junit.jupiter.api.Test;
import stellate.StellateException.Kind;

final class FailuresTest {
  private static StellateException thrown(Runnable work) {
    return assertThrows(StellateException.class, work::run);
  }

  @Test
  void whatAnotherAttemptMayMend() {
    assertTrue(Outage.isTransient(Status.UNAVAILABLE));
    assertTrue(Outage.isTransient(Status.INTERNAL.withDescription("RST_STREAM closed stream")));
    assertTrue(Outage.isTransient(Status.UNKNOWN.withCause(new ClosedChannelException())));
    assertFalse(Outage.isTransient(Status.UNKNOWN.withDescription("channel closed")));
    assertFalse(Outage.isTransient(Status.UNKNOWN.withCause(new IllegalStateException("mine"))));
    assertFalse(Outage.isTransient(Status.INVALID_ARGUMENT));
  }

  @Test
  void refusals() {
    try (Server server = Server.start();
        Client client = new Client(server)) {
      var error = thrown(() -> Stellate.mesh(Live.TORUS, -1, Options.on(client)));
      assertEquals(Kind.INVALID_ARGUMENT, error.kind());
      assertEquals("INVALID_ARGUMENT", error.reason());
      assertTrue(error.getMessage().contains("epsilon"));
      assertEquals(1, error.fields().size());
      String nobody = "meshes/" + "0".repeat(32);
      assertEquals(Kind.MESH_NOT_FOUND, thrown(() -> client.get(nobody)).kind());
      var served = thrown(() -> client.serve(Live.TORUS, nobody, "", 0));
      assertEquals(Kind.MESH_NOT_FOUND, served.kind());

      // A worker of another manifold leaves the mesh alone.
      String name = client.create(Live.TORUS, 0.1, new Options()).getName();
      var other = thrown(() -> client.serve(new ProductOfCircles(2), name, "", 0));
      assertEquals(Kind.INVALID_ARGUMENT, other.kind());
      assertEquals("SUCCEEDED", client.serve(Live.TORUS, name, "", 0));
    }
  }

  @Test
  void oraclesThatFail() {
    try (Server server = Server.start();
        Client client = new Client(server)) {
      ArithmeticException mine = new ArithmeticException("no such surface");
      Oracle throwing =
          Live.spoilt(
              points -> {
                throw mine;
              });
      var caught =
          assertThrows(
              ArithmeticException.class, () -> Stellate.mesh(throwing, 0.1, Options.on(client)));
      assertSame(mine, caught);

      Oracle infinite = Live.spoilt(points -> DoubleStream.of(points).map(x -> x / 0.0).toArray());
      var error = thrown(() -> Stellate.mesh(infinite, 0.1, Options.on(client)));
      assertEquals(Kind.ORACLE, error.kind());
      assertEquals("ORACLE_NOT_FINITE", error.reason());

      Oracle larger = Live.spoilt(points -> DoubleStream.of(points).map(x -> 1.1 * x).toArray());
      error = thrown(() -> Stellate.mesh(larger, 0.1, Options.on(client)));
      assertEquals(Kind.ORACLE, error.kind());
      assertEquals("ORACLE_BAD_TANGENT", error.reason());
    }
  }

  @Test
  void aServerThatComesBackIsWaitedFor() throws Exception {
    String address;
    try (Live.RestartingServer server = new Live.RestartingServer()) {
      address = server.address;
      List<String> said = new CopyOnWriteArrayList<>();
      AtomicBoolean killed = new AtomicBoolean();
      Oracle oracle =
          Live.spoilt(
              points -> {
                if (!killed.getAndSet(true)) {
                  server.restart();
                }
                return points;
              });
      try (Client client = new Client(address, Credentials.NONE).onOutage(said::add)) {
        Mesh mesh = Stellate.mesh(oracle, 0.1, Options.on(client));
        assertEquals(Live.expected(0), Live.counts(mesh));
        assertTrue(mesh.certified());
      }
      for (String words : List.of("lost the server", "the server is back")) {
        assertTrue(said.stream().anyMatch(line -> line.startsWith(words)), said.toString());
      }
    }
    try (Client client = new Client(address, Credentials.NONE)) {
      assertEquals(Kind.UNAVAILABLE, thrown(client::info).kind());
    }
  }

  @Test
  void aReplyThatIsLostCostsNothing() throws Exception {
    try (Live.RestartingServer server = Live.RestartingServer.lossy()) {
      Set<String> names = new TreeSet<>();
      for (int i = 0; i < 6; i++) {
        // A client each: its first call may be the one whose reply is lost.
        try (Client client = new Client(server.address, Credentials.NONE).reconnectSeconds(0)) {
          names.add(client.create(Live.TORUS, 0.2, new Options()).getName());
        }
      }
      for (int i = 0; i < 2; i++) {
        try (Client client = new Client(server.address, Credentials.NONE).reconnectSeconds(0)) {
          List<String> there = client.list().stream().map(mesh -> mesh.getName()).sorted().toList();
          assertEquals(List.copyOf(names), there);
          assertEquals(6, there.size());
        }
      }
    }
  }

  @Test
  void tlsAndAToken() throws Exception {
    String pem = Live.secret("proxy.pem").toString();
    String tokens = Live.secret("tokens").toString();
    String token = Files.readString(Live.secret("me.token")).strip();
    Path ca = Live.secret("ca.pem");
    try (var server =
        new Live.RestartingServer("--tls-cert", pem, "--tls-key", pem, "--token-file", tokens)) {
      String address = server.address;
      try (Client client = new Client(address, new Credentials(token, ca, null, null, false))) {
        assertTrue(Stellate.mesh(Live.TORUS, 0.1, Options.on(client)).certified());
      }
      for (String wrong : new String[] {null, "guessed"}) {
        try (Client client = new Client(address, new Credentials(wrong, ca, null, null, false))) {
          StellateException refused = thrown(client::info);
          assertEquals(Kind.UNAUTHENTICATED, refused.kind());
          assertTrue(refused.getMessage().contains("give a token"), refused.getMessage());
        }
      }
      try (Client client = new Client(address, new Credentials(token, null, null, null, true))) {
        assertEquals(Kind.UNAVAILABLE, thrown(client::info).kind());
      }
    }
    var plain =
        thrown(() -> new Client("mesh.example.org:7717", Credentials.token("secret")).close());
    assertEquals(Kind.INVALID_ARGUMENT, plain.kind());
  }
}
