package stellate;

import com.google.protobuf.ByteString;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.List;
import stellate.v1.DeltaChunk;
import stellate.v1.MeshDelta;
import stellate.v1.Orientation;
import stellate.v1.Place;
import stellate.v1.Places;

/**
 * The client's copy of a mesh that grows by deltas: vertices and simplices as of the last complete
 * revision. What comes and goes is put aside, and settled for many revisions together. A delta that
 * does not fit what came before is a StellateException with the reason PROTOCOL.
 */
public final class Growth {
  private static final int UNSETTLED = 300_000; // vertex numbers of removed simplices at least

  private final int k;
  private final int d;
  private long revision;
  private int count;
  private double[] coordinates = new double[1024];
  private long[] walls; // bits, of the vertices up to the last on a wall; null: there is none
  private int[] rows = {}; // in lexicographic order
  private final List<int[]> added = new ArrayList<>();
  private final List<int[]> removed = new ArrayList<>();
  private int removedLength;
  private final List<MeshDelta> pending = new ArrayList<>();
  private ByteString turned; // the orientation of the last revision; null: not known
  private final List<int[]> turnedRows = new ArrayList<>(); // of a download
  private boolean untold; // a part of the download was not oriented
  private final List<String> places = new ArrayList<>(); // of a download of a reconstruction
  private final List<double[]> smoothed = new ArrayList<>();

  /** The empty k-complex in R^d. */
  public Growth(int k, int d) {
    this.k = k;
    this.d = d;
  }

  /** Takes one chunk; true when a revision is complete with it. */
  public boolean absorb(DeltaChunk chunk) {
    long next = chunk.getDelta().getRevision();
    if (next <= revision || (!pending.isEmpty() && pending.get(0).getRevision() != next)) {
      throw StellateException.protocol("revision " + next + " is out of order");
    }
    turned = null;
    pending.add(chunk.getDelta());
    if (!chunk.getComplete()) {
      return false;
    }
    List<MeshDelta> whole = List.copyOf(pending);
    pending.clear();
    for (MeshDelta part : whole) {
      addPoints(part.getFirstVertex(), Wire.numbers(part.getPoints(), -1, d));
    }
    whole.forEach(this::change);
    revision = next;
    if (removedLength > Math.max(UNSETTLED, rows.length / 2)) {
      settle();
    }
    return true;
  }

  /** Takes a chunk of the orientation, which comes after the last revision. */
  public void orient(Orientation chunk) {
    ByteString before = chunk.getFirstSimplex() == 0 ? ByteString.EMPTY : turned;
    turned = null;
    if (!chunk.getOrientable()) {
      return;
    }
    if (before == null || chunk.getFirstSimplex() != 8L * before.size()) {
      throw StellateException.protocol(
          "the orientation of simplex " + chunk.getFirstSimplex() + " is out of order");
    }
    turned = before.concat(chunk.getTurned());
  }

  /** Notes which of the simplices that change() has just taken are turned. */
  void orientPart(Orientation told) {
    int[] cells = added.get(added.size() - 1);
    if (!told.getOrientable()) {
      untold |= cells.length > 0;
      return;
    }
    int width = k + 1;
    checkBits(told.getTurned(), cells.length / width);
    byte[] bits = told.getTurned().toByteArray();
    for (int s = 0; s < cells.length / width; s++) {
      if (Rows.isSet(bits, s)) {
        turnedRows.add(Arrays.copyOfRange(cells, s * width, (s + 1) * width));
      }
    }
  }

  /** Notes what became of the points of a part of a download. */
  void addPlaces(Places part) {
    for (byte code : part.getCodes()) {
      Place place = Place.forNumber(code);
      places.add(place == null ? "" + code : place.name().substring("PLACE_".length()));
    }
    if (part.hasSmoothed()) {
      smoothed.add(Wire.numbers(part.getSmoothed(), part.getCodes().size(), d));
    }
  }

  private static void checkBits(ByteString bits, int count) {
    if (bits.size() != Rows.bytesOfBits(count)) {
      throw StellateException.protocol(
          "an orientation of %d bytes came for %d simplices".formatted(bits.size(), count));
    }
  }

  /** The mesh at its end, with its orientation. */
  public Mesh finished() {
    settle();
    if (turned != null) {
      checkBits(turned, rows.length / (k + 1));
    }
    return mesh(turned == null ? null : turned.toByteArray());
  }

  /** The mesh of a download that is complete. */
  Mesh downloaded() {
    settle();
    int[] chosen = turnedRows.stream().flatMapToInt(Arrays::stream).toArray();
    Mesh mesh = mesh(untold ? null : Rows.bitsOf(rows, chosen, k + 1));
    double[] positions = smoothed.stream().flatMapToDouble(Arrays::stream).toArray();
    return mesh.with(
        places.size() == count ? List.copyOf(places) : null,
        count > 0 && positions.length == count * d ? positions : null);
  }

  /** Drops the chunks of a revision that was cut short: it will be sent again. */
  public void forgetPending() {
    pending.clear();
  }

  /** Back to the empty mesh. */
  public void reset() {
    revision = 0;
    count = 0;
    removedLength = 0;
    coordinates = new double[1024];
    walls = null;
    turned = null;
    rows = new int[0];
    added.clear();
    removed.clear();
    pending.clear();
  }

  void addPoints(long first, double[] block) {
    if (block.length > 0 && first != count) {
      throw StellateException.protocol(
          "a delta starts at vertex " + first + ", and there are " + count);
    }
    int end = count * d + block.length;
    if (end > coordinates.length) {
      coordinates = Arrays.copyOf(coordinates, Math.max(end, 2 * coordinates.length));
    }
    System.arraycopy(block, 0, coordinates, count * d, block.length);
    count = end / d;
  }

  void change(MeshDelta delta) {
    addWalls(delta.getBoundaryVerticesList(), delta.getBoundaryWallsList());
    int[] comes = Wire.indices(delta.getAdded(), -1, k + 1);
    int[] goes = Wire.indices(delta.getRemoved(), -1, k + 1);
    for (int id : comes) {
      if (Integer.compareUnsigned(id, count) >= 0) {
        throw StellateException.protocol(
            "a simplex has vertex %s of %d vertices"
                .formatted(Integer.toUnsignedString(id), count));
      }
    }
    for (int id : goes) {
      if (Integer.compareUnsigned(id, count) >= 0) {
        throw StellateException.protocol("a delta removes simplices that are not there");
      }
    }
    added.add(comes);
    removed.add(goes);
    removedLength += goes.length;
  }

  /** Which of the vertices lie on which walls. */
  private void addWalls(List<Integer> vertices, List<Long> of) {
    int on = vertices.size();
    if (on != of.size() || (on > 0 && Integer.compareUnsigned(vertices.get(on - 1), count) >= 0)) {
      throw StellateException.protocol(
          "walls of %d vertices do not fit the %d that there are".formatted(on, count));
    }
    if (on > 0) {
      walls = walls == null ? new long[count] : Arrays.copyOf(walls, count);
    }
    for (int i = 0; i < on; i++) {
      walls[vertices.get(i)] = of.get(i);
    }
  }

  /** Makes mesh() cheap. */
  public void settle() {
    if (added.isEmpty() && removed.isEmpty()) {
      return;
    }
    int width = k + 1;
    int length = rows.length + added.stream().mapToInt(block -> block.length).sum();
    int firstRemoved = length / width;
    int[] all = Arrays.copyOf(rows, length + removedLength);
    int at = rows.length;
    for (List<int[]> blocks : List.of(added, removed)) {
      for (int[] block : blocks) {
        System.arraycopy(block, 0, all, at, block.length);
        at += block.length;
      }
    }
    int[] order = Rows.sortedOrder(all, width);
    int[] left = new int[length];
    int kept = 0;
    for (int i = 0; i < order.length; ) {
      int row = order[i];
      int there = 0;
      for (; i < order.length && Rows.same(all, width, row, order[i]); i++) {
        there += order[i] < firstRemoved ? 1 : -1;
      }
      if (there < 0) {
        throw StellateException.protocol("a delta removes simplices that are not there");
      }
      if (there > 1) {
        throw StellateException.protocol("a delta adds simplices that are there already");
      }
      if (there == 1) {
        System.arraycopy(all, row * width, left, kept, width);
        kept += width;
      }
    }
    rows = Arrays.copyOf(left, kept);
    added.clear();
    removed.clear();
    removedLength = 0;
  }

  /** The last complete one. */
  public long revision() {
    return revision;
  }

  void revision(long now) {
    revision = now;
  }

  /** The mesh as of the last complete revision. */
  public Mesh mesh() {
    settle();
    return mesh(null);
  }

  private Mesh mesh(byte[] orientation) {
    long[] bits = walls == null ? null : Arrays.copyOf(walls, count);
    double[] points = Arrays.copyOf(coordinates, count * d);
    return new Mesh(k, d, points, rows, bits, revision, null, null, orientation);
  }
}
