package stellate;

import java.util.concurrent.CompletableFuture;
import java.util.function.Consumer;
import stellate.v1.Progress;
import stellate.v1.Reconstruction;

/** What is asked of a mesh of points beside the points, and how it is made. */
public final class ReconstructOptions {
  /** Where: a connection that there is; null: a server is started, and stopped afterwards. */
  public Client client;

  /**
   * [n, d, k], of each point orthonormal tangent vectors, its columns; null: they are estimated.
   */
  public double[] tangents;

  /** The rest: noise, declared_reach, drop, open, label...; mesh.proto says what each means. */
  public final Reconstruction.Builder spec = Reconstruction.newBuilder();

  /** A mesh that is not proved good is an exception of kind NOT_CERTIFIED. */
  public boolean requireCertified;

  /** Called on the thread that waits for the mesh. */
  public Consumer<Progress> onProgress = progress -> {};

  /** Once it is complete the mesh is cancelled: an exception of kind CANCELLED. */
  public CompletableFuture<?> cancel = new CompletableFuture<Void>();

  /** With a connection. */
  public static ReconstructOptions on(Client client) {
    ReconstructOptions options = new ReconstructOptions();
    options.client = client;
    return options;
  }
}
