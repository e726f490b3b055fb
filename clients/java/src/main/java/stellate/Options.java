package stellate;

import java.nio.file.Path;
import java.util.concurrent.CompletableFuture;
import java.util.function.Consumer;
import stellate.v1.BoundingBox;
import stellate.v1.Criteria;
import stellate.v1.MeshLimits;
import stellate.v1.MeshSpec;
import stellate.v1.Progress;

/** What is asked of a mesh beside its oracle and epsilon, and how it is made. */
public final class Options {
  /** Where: a connection that there is; null: a server is started, and stopped afterwards. */
  public Client client;

  /** The refinement rules, with size_rate and max_deviation; mesh.proto says what each means. */
  public final Criteria.Builder criteria = Criteria.newBuilder();

  /** Budgets and times. */
  public final MeshLimits.Builder limits = MeshLimits.newBuilder();

  /** The rest of the specification: label, seed, declared reach, audit... */
  public final MeshSpec.Builder spec = MeshSpec.newBuilder();

  /** Streams that call the oracle in parallel, each on a thread of its own. */
  public int workers = 1;

  /** Most points in one call of the oracle; 0: the server decides. */
  public int maxChunk;

  /** A mesh that is not proved good is an exception of kind NOT_CERTIFIED. */
  public boolean requireCertified;

  /**
   * A directory, made if it is not there, in which the mesh outlives this program: the same call
   * goes on from where the last one was cancelled or killed, or its oracle threw, and gives a mesh
   * that is finished immediately. For servers that are started; others keep meshes with --data-dir.
   */
  public Path checkpoint;

  /** Called on the thread that meshes. */
  public Consumer<Progress> onProgress = progress -> {};

  /** Once it is complete the mesh is cancelled: an exception of kind CANCELLED, with the mesh. */
  public CompletableFuture<?> cancel = new CompletableFuture<Void>();

  /** With a connection. */
  public static Options on(Client client) {
    Options options = new Options();
    options.client = client;
    return options;
  }

  MeshSpec specOf(CheckedOracle checked, double epsilon, boolean far) {
    MeshSpec.Builder all =
        spec.clone()
            .setDimension(checked.k)
            .setAmbientDimension(checked.d)
            .setEpsilon(epsilon)
            .setOracle(checked.capabilities())
            .setWalls(checked.walls);
    Criteria.Builder rules = criteria.clone();
    if (far && !rules.hasSpeculative()) {
      rules.setSpeculative(true); // round trips are what a far server costs
    }
    double[][] box = checked.oracle.boundingBox();
    if (box != null) {
      all.setBoundingBox(
          BoundingBox.newBuilder()
              .setLower(Wire.toWire(box[0], box[0].length))
              .setUpper(Wire.toWire(box[1], box[1].length)));
    }
    double[] seeds = checked.oracle.seeds();
    if (seeds != null) {
      all.setSeeds(Wire.toWire(seeds, seeds.length / checked.d, checked.d));
    }
    return all.setCriteria(rules).setLimits(limits).build();
  }
}
