package stellate;

import io.grpc.Context;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.concurrent.TimeUnit;
import java.util.concurrent.atomic.AtomicReference;
import java.util.function.Consumer;
import java.util.function.Predicate;
import stellate.v1.DownloadMeshRequest;
import stellate.v1.Failure;
import stellate.v1.MeshDelta;
import stellate.v1.MeshState;
import stellate.v1.Phase;
import stellate.v1.Progress;
import stellate.v1.WatchMeshRequest;
import stellate.v1.WatchMeshResponse;

/** Meshes: from an oracle, as they grow, or as they are on a server. */
public final class Stellate {
  private static final long FAREWELL = 2000; // milliseconds that a worker may take to end

  private Stellate() {}

  /** Meshes the oracle's manifold. epsilon is the largest circumradius of a simplex, a length. */
  public static Mesh mesh(Oracle oracle, double epsilon, Options options) {
    AtomicReference<Mesh> last = new AtomicReference<>();
    run(
        oracle,
        epsilon,
        options,
        false,
        mesh -> {
          last.set(mesh);
          return true;
        });
    return checked(last.get(), options.requireCertified);
  }

  private static Mesh checked(Mesh finished, boolean requireCertified) {
    if (requireCertified && !finished.certified()) {
      String verdict = finished.report().map(end -> end.getCertificate().getVerdict()).orElse("");
      throw new StellateException(
              StellateException.Kind.NOT_CERTIFIED,
              "NOT_CERTIFIED",
              "the mesh is not certified: " + verdict)
          .with(finished);
    }
    return finished;
  }

  /**
   * Makes a mesh of points on a k-manifold in R^d, or near it: [n, d], one point after the other.
   * Point i is vertex i of the mesh, and its places say what became of it.
   */
  public static Mesh reconstruct(double[] points, int k, int d, ReconstructOptions options) {
    Cloud cloud = new Cloud(points, k, d, options.tangents);
    if (options.client != null) {
      return reconstruct(options.client, cloud, options);
    }
    try (Server server = Server.start();
        Client client = new Client(server)) {
      return reconstruct(client, cloud, options);
    }
  }

  private static Mesh reconstruct(Client client, Cloud cloud, ReconstructOptions options) {
    Upload upload = new Upload(client, cloud);
    String name = upload.declare(cloud.spec(options.spec));
    try {
      options.cancel.whenComplete((value, error) -> upload.cancel());
      upload.run(options.onProgress);
      return checked(download(client, name, 0), options.requireCertified);
    } catch (StellateException error) {
      throw options.cancel.isDone() ? cancelled("was cancelled") : error;
    } finally {
      forget(client, name);
    }
  }

  private static boolean forget(Client client, String name) {
    try {
      client.deleteOnce(name);
      return true;
    } catch (StellateException error) {
      return false; // it ends with its server, or somebody else was first
    }
  }

  /**
   * The mesh as it grows, at every revision; the last one has its report. Where each returns false
   * the mesh is cancelled.
   */
  public static void watch(Oracle oracle, double epsilon, Options options, Predicate<Mesh> each) {
    run(oracle, epsilon, options, true, each);
  }

  /** A mesh that others serve, as it grows. */
  public static void watch(Client client, String name, Predicate<Mesh> each) {
    try (var within = Context.current().withCancellation()) {
      follow(client, client.get(name), within, progress -> {}, true, each);
    }
  }

  /** Fetches a mesh that is on a server: one that is over, or, revision > 0, as it was then. */
  public static Mesh download(Client client, String name, long revision) {
    stellate.v1.Mesh info = client.get(name);
    if (!info.hasEndTime() && revision == 0) {
      throw new StellateException(
          StellateException.Kind.FAILED_PRECONDITION,
          "FAILED_PRECONDITION",
          name + " is not over: " + info.getState());
    }
    Growth growth = empty(info);
    DownloadMeshRequest.Builder request =
        DownloadMeshRequest.newBuilder().setName(name).setRevision(revision);
    int d = info.getSpec().getAmbientDimension();
    try (var within = Context.current().withCancellation()) {
      client.follow(
          within,
          stub -> stub.downloadMesh(request.build()),
          () -> {},
          part -> {
            request.setRevision(part.getRevision()).setPosition(part.getNextPosition());
            growth.revision(part.getRevision());
            growth.addPoints(part.getFirstVertex(), Wire.numbers(part.getPoints(), -1, d));
            growth.change(
                MeshDelta.newBuilder()
                    .setAdded(part.getCells())
                    .addAllBoundaryVertices(part.getBoundaryVerticesList())
                    .addAllBoundaryWalls(part.getBoundaryWallsList())
                    .build());
            growth.orientPart(part.getOrientation());
            growth.addPlaces(part.getPlaces());
            return part.getComplete();
          });
    }
    Mesh mesh = growth.downloaded();
    return revision > 0 ? mesh : judged(mesh.with(info.getProgress(), info.getReport()), info);
  }

  private static Growth empty(stellate.v1.Mesh info) {
    // The boundary alone has simplices of one dimension less.
    int k = info.getSpec().getDimension() - (info.getSpec().getBoundaryOnly() ? 1 : 0);
    return new Growth(k, info.getSpec().getAmbientDimension());
  }

  private static void follow(
      Client client,
      stellate.v1.Mesh info,
      Context.CancellableContext within,
      Consumer<Progress> onProgress,
      boolean every,
      Predicate<Mesh> each) {
    Growth growth = empty(info);
    AtomicReference<Progress> progress = new AtomicReference<>();
    WatchMeshRequest.Builder request = WatchMeshRequest.newBuilder().setName(info.getName());
    Predicate<WatchMeshResponse> last =
        event -> {
          switch (event.getEventCase()) {
            case DELTA -> {
              boolean complete = growth.absorb(event.getDelta());
              request.setFromRevision(growth.revision());
              return complete && every && !each.test(growth.mesh().with(progress.get(), null));
            }
            case RESET_MESH -> {
              growth.reset();
              request.setFromRevision(0);
            }
            case ORIENTATION -> growth.orient(event.getOrientation());
            case PROGRESS -> {
              progress.set(event.getProgress());
              onProgress.accept(event.getProgress());
              if (event.getProgress().getPhase() == Phase.PHASE_CERTIFYING) {
                growth.settle(); // while the server is busy
              }
            }
            case FINAL -> {
              stellate.v1.Mesh end = event.getFinal();
              onProgress.accept(end.getProgress());
              each.test(judged(growth.finished().with(end.getProgress(), end.getReport()), end));
              return true;
            }
            default -> {} // of a newer server
          }
          return false;
        };
    try {
      client.follow(within, stub -> stub.watchMesh(request.build()), growth::forgetPending, last);
    } catch (StellateException error) {
      throw error.with(growth.mesh());
    }
  }

  private static Mesh judged(Mesh mesh, stellate.v1.Mesh end) {
    if (end.getState() == MeshState.MESH_STATE_CANCELLED) {
      throw cancelled("was cancelled").with(mesh);
    }
    if (end.getState() == MeshState.MESH_STATE_FAILED) {
      Failure failure = end.getReport().getFailure();
      var kind = StellateException.Kind.ofReason(failure.getReason());
      throw new StellateException(kind, failure.getReason(), failure.getMessage()).with(mesh);
    }
    return mesh;
  }

  static StellateException cancelled(String what) {
    return new StellateException(StellateException.Kind.CANCELLED, "CANCELLED", "the mesh " + what);
  }

  private static void run(
      Oracle oracle, double epsilon, Options options, boolean every, Predicate<Mesh> each) {
    CheckedOracle checked = new CheckedOracle(oracle);
    if (options.checkpoint != null) {
      keep(new Checkpoint(options.checkpoint), checked, epsilon, options, every, each);
      return;
    }
    if (options.client != null) {
      stellate.v1.Mesh info = options.client.create(options.client.spec(checked, epsilon, options));
      session(options.client, checked, info, options, every, each);
      return;
    }
    try (Server server = Server.start();
        Client client = new Client(server)) {
      stellate.v1.Mesh info = client.create(client.spec(checked, epsilon, options));
      session(client, checked, info, options, every, each);
    }
  }

  private static void keep(
      Checkpoint checkpoint,
      CheckedOracle checked,
      double epsilon,
      Options options,
      boolean every,
      Predicate<Mesh> each) {
    if (options.client != null) {
      throw StellateException.invalid(
          "a checkpoint is for a private server: one that is named keeps meshes itself");
    }
    try (Server server = checkpoint.server();
        Client client = new Client(server)) {
      stellate.v1.Mesh info = checkpoint.declare(client, client.spec(checked, epsilon, options));
      session(client, checked, info, options, every, each);
    } catch (StellateException error) {
      checkpoint.forgetAfter(error);
      throw error;
    }
  }

  private static void session(
      Client client,
      CheckedOracle checked,
      stellate.v1.Mesh info,
      Options options,
      boolean every,
      Predicate<Mesh> each) {
    boolean kept = options.checkpoint != null;
    AtomicReference<Throwable> failure = new AtomicReference<>();
    List<Worker> workers = new ArrayList<>();
    List<Thread> threads = new ArrayList<>();
    boolean over = false;
    try (var within = Context.current().withCancellation()) {
      for (int i = 1; i <= Math.max(1, options.workers); i++) {
        Outage quiet = new Outage(client.patience, true);
        Worker worker =
            new Worker(client, checked, info.getName(), "java-" + i, options.maxChunk, quiet);
        worker.tells = !kept;
        worker.onFailure =
            error -> {
              failure.compareAndSet(null, error);
              if (kept) {
                within.cancel(error); // the mesh waits for a better oracle
              }
            };
        Thread thread = new Thread(() -> serve(worker), "oracle-" + i);
        thread.setDaemon(true);
        workers.add(worker);
        threads.add(thread);
        thread.start();
      }
      options.cancel.whenComplete(
          (value, error) -> {
            if (kept) {
              within.cancel(error);
            } else {
              cancel(client, info.getName(), within);
            }
          });
      follow(client, info, within, options.onProgress, every, each);
      over = true;
    } catch (StellateException error) {
      throw better(error, failure.get(), options.checkpoint);
    } finally {
      leave(workers, threads, over);
      if (!kept) {
        over &= forget(client, info.getName());
      }
    }
  }

  private static void serve(Worker worker) {
    try {
      worker.run();
    } catch (RuntimeException error) {
      return; // noted; what the server refuses, or its absence, the watch reports
    }
  }

  private static void cancel(Client client, String name, Context.CancellableContext within) {
    Thread thread =
        new Thread(
            () -> {
              try {
                client.cancelOnce(name);
              } catch (StellateException error) {
                within.cancel(error); // a server that is away cannot say how the mesh ends
              }
            },
            "stellate cancel");
    thread.setDaemon(true);
    thread.start();
  }

  /** Our own says more than the server's account of it. */
  private static RuntimeException better(
      StellateException theirs, Throwable ours, Path checkpoint) {
    if (theirs.kind() == StellateException.Kind.CANCELLED) {
      if (checkpoint == null) {
        return theirs;
      } else if (ours == null) {
        return cancelled("is kept in " + checkpoint + ": the same call goes on from there")
            .with(theirs.mesh().orElse(null));
      }
    }
    if (ours instanceof StellateException said) {
      return said.with(theirs.mesh().orElse(null));
    }
    if (ours instanceof Error worse) {
      throw worse;
    }
    if (ours instanceof RuntimeException itself) {
      return itself;
    }
    return ours == null
        ? theirs
        : new StellateException(
                StellateException.Kind.RAISED, "ORACLE_FAILED", ours.toString(), ours)
            .with(theirs.mesh().orElse(null));
  }

  private static void leave(List<Worker> workers, List<Thread> threads, boolean over) {
    try {
      long until = System.nanoTime() + TimeUnit.MILLISECONDS.toNanos(FAREWELL);
      for (Thread thread : over ? threads : List.<Thread>of()) {
        thread.join(Math.max(1, TimeUnit.NANOSECONDS.toMillis(until - System.nanoTime())));
      }
    } catch (InterruptedException error) {
      Thread.currentThread().interrupt();
    } finally {
      workers.forEach(Worker::stop);
    }
  }
}
