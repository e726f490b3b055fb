package stellate.examples;

import stellate.Oracle;

/** A surface in space. */
public abstract class Surface implements Oracle {
  @Override
  public final int dimension() {
    return 2;
  }

  @Override
  public final int ambientDimension() {
    return 3;
  }

  /** What the torus answers, for others to change. */
  public abstract static class OfTorus extends Surface implements Oracle.WithTangents {
    @Override
    public void closestPoint(double[] x, double[] points, boolean[] found) throws Exception {
      KitManifolds.TORUS.closestPoint(x, points, found);
    }

    @Override
    public void tangentBasis(double[] points, double[] bases) {
      KitManifolds.TORUS.tangentBasis(points, bases);
    }
  }

  /** The unit sphere, which meets lines. */
  public abstract static class Sphere extends Surface
      implements Oracle.WithFlats, Oracle.WithSizes {
    @Override
    public void closestPoint(double[] x, double[] points, boolean[] found) {
      for (int i = 0; i < x.length; i += 3) {
        double length = Math.sqrt(dot(x, i, x, i));
        found[i / 3] = length > 1e-9;
        for (int j = i; j < i + 3; j++) {
          points[j] = x[j] / length;
        }
      }
    }

    @Override
    public void intersectFlat(
        double[] centers, double[] bases, double[] radii, double[] points, boolean[] found) {
      for (int i = 0; i < found.length; i++) {
        // The flat is the line along t0 x t1 through c: |c + step along| = 1.
        int c = 3 * i;
        int b = 6 * i;
        double[] along = {
          bases[b + 2] * bases[b + 5] - bases[b + 4] * bases[b + 3],
          bases[b + 4] * bases[b + 1] - bases[b] * bases[b + 5],
          bases[b] * bases[b + 3] - bases[b + 2] * bases[b + 1]
        };
        double middle = dot(along, 0, centers, c);
        double root = middle * middle - dot(centers, c, centers, c) + 1;
        double step = Math.copySign(Math.sqrt(Math.max(root, 0)), middle) - middle;
        found[i] = root >= 0 && Math.abs(step) <= radii[i];
        for (int j = 0; j < 3; j++) {
          points[c + j] = centers[c + j] + step * along[j];
        }
      }
    }

    private static double dot(double[] a, int i, double[] b, int j) {
      return a[i] * b[j] + a[i + 1] * b[j + 1] + a[i + 2] * b[j + 2];
    }
  }
}
