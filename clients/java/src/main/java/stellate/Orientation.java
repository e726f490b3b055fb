package stellate;

import java.util.ArrayDeque;
import java.util.Arrays;
import java.util.Deque;
import java.util.Optional;

/** Turning the simplices of a complex to agree with their neighbours. */
final class Orientation {
  private Orientation() {}

  /**
   * The same simplices, some with their first two vertices exchanged, so that neighbours induce
   * opposite orientations on the facet they share. Empty if that cannot be: the complex is not
   * orientable, or a facet is in more than two simplices. Rows have to be ascending.
   */
  static Optional<int[]> orient(int[] simplices, int width) {
    int[] other = facing(simplices, width);
    if (other == null) {
      return Optional.empty();
    }
    int[] turned = new int[simplices.length / width]; // 0: not seen, 1: as it is, -1: turned
    Deque<Integer> front = new ArrayDeque<>();
    for (int start = 0; start < turned.length; start++) {
      if (turned[start] != 0) {
        continue;
      }
      turned[start] = 1;
      front.push(start);
      while (!front.isEmpty()) {
        int s = front.pop();
        for (int i = 0; i < width; i++) {
          int facet = other[s * width + i];
          if (facet < 0) {
            continue;
          }
          int neighbour = facet / width;
          // Facets without vertices of like parity have like orientations.
          int wanted = (i - facet % width) % 2 == 0 ? -turned[s] : turned[s];
          if (turned[neighbour] == -wanted) {
            return Optional.empty();
          }
          if (turned[neighbour] == 0) {
            turned[neighbour] = wanted;
            front.push(neighbour);
          }
        }
      }
    }
    int[] oriented = simplices.clone();
    for (int s = 0; s < turned.length; s++) {
      if (turned[s] < 0) {
        oriented[s * width] = simplices[s * width + 1];
        oriented[s * width + 1] = simplices[s * width];
      }
    }
    return Optional.of(oriented);
  }

  /**
   * For each facet the equal one of another simplex, or -1: facet f is that of simplex f / width
   * without its vertex f % width. Null if three are equal.
   */
  private static int[] facing(int[] simplices, int width) {
    int[] facets = new int[simplices.length * (width - 1)];
    int at = 0;
    for (int s = 0; s < simplices.length; s += width) {
      for (int left = 0; left < width; left++) {
        for (int i = 0; i < width; i++) {
          if (i != left) {
            facets[at++] = simplices[s + i];
          }
        }
      }
    }
    int[] other = new int[simplices.length];
    Arrays.fill(other, -1);
    int[] order = Rows.sortedOrder(facets, width - 1);
    for (int i = 1; i < order.length; i++) {
      if (!Rows.same(facets, width - 1, order[i - 1], order[i])) {
        continue;
      }
      if (other[order[i - 1]] >= 0) {
        return null;
      }
      other[order[i]] = order[i - 1];
      other[order[i - 1]] = order[i];
    }
    return other;
  }
}
