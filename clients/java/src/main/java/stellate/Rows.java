package stellate;

import java.util.Arrays;

/** Rows of vertex numbers, [m, width] one after the other, in lexicographic order. */
final class Rows {
  private Rows() {}

  /** The order that sorts the rows; equal rows keep theirs. One counting sort a column. */
  static int[] sortedOrder(int[] rows, int width) {
    int count = rows.length / width;
    int[] order = new int[count];
    Arrays.setAll(order, i -> i);
    int[] next = new int[count];
    int most = Arrays.stream(rows).max().orElse(0);
    for (int column = width - 1; column >= 0; column--) {
      int[] start = new int[most + 2];
      for (int i = column; i < rows.length; i += width) {
        start[rows[i] + 1]++;
      }
      for (int id = 0; id < most; id++) {
        start[id + 1] += start[id];
      }
      for (int row : order) {
        next[start[rows[row * width + column]]++] = row;
      }
      int[] done = order;
      order = next;
      next = done;
    }
    return order;
  }

  static boolean same(int[] rows, int width, int a, int b) {
    return Arrays.equals(rows, a * width, (a + 1) * width, rows, b * width, (b + 1) * width);
  }

  static int bytesOfBits(int count) {
    return (count + 7) / 8;
  }

  /** Whether bit i is set, eight in a byte, the first in the lowest. */
  static boolean isSet(byte[] bits, int i) {
    return (bits[i / 8] >> (i % 8) & 1) == 1;
  }

  /** By a bit which of the rows, that are in order, are among the chosen ones, in any order. */
  static byte[] bitsOf(int[] rows, int[] chosen, int width) {
    byte[] bits = new byte[bytesOfBits(rows.length / width)];
    int[] order = sortedOrder(chosen, width);
    int next = 0;
    for (int s = 0; s < rows.length / width && next < order.length; s++) {
      int begin = order[next] * width;
      if (Arrays.equals(rows, s * width, (s + 1) * width, chosen, begin, begin + width)) {
        bits[s / 8] |= (byte) (1 << (s % 8));
        next++;
      }
    }
    return bits;
  }
}
