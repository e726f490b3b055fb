package stellate;

import io.grpc.Context;
import io.grpc.StatusRuntimeException;
import java.util.Iterator;
import java.util.List;
import java.util.concurrent.atomic.AtomicReference;
import java.util.function.Consumer;
import stellate.v1.PointsChunk;
import stellate.v1.Progress;
import stellate.v1.ReconstructReply;
import stellate.v1.Reconstruction;
import stellate.v1.WatchMeshRequest;

/** Points on their way to a server, and their mesh, which is watched meanwhile. */
final class Upload {
  private final Client client;
  private final Cloud cloud;
  private final Context.CancellableContext sending = Context.current().withCancellation();
  private final Context.CancellableContext watching = Context.current().withCancellation();
  private final AtomicReference<RuntimeException> failure = new AtomicReference<>();
  private String name;

  Upload(Client client, Cloud cloud) {
    this.client = client;
    this.cloud = cloud;
  }

  /** The name of the new mesh. Once: whether the mesh was made would not be known. */
  String declare(Reconstruction spec) {
    try {
      PointsChunk first = PointsChunk.newBuilder().setSpec(spec).build();
      name = send(List.of(first).iterator()).getMesh().getName();
      client.patience.reached = true;
      return name;
    } catch (StatusRuntimeException error) {
      throw StellateException.of(error);
    }
  }

  /** Sends all points, and returns once the mesh is over. */
  void run(Consumer<Progress> onProgress) {
    Thread sender = new Thread(this::sendAll, "stellate upload");
    sender.setDaemon(true);
    sender.start();
    try {
      watch(onProgress);
    } catch (StellateException error) {
      RuntimeException refused = failure.get();
      // How the mesh ended says more than why its upload was refused then.
      if (refused == null || !client.get(name).hasEndTime()) {
        throw refused == null ? error : refused;
      }
    } finally {
      sending.cancel(null);
      watching.cancel(null);
    }
  }

  /** Makes run() throw an exception of kind CANCELLED. */
  void cancel() {
    watching.cancel(null);
  }

  private void watch(Consumer<Progress> onProgress) {
    WatchMeshRequest request =
        WatchMeshRequest.newBuilder().setName(name).setProgressOnly(true).build();
    client.follow(
        watching,
        stub -> stub.watchMesh(request),
        () -> {},
        event -> {
          if (event.hasProgress()) {
            onProgress.accept(event.getProgress());
          }
          return event.hasFinal();
        });
  }

  /** After a break it goes on from what the server has recorded. */
  private void sendAll() {
    Outage quiet = new Outage(client.patience, true); // the watch tells
    sending.addListener(context -> quiet.stop(), Runnable::run);
    try {
      long most = client.info().getMaxMessageBytes();
      PointsChunk first = PointsChunk.newBuilder().setMesh(name).build();
      while (true) {
        try {
          long rows = send(List.of(first).iterator()).getRows();
          ReconstructReply whole = send(cloud.chunks(name, rows, most));
          client.patience.reached |= whole.hasMesh();
          return;
        } catch (StatusRuntimeException error) {
          quiet.await(error);
        }
      }
    } catch (StellateException error) {
      if (error.kind() != StellateException.Kind.FAILED_PRECONDITION) {
        failure.set(error);
        watching.cancel(error);
      } // else it is over, and the watch says how it ended
    }
  }

  private ReconstructReply send(Iterator<PointsChunk> chunks) {
    PointsCall call = new PointsCall();
    sending.run(() -> client.stub.reconstruct(call));
    try {
      return call.send(chunks);
    } catch (InterruptedException error) {
      Thread.currentThread().interrupt();
      sending.cancel(error);
      throw Stellate.cancelled("is left, as the thread was interrupted");
    }
  }
}
