package stellate;

import io.grpc.Status;
import io.grpc.StatusRuntimeException;
import io.grpc.stub.ClientCallStreamObserver;
import io.grpc.stub.ClientResponseObserver;
import java.nio.charset.StandardCharsets;
import java.util.ArrayList;
import java.util.List;
import java.util.concurrent.BlockingQueue;
import java.util.concurrent.LinkedBlockingQueue;
import java.util.concurrent.ScheduledExecutorService;
import java.util.concurrent.ScheduledThreadPoolExecutor;
import java.util.concurrent.TimeUnit;
import java.util.function.Consumer;
import stellate.v1.Busy;
import stellate.v1.Hello;
import stellate.v1.OracleCapabilities;
import stellate.v1.OracleFailure;
import stellate.v1.QueryChunk;
import stellate.v1.ServeOracleRequest;
import stellate.v1.ServeOracleResponse;
import stellate.v1.Welcome;

/** A worker: a ServeOracle stream, on which the server asks and an oracle answers. */
final class Worker {
  private static final int ANSWER_BYTES = 3_000_000; // an answer stays below the server's 4 MB
  private static final int MESSAGE_CHARACTERS = 1000; // 4000 bytes
  private static final double BUSY_SHARE = 0.25; // of the time that the server bears silence

  private final Client client;
  private final CheckedOracle oracle;
  private final Hello hello;
  private final Outage outage;
  private volatile Stream stream;
  private volatile boolean stopped;

  Consumer<Throwable> onFailure = error -> {}; // gets what the oracle threw, before the server does
  boolean tells = true; // whether the server is

  Worker(
      Client client, CheckedOracle oracle, String mesh, String name, int maxChunk, Outage outage) {
    this.client = client;
    this.oracle = oracle;
    this.outage = outage;
    int numbers = oracle.d * (oracle.k + 1 + Math.min(oracle.k, oracle.walls)) + oracle.walls;
    int most = Math.max(1, ANSWER_BYTES / (8 * numbers + 9));
    int chunk = maxChunk > 0 ? Math.min(most, maxChunk) : most;
    hello = Hello.newBuilder().setMesh(mesh).setWorker(name).setMaxChunkQueries(chunk).build();
  }

  /** The state that the mesh ended in, "" when stopped before. */
  String run() {
    while (true) {
      try {
        return serve();
      } catch (StatusRuntimeException error) {
        if (stopped) {
          return "";
        }
        var kind = StellateException.of(error).kind();
        if (kind == StellateException.Kind.FAILED_PRECONDITION) {
          String state = howItEnded(); // before this worker came, or while it was away
          if (!state.isEmpty()) {
            return state;
          }
        }
        outage.await(error);
      }
    }
  }

  /** Ends the stream: what is unanswered goes to another worker. */
  void stop() {
    stopped = true;
    outage.stop();
    Stream open = stream;
    if (open != null) {
      open.cancel();
    }
  }

  private String howItEnded() {
    try {
      for (int i = 0; i < 300; i++) {
        stellate.v1.Mesh mesh = client.get(hello.getMesh());
        if (mesh.hasEndTime()) {
          return mesh.getState().name().replace("MESH_STATE_", "");
        }
        Thread.sleep(100); // it is just about to end
      }
    } catch (InterruptedException error) {
      Thread.currentThread().interrupt();
    }
    return "";
  }

  /** What comes is read ahead: the next chunk is on its way while one is answered. */
  private static final class Stream
      implements ClientResponseObserver<ServeOracleRequest, ServeOracleResponse> {
    private final BlockingQueue<Object> unread = new LinkedBlockingQueue<>();
    private ClientCallStreamObserver<ServeOracleRequest> requests;
    private long lease; // that the oracle is at, or 0
    private boolean ended;

    @Override
    public void beforeStart(ClientCallStreamObserver<ServeOracleRequest> calls) {
      requests = calls;
    }

    @Override
    public void onNext(ServeOracleResponse response) {
      unread.add(response);
    }

    @Override
    public void onError(Throwable error) {
      unread.add(error);
    }

    @Override
    public void onCompleted() {
      unread.add(Status.OK);
    }

    /** Null at the end. */
    ServeOracleResponse next() {
      Object next;
      try {
        next = unread.take();
      } catch (InterruptedException error) {
        Thread.currentThread().interrupt();
        throw Status.CANCELLED.withCause(error).asRuntimeException();
      }
      if (next instanceof Throwable error) {
        Status status = Status.fromThrowable(error);
        throw status.asRuntimeException(Status.trailersFromThrowable(error));
      }
      return next instanceof ServeOracleResponse response ? response : null;
    }

    synchronized void put(ServeOracleRequest.Builder request) {
      lease = 0;
      if (!ended) {
        requests.onNext(request.build());
      }
    }

    synchronized void begin(long chunk) {
      lease = chunk;
    }

    synchronized void sayBusy() {
      if (lease != 0 && !ended) {
        Busy busy = Busy.newBuilder().setLease(lease).build();
        requests.onNext(ServeOracleRequest.newBuilder().setBusy(busy).build());
      }
    }

    synchronized void end() {
      if (!ended) {
        ended = true;
        requests.onCompleted();
      }
    }

    synchronized void cancel() {
      ended = true;
      requests.cancel("this worker leaves", null);
    }
  }

  private String serve() {
    Stream open = new Stream();
    client.stub.serveOracle(open);
    stream = open;
    if (stopped) {
      open.cancel();
    }
    open.put(ServeOracleRequest.newBuilder().setHello(hello));
    ScheduledExecutorService teller = null;
    String state = "";
    try {
      for (var response = open.next(); response != null; response = open.next()) {
        outage.heard();
        switch (response.getMessageCase()) {
          case QUERIES -> answer(open, response.getQueries());
          case WELCOME -> {
            compare(response.getWelcome());
            long every = (long) (1e9 * BUSY_SHARE * response.getWelcome().getAnswerSeconds());
            if (every > 0 && teller == null) {
              teller = new ScheduledThreadPoolExecutor(1, Worker::daemon);
              teller.scheduleAtFixedRate(open::sayBusy, every, every, TimeUnit.NANOSECONDS);
            }
          }
          case OVER -> {
            state = response.getOver().getState().replace("MESH_STATE_", "");
            open.end();
          }
          default -> {} // of a newer server
        }
      }
      return state;
    } finally {
      if (teller != null) {
        teller.shutdownNow();
      }
      open.cancel(); // unless it has ended
    }
  }

  private static Thread daemon(Runnable work) {
    Thread thread = new Thread(work, "stellate busy");
    thread.setDaemon(true);
    return thread;
  }

  private void answer(Stream open, QueryChunk chunk) {
    open.begin(chunk.getLease());
    try {
      open.put(ServeOracleRequest.newBuilder().setAnswers(oracle.answer(chunk)));
    } catch (Throwable error) {
      onFailure.accept(error);
      if (!tells) {
        open.end(); // as a worker that has to go
        throw thrown(error);
      }
      String said = String.valueOf(error);
      said = said.substring(0, Math.min(said.length(), MESSAGE_CHARACTERS));
      byte[] sound = said.getBytes(StandardCharsets.UTF_8); // half a surrogate becomes "?"
      OracleFailure.Builder failure = OracleFailure.newBuilder().setLease(chunk.getLease());
      failure.setMessage(new String(sound, StandardCharsets.UTF_8));
      open.put(ServeOracleRequest.newBuilder().setFailure(failure));
      open.end();
      try {
        while (open.next() != null) {
          continue; // until the server has taken note
        }
      } catch (StatusRuntimeException announced) {
        error.addSuppressed(announced); // ABORTED
      }
      throw thrown(error);
    }
  }

  /** As itself where that can be. */
  private static RuntimeException thrown(Throwable error) {
    if (error instanceof Error worse) {
      throw worse;
    }
    if (error instanceof RuntimeException itself) {
      return itself;
    }
    return new StellateException(
        StellateException.Kind.RAISED, "ORACLE_FAILED", String.valueOf(error), error);
  }

  /** Leaves the mesh alone if this oracle is not of its kind. */
  private void compare(Welcome welcome) {
    OracleCapabilities asked = welcome.getOracle();
    OracleCapabilities able = oracle.capabilities();
    List<String> missing = new ArrayList<>();
    if (asked.getIntersectFlat() && !able.getIntersectFlat()) {
      missing.add("intersectFlat");
    }
    if (asked.getTangentBasis() && !able.getTangentBasis()) {
      missing.add("tangentBasis");
    }
    if (asked.getLocalSize() && !able.getLocalSize()) {
      missing.add("localSize");
    }
    String problem;
    if (welcome.getDimension() != oracle.k || welcome.getAmbientDimension() != oracle.d) {
      problem =
          "the mesh has dimension %d in R^%d, and this oracle's manifold has dimension %d in R^%d"
              .formatted(welcome.getDimension(), welcome.getAmbientDimension(), oracle.k, oracle.d);
    } else if (welcome.getWalls() != oracle.walls) {
      problem =
          "the mesh has %d walls, and this oracle's manifold has %d"
              .formatted(welcome.getWalls(), oracle.walls);
    } else if (missing.isEmpty()) {
      return;
    } else {
      problem = "the mesh was declared with " + missing + ", which this oracle lacks";
    }
    throw StellateException.invalid(problem + ": all workers of a mesh have to serve one manifold");
  }
}
