package stellate;

import java.io.IOException;
import java.io.PrintWriter;
import java.math.BigDecimal;
import java.math.MathContext;
import java.math.RoundingMode;
import java.nio.file.Files;
import java.nio.file.Path;
import java.nio.file.StandardCopyOption;
import java.util.Arrays;
import java.util.List;
import java.util.Optional;
import stellate.v1.Progress;
import stellate.v1.Report;

/** A simplicial k-complex in R^d, finished or growing. */
public final class Mesh {
  /** k */
  public final int dimension;

  /** d */
  public final int ambientDimension;

  /** [n, d], one point after the other. */
  public final double[] points;

  /** [m, k+1], zero-based, ascending in each row, rows in lexicographic order. */
  public final int[] simplices;

  /** [n], as bits the walls that each vertex lies on; null without a boundary. */
  public final long[] walls;

  /** One for each round that changed the mesh. */
  public final long revision;

  private final Progress progress;
  private final Report report;
  private final byte[] turned; // the protocol's Orientation.turned; null: see orientedSimplices()
  private List<String> places;
  private double[] smoothed;

  Mesh(
      int k,
      int d,
      double[] points,
      int[] simplices,
      long[] walls,
      long revision,
      Progress now,
      Report end,
      byte[] turned) {
    this.dimension = k;
    this.ambientDimension = d;
    this.points = points;
    this.simplices = simplices;
    this.walls = walls;
    this.revision = revision;
    this.progress = now;
    this.report = end;
    this.turned = turned;
  }

  Mesh with(Progress now, Report end) {
    return new Mesh(
            dimension, ambientDimension, points, simplices, walls, revision, now, end, turned)
        .with(places, smoothed);
  }

  Mesh with(List<String> what, double[] where) {
    places = what;
    smoothed = where;
    return this;
  }

  /**
   * What became of each point of a reconstruction: "OK", or another Place of mesh.proto. Empty for
   * other meshes.
   */
  public Optional<List<String>> places() {
    return Optional.ofNullable(places);
  }

  /** [n, d], the positions that a reconstruction of noisy points was built on. */
  public Optional<double[]> smoothed() {
    return Optional.ofNullable(smoothed);
  }

  /** n */
  public int vertexCount() {
    return points.length / ambientDimension;
  }

  /** m */
  public int simplexCount() {
    return simplices.length / (dimension + 1);
  }

  /**
   * The (k-1)-faces that are in one simplex alone, [m, k], in lexicographic order; each lies on the
   * walls that all its vertices have in common.
   */
  public int[] boundary() {
    int k = dimension;
    int[] faces = new int[simplices.length * k];
    int at = 0;
    for (int row = 0; row < simplices.length; row += k + 1) {
      for (int left = row; left <= row + k; left++) {
        for (int i = row; i <= row + k; i++) {
          if (i != left) {
            faces[at++] = simplices[i];
          }
        }
      }
    }
    int[] order = Rows.sortedOrder(faces, k);
    int[] once = new int[faces.length];
    int kept = 0;
    for (int i = 0; i < order.length; ) {
      int first = i;
      while (i < order.length && Rows.same(faces, k, order[first], order[i])) {
        i++;
      }
      if (i == first + 1) {
        System.arraycopy(faces, order[first] * k, once, kept, k);
        kept += k;
      }
    }
    return Arrays.copyOf(once, kept);
  }

  /** How it stood at this revision. */
  public Optional<Progress> progress() {
    return Optional.ofNullable(progress);
  }

  /** How it ended and what is proved; empty while it grows. */
  public Optional<Report> report() {
    return Optional.ofNullable(report);
  }

  /** Whether the mesh is finished and proved good. */
  public boolean certified() {
    return report != null && report.getCertificate().getCertified();
  }

  /**
   * The simplices with the last two vertices of some exchanged so that neighbours agree, and the
   * normals of a hypersurface point outwards. The server tells it of meshes that are over. Empty if
   * the mesh is not orientable, and where that is not known: while it grows, and of a .txt file.
   */
  public Optional<int[]> orientedSimplices() {
    if (turned == null) {
      return Optional.empty();
    }
    int[] oriented = simplices.clone();
    for (int s = 0; s < simplexCount(); s++) {
      if (Rows.isSet(turned, s)) {
        int last = (s + 1) * (dimension + 1) - 1;
        oriented[last] = simplices[last - 1];
        oriented[last - 1] = simplices[last];
      }
    }
    return Optional.of(oriented);
  }

  /** Reads the .txt format back, to the last bit. */
  public static Mesh loadTxt(Path path) throws IOException {
    String[] words = Files.readString(path).strip().split("\\s+");
    int[] head = new int[4];
    for (int i = 0; i < 4 && i < words.length; i++) {
      head[i] = Integer.parseInt(words[i]);
    }
    int end = 4 + head[1] * head[2];
    if (words.length != end + (head[0] + 1) * head[3]) {
      throw new IOException(path + " does not have the numbers that its first line speaks of");
    }
    double[] points = Arrays.stream(words, 4, end).mapToDouble(Double::parseDouble).toArray();
    int[] rows = Arrays.stream(words, end, words.length).mapToInt(Integer::parseInt).toArray();
    return new Mesh(head[0], head[1], points, rows, null, 0, null, null, null);
  }

  /** Throws a StellateException of kind SAVE if a mesh of that kind cannot have the name. */
  public static void checkSave(Path path, int k, int d) {
    String name = path.toString();
    if (name.endsWith(".txt") || (name.endsWith(".obj") && k <= 2 && d <= 3)) {
      return;
    }
    throw new StellateException(
        StellateException.Kind.SAVE,
        "FORMAT",
        name.endsWith(".obj")
            ? ".obj holds curves and surfaces in the plane and in space: take .txt"
            : name + " has to end in .txt or .obj; stellate download writes the other formats");
  }

  /**
   * Writes .txt (any k and d, exact: "k d nv ns", coordinates, ids from zero) or .obj (curves and
   * surfaces, d at most 3, oriented as orientedSimplices() are). The file takes its name when it is
   * whole.
   */
  public void save(Path path) throws IOException {
    checkSave(path, dimension, ambientDimension);
    Path part = path.resolveSibling(path.getFileName() + ".part");
    try (PrintWriter out = new PrintWriter(Files.newBufferedWriter(part))) {
      if (path.toString().endsWith(".txt")) {
        out.printf("%d %d %d %d%n", dimension, ambientDimension, vertexCount(), simplexCount());
        writePoints(out, "", "");
        writeRows(out, "", simplices, 0);
      } else {
        writePoints(out, "v ", " 0".repeat(3 - ambientDimension));
        writeRows(out, dimension == 1 ? "l " : "f ", orientedSimplices().orElse(simplices), 1);
      }
      if (out.checkError()) {
        throw new IOException(part + " cannot be written to its end");
      }
    }
    Files.move(part, path, StandardCopyOption.REPLACE_EXISTING);
  }

  private void writePoints(PrintWriter out, String before, String after) {
    for (int i = 0; i < points.length; i++) {
      out.print(i % ambientDimension == 0 ? before : " ");
      out.print(exact(points[i]));
      if ((i + 1) % ambientDimension == 0) {
        out.print(after + "\n");
      }
    }
  }

  /** C's %.17g: the same text from all clients, which comes back to the same double. */
  private static String exact(double value) {
    if (value == 0) {
      return 1 / value < 0 ? "-0" : "0";
    }
    BigDecimal rounded = new BigDecimal(value).round(new MathContext(17, RoundingMode.HALF_EVEN));
    rounded = rounded.stripTrailingZeros();
    int exponent = rounded.precision() - rounded.scale() - 1;
    if (exponent >= -4 && exponent < 17) {
      return rounded.toPlainString();
    }
    String digits = rounded.movePointLeft(exponent).toPlainString();
    return digits + (exponent < 0 ? "e-" : "e+") + "%02d".formatted(Math.abs(exponent));
  }

  private void writeRows(PrintWriter out, String before, int[] rows, int first) {
    for (int i = 0; i < rows.length; i++) {
      out.print(i % (dimension + 1) == 0 ? before : " ");
      out.print(rows[i] + first);
      if ((i + 1) % (dimension + 1) == 0) {
        out.print("\n");
      }
    }
  }
}
