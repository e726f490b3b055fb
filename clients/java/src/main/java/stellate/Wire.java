package stellate;

import com.google.protobuf.ByteString;
import com.google.protobuf.UnsafeByteOperations;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.util.List;
import stellate.v1.Array;
import stellate.v1.IndexArray;

/** Arrays as they travel. */
final class Wire {
  private Wire() {}

  /** The numbers of an array of that shape, -1 standing for any extent; absent: no rows. */
  static double[] numbers(Array array, int... shape) {
    double[] values = new double[checked(array.getShapeList(), array.getData(), 8, shape)];
    little(array.getData()).asDoubleBuffer().get(values);
    return values;
  }

  static int[] indices(IndexArray array, int... shape) {
    int[] values = new int[checked(array.getShapeList(), array.getData(), 4, shape)];
    little(array.getData()).asIntBuffer().get(values);
    return values;
  }

  static Array toWire(double[] values, int... shape) {
    ByteBuffer bytes = ByteBuffer.allocate(8 * values.length).order(ByteOrder.LITTLE_ENDIAN);
    bytes.asDoubleBuffer().put(values);
    Array.Builder array = Array.newBuilder().setData(UnsafeByteOperations.unsafeWrap(bytes));
    for (int extent : shape) {
      array.addShape(extent);
    }
    return array.build();
  }

  private static ByteBuffer little(ByteString data) {
    return data.asReadOnlyByteBuffer().order(ByteOrder.LITTLE_ENDIAN);
  }

  private static int checked(List<Integer> given, ByteString data, int width, int[] shape) {
    if (given.isEmpty() && data.isEmpty() && shape[0] <= 0) {
      return 0;
    }
    boolean fits = given.size() == shape.length;
    long count = 1;
    for (int i = 0; fits && i < shape.length; i++) {
      fits = shape[i] < 0 || given.get(i) == shape[i];
      count *= Integer.toUnsignedLong(given.get(i));
    }
    if (!fits || data.size() != count * width) {
      throw StellateException.protocol(
          "an array of shape %s and %d bytes came, not one of shape %s"
              .formatted(given, data.size(), java.util.Arrays.toString(shape)));
    }
    return (int) count;
  }
}
