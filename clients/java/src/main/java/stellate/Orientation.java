package stellate;

import java.util.ArrayList;
import java.util.Arrays;
import java.util.List;
import java.util.Optional;

/** Turning the simplices of a complex to agree with their neighbours. */
final class Orientation {
  private Orientation() {}

  /**
   * The same simplices, some with their last two vertices exchanged, so that neighbours induce
   * opposite orientations on the facet they share; the first of each component stays, but that
   * those of a hypersurface are turned as a whole where their normals point inwards. Empty if that
   * cannot be: the complex is not orientable, or a facet is in more than two simplices. Rows have
   * to be ascending.
   */
  static Optional<int[]> orient(int[] simplices, int width, double[] points, int d) {
    int[] other = facing(simplices, width);
    if (other == null) {
      return Optional.empty();
    }
    int[] turned = new int[simplices.length / width]; // 0: not seen, 1: as it is, -1: turned
    int[] oriented = simplices.clone();
    List<Integer> component = new ArrayList<>();
    for (int start = 0; start < turned.length; start++) {
      if (turned[start] != 0) {
        continue;
      }
      turned[start] = 1;
      component.clear();
      component.add(start);
      for (int at = 0; at < component.size(); at++) {
        int s = component.get(at);
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
            component.add(neighbour);
          }
        }
      }
      double volume = 0; // (k+1)! times those of the cones from the origin
      for (int s : component) {
        if (turned[s] < 0) {
          exchange(oriented, (s + 1) * width);
        }
        if (width == d) {
          double[][] corners = new double[d][];
          for (int i = 0; i < d; i++) {
            int at = oriented[s * width + i] * d;
            corners[i] = Arrays.copyOfRange(points, at, at + d);
          }
          volume += determinant(corners);
        }
      }
      if (volume < 0) {
        component.forEach(s -> exchange(oriented, (s + 1) * width));
      }
    }
    return Optional.of(oriented);
  }

  private static void exchange(int[] rows, int end) {
    int last = rows[end - 1];
    rows[end - 1] = rows[end - 2];
    rows[end - 2] = last;
  }

  private static double determinant(double[][] rows) {
    if (rows.length == 1) {
      return rows[0][0];
    }
    double sum = 0;
    for (int i = 0; i < rows.length; i++) {
      double[][] minor = new double[rows.length - 1][];
      for (int j = 0; j < minor.length; j++) {
        double[] other = rows[j < i ? j : j + 1];
        minor[j] = Arrays.copyOfRange(other, 1, other.length);
      }
      sum += (i % 2 == 0 ? 1 : -1) * rows[i][0] * determinant(minor);
    }
    return sum;
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
