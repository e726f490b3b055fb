package stellate;

import com.google.protobuf.ByteString;
import java.util.Arrays;
import java.util.concurrent.locks.ReentrantLock;
import stellate.v1.AnswerChunk;
import stellate.v1.OracleCapabilities;
import stellate.v1.QueryChunk;

/** An oracle as the server sees it: answers are checked, with clear words. */
final class CheckedOracle {
  final Oracle oracle;
  final int k;
  final int d;
  final int walls;
  private final ReentrantLock turn = new ReentrantLock();

  CheckedOracle(Oracle oracle) {
    this.oracle = oracle;
    k = oracle.dimension();
    d = oracle.ambientDimension();
    walls = oracle instanceof Oracle.WithWalls walled ? walled.walls() : 0;
    if (k < 1 || d < k || (d == k && walls == 0)) {
      throw StellateException.invalid(
          "dimension " + k + " in R^" + d + ": 1 <= k < d is needed, or k = d with walls");
    }
  }

  OracleCapabilities capabilities() {
    return OracleCapabilities.newBuilder()
        .setIntersectFlat(oracle instanceof Oracle.WithFlats)
        .setTangentBasis(oracle instanceof Oracle.WithTangents)
        .setLocalSize(oracle instanceof Oracle.WithSizes)
        .setConormals(walls > 0)
        .build();
  }

  /** The answers to one chunk. Throws whatever the oracle throws. */
  AnswerChunk answer(QueryChunk chunk) throws Exception {
    if (oracle.concurrent()) {
      return asked(chunk);
    }
    turn.lock();
    try {
      return asked(chunk);
    } finally {
      turn.unlock();
    }
  }

  private AnswerChunk asked(QueryChunk chunk) throws Exception {
    double[] x = Wire.numbers(chunk.getPoints(), -1, d);
    int n = x.length / d;
    double[] points = new double[x.length];
    boolean[] found = new boolean[n];
    Arrays.fill(found, true);
    switch (chunk.getKind()) {
      case QUERY_KIND_CLOSEST_POINT -> {
        if (chunk.getFaceCount() > 0) {
          ((Oracle.WithWalls) oracle).facePoint(x, face(chunk), points, found);
        } else {
          oracle.closestPoint(x, points, found);
        }
      }
      case QUERY_KIND_INTERSECT_FLAT -> {
        double[] bases = Wire.numbers(chunk.getBases(), n, d, k);
        double[] radii = Wire.numbers(chunk.getRadii(), n);
        ((Oracle.WithFlats) oracle).intersectFlat(x, bases, radii, points, found);
      }
      default ->
          throw new IllegalStateException(
              "the server asks a question of kind "
                  + chunk.getKindValue()
                  + ", unknown to this client");
    }
    int[] rows = java.util.stream.IntStream.range(0, n).filter(row -> found[row]).toArray();
    checkFinite("the answer", points, d, rows);
    AnswerChunk.Builder reply =
        AnswerChunk.newBuilder().setLease(chunk.getLease()).setPoints(Wire.toWire(points, n, d));
    if (rows.length < n) {
      byte[] flags = new byte[n];
      for (int row : rows) {
        flags[row] = 1;
      }
      reply.setFound(ByteString.copyFrom(flags));
    }
    if (chunk.getWantTangents()) {
      double[] anywhere = new double[d * k];
      for (int a = 0; a < k; a++) {
        anywhere[a * k + a] = 1;
      }
      Method ask = ((Oracle.WithTangents) oracle)::tangentBasis;
      reply.setTangents(Wire.toWire(atFound("tangentBasis", ask, points, rows, anywhere), n, d, k));
    }
    if (chunk.getWantSizes()) {
      Method ask = ((Oracle.WithSizes) oracle)::localSize;
      double[] anywhere = {1};
      reply.setSizes(Wire.toWire(atFound("localSize", ask, points, rows, anywhere), n));
    }
    if (chunk.getWantClearances()) {
      addWalls(reply, face(chunk), points, rows);
    }
    return reply.build();
  }

  private static int[] face(QueryChunk chunk) {
    return chunk.getFaceList().stream().mapToInt(Integer::intValue).toArray();
  }

  /** What the walls are at the points, and, on a face, its conormals. */
  private void addWalls(AnswerChunk.Builder reply, int[] face, double[] points, int[] rows)
      throws Exception {
    Oracle.WithWalls walled = (Oracle.WithWalls) oracle;
    int n = points.length / d;
    double[] values = atFound("clearances", walled::clearances, points, rows, new double[walls]);
    reply.setClearances(Wire.toWire(values, n, walls));
    if (face.length > 0) {
      Method ask = (on, normals) -> walled.conormals(on, face, normals);
      double[] anywhere = new double[face.length * d];
      double[] normals = atFound("conormals", ask, points, rows, anywhere);
      reply.setConormals(Wire.toWire(normals, n, face.length, d));
    }
  }

  @FunctionalInterface
  private interface Method {
    void fill(double[] points, double[] values) throws Exception;
  }

  /** What the method says of the points that were found, and `anywhere` for the others. */
  private double[] atFound(
      String name, Method method, double[] points, int[] rows, double[] anywhere) throws Exception {
    int n = points.length / d;
    int width = anywhere.length;
    double[] on = points;
    if (rows.length < n) {
      on = new double[rows.length * d];
      for (int i = 0; i < rows.length; i++) {
        System.arraycopy(points, rows[i] * d, on, i * d, d);
      }
    }
    double[] values = new double[rows.length * width];
    if (rows.length > 0) {
      method.fill(on, values);
    }
    checkFinite(name, values, width, java.util.stream.IntStream.range(0, rows.length).toArray());
    if (rows.length == n) {
      return values;
    }
    double[] spread = new double[n * width];
    for (int i = 0; i < n; i++) {
      System.arraycopy(anywhere, 0, spread, i * width, width);
    }
    for (int i = 0; i < rows.length; i++) {
      System.arraycopy(values, i * width, spread, rows[i] * width, width);
    }
    return spread;
  }

  private static void checkFinite(String what, double[] values, int width, int[] rows) {
    for (int row : rows) {
      for (int i = row * width; i < (row + 1) * width; i++) {
        if (!Double.isFinite(values[i])) {
          throw new StellateException(
              StellateException.Kind.ORACLE,
              "ORACLE_NOT_FINITE",
              what + " for point " + row + " of a batch is " + values[i]);
        }
      }
    }
  }
}
