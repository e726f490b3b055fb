package stellate;

import com.google.protobuf.ByteString;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.security.MessageDigest;
import java.security.NoSuchAlgorithmException;
import java.util.Arrays;
import java.util.Iterator;
import java.util.NoSuchElementException;
import stellate.v1.Points;
import stellate.v1.PointsChunk;
import stellate.v1.PointsEnd;
import stellate.v1.Reconstruction;

/** Points on a k-manifold in R^d or near it: checked, and as they travel. */
final class Cloud {
  private static final int CHUNK_BYTES = 1 << 20; // where the server takes as much in a message

  private final int k;
  private final int d;
  private final double[] points;
  private final double[] tangents; // or null
  private final int count;

  Cloud(double[] points, int k, int d, double[] tangents) {
    if (k < 1 || d < 1) {
      throw StellateException.invalid(
          "dimensions have to be from 1 on, and are " + k + " and " + d);
    }
    if (points.length % d != 0) {
      throw StellateException.invalid(points.length + " numbers are no whole points of R^" + d);
    }
    for (int i = 0; i < points.length; i++) {
      if (!Double.isFinite(points[i])) {
        throw StellateException.invalid("point " + i / d + " is not finite");
      }
    }
    if (tangents != null && tangents.length != (long) k * points.length) {
      throw StellateException.invalid(
          "tangents have %d numbers, and need %d: [n, d, k]"
              .formatted(tangents.length, (long) k * points.length));
    }
    this.k = k;
    this.d = d;
    this.points = points;
    this.tangents = tangents;
    this.count = points.length / d;
  }

  Reconstruction spec(Reconstruction.Builder more) {
    return more.clone()
        .setDimension(k)
        .setAmbientDimension(d)
        .setPoints(count)
        .setTangents(tangents != null)
        .build();
  }

  /** The messages of an upload, from a point on. mostBytes: that the server takes in one. */
  Iterator<PointsChunk> chunks(String mesh, long first, long mostBytes) {
    int width = 8 * d * (tangents == null ? 1 : 1 + k);
    int rows = (int) Math.max(1, Math.min(CHUNK_BYTES, mostBytes / 2) / width);
    return new Iterator<>() {
      private boolean begun;
      private boolean ended;
      private long row = first;

      @Override
      public boolean hasNext() {
        return !ended;
      }

      @Override
      public PointsChunk next() {
        if (ended) {
          throw new NoSuchElementException();
        }
        PointsChunk.Builder chunk = PointsChunk.newBuilder();
        if (!begun) {
          begun = true;
          return chunk.setMesh(mesh).build();
        }
        if (row >= count) {
          ended = true;
          return chunk.setEnd(end()).build();
        }
        int from = (int) row;
        int to = (int) Math.min(count, row + rows);
        row = to;
        return chunk.setPoints(block(from, to)).build();
      }
    };
  }

  private Points block(int from, int to) {
    Points.Builder block = Points.newBuilder().setFirstRow(from);
    block.setPoints(Wire.toWire(Arrays.copyOfRange(points, from * d, to * d), to - from, d));
    if (tangents != null) {
      double[] bases = Arrays.copyOfRange(tangents, from * d * k, to * d * k);
      block.setTangents(Wire.toWire(bases, to - from, d, k));
    }
    return block.build();
  }

  private PointsEnd end() {
    PointsEnd.Builder end = PointsEnd.newBuilder().setPointsSha256(digest(points));
    if (tangents != null) {
      end.setTangentsSha256(digest(tangents));
    }
    return end.build();
  }

  /** Of the numbers as they travel. */
  private static ByteString digest(double[] values) {
    try {
      MessageDigest all = MessageDigest.getInstance("SHA-256");
      ByteBuffer bytes = ByteBuffer.allocate(8 * 4096).order(ByteOrder.LITTLE_ENDIAN);
      for (double value : values) {
        if (!bytes.hasRemaining()) {
          all.update(bytes.flip());
          bytes.clear();
        }
        bytes.putDouble(value);
      }
      all.update(bytes.flip());
      return ByteString.copyFrom(all.digest());
    } catch (NoSuchAlgorithmException error) {
      throw new IllegalStateException(error); // every Java has it
    }
  }
}
