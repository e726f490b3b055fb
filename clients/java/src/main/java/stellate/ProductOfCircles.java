package stellate;

import java.util.Arrays;

/**
 * T^k as a product of unit circles in R^2k; for k = 2 the Clifford torus. It is flat.
 *
 * @param k how many circles
 */
public record ProductOfCircles(int k) implements Oracle.WithTangents {
  @Override
  public int dimension() {
    return k;
  }

  @Override
  public int ambientDimension() {
    return 2 * k;
  }

  @Override
  public boolean concurrent() {
    return true;
  }

  @Override
  public double[][] boundingBox() {
    double[][] box = new double[2][2 * k];
    Arrays.fill(box[0], -1.1);
    Arrays.fill(box[1], 1.1);
    return box;
  }

  @Override
  public void closestPoint(double[] x, double[] points, boolean[] found) {
    for (int i = 0; i < x.length; i += 2) {
      double length = Math.sqrt(x[i] * x[i] + x[i + 1] * x[i + 1]);
      if (!(length > 1e-12)) {
        found[i / (2 * k)] = false;
        continue;
      }
      points[i] = x[i] / length;
      points[i + 1] = x[i + 1] / length;
    }
  }

  @Override
  public void tangentBasis(double[] p, double[] bases) {
    for (int i = 0; i < p.length; i += 2) {
      int column = i / 2 % k;
      bases[i * k + column] = -p[i + 1];
      bases[(i + 1) * k + column] = p[i];
    }
  }
}
