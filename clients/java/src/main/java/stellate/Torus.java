package stellate;

/**
 * The torus around a circle: k = 2, d = 3.
 *
 * @param major the circle's radius
 * @param minor the tube's
 */
public record Torus(double major, double minor) implements Oracle.WithTangents {
  @Override
  public int dimension() {
    return 2;
  }

  @Override
  public int ambientDimension() {
    return 3;
  }

  @Override
  public boolean concurrent() {
    return true;
  }

  @Override
  public double[][] boundingBox() {
    double across = 1.1 * (major + minor);
    double up = 1.1 * minor;
    return new double[][] {{-across, -across, -up}, {across, across, up}};
  }

  @Override
  public void closestPoint(double[] x, double[] points, boolean[] found) {
    for (int i = 0; i < x.length; i += 3) {
      double ring = Math.sqrt(x[i] * x[i] + x[i + 1] * x[i + 1]);
      double off = ring - major;
      double tube = Math.sqrt(off * off + x[i + 2] * x[i + 2]);
      found[i / 3] = ring > 1e-12 && tube > 1e-12;
      if (found[i / 3]) {
        double scale = (major + minor * off / tube) / ring;
        points[i] = x[i] * scale;
        points[i + 1] = x[i + 1] * scale;
        points[i + 2] = minor * x[i + 2] / tube;
      }
    }
  }

  @Override
  public void tangentBasis(double[] p, double[] bases) {
    for (int i = 0; i < p.length; i += 3) {
      double ring = Math.sqrt(p[i] * p[i] + p[i + 1] * p[i + 1]);
      double c = p[i] / ring;
      double s = p[i + 1] / ring;
      double out = (ring - major) / minor;
      double up = p[i + 2] / minor;
      double[] basis = {-s, -c * up, c, -s * up, 0, out};
      System.arraycopy(basis, 0, bases, 2 * i, 6);
    }
  }
}
