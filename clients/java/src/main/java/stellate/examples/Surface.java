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
      normalise(x, points, found);
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
  }

  /** The part of the unit sphere above one wall, z = 0, or between two, z = 0 and y = 0. */
  public static final class CutSphere extends Surface implements Oracle.WithWalls {
    private final int walls;

    public CutSphere(int walls) {
      this.walls = walls;
    }

    @Override
    public int walls() {
      return walls;
    }

    @Override
    public double[][] boundingBox() {
      return new double[][] {{-1.1, -1.1, -1.1}, {1.1, 1.1, 1.1}};
    }

    @Override
    public void closestPoint(double[] x, double[] points, boolean[] found) {
      normalise(x, points, found);
    }

    @Override
    public void tangentBasis(double[] points, double[] bases) {
      tangentsOfSphere(points, bases);
    }

    @Override
    public void facePoint(double[] x, int[] face, double[] points, boolean[] found) {
      double[] flat = x.clone();
      for (int wall : face) {
        for (int i = axis(wall); i < flat.length; i += 3) {
          flat[i] = 0;
        }
      }
      normalise(flat, points, found);
    }

    @Override
    public void clearances(double[] points, double[] values) {
      for (int i = 0; i < values.length; i++) {
        values[i] = points[3 * (i / walls) + axis(i % walls)];
      }
    }

    @Override
    public void conormals(double[] points, int[] face, double[] normals) {
      for (int i = 0; 3 * i < normals.length; i++) {
        normals[3 * i + axis(face[i % face.length])] = -1;
      }
    }

    private static int axis(int wall) {
      return 2 - wall;
    }
  }

  /** Orthonormal bases, [n, 3, 2], at points of the unit sphere. */
  static void tangentsOfSphere(double[] points, double[] bases) {
    for (int i = 0; i < points.length; i += 3) {
      double x = points[i];
      double y = points[i + 1];
      double s = Math.copySign(1, points[i + 2]);
      double a = -1 / (s + points[i + 2]);
      double b = x * y * a;
      double[] basis = {1 + s * x * x * a, b, s * b, s + y * y * a, -s * x, -y};
      System.arraycopy(basis, 0, bases, 2 * i, 6);
    }
  }

  private static void normalise(double[] x, double[] points, boolean[] found) {
    for (int i = 0; i < x.length; i += 3) {
      double length = Math.sqrt(dot(x, i, x, i));
      found[i / 3] = length > 1e-9;
      for (int j = i; j < i + 3; j++) {
        points[j] = x[j] / length;
      }
    }
  }

  private static double dot(double[] a, int i, double[] b, int j) {
    return a[i] * b[j] + a[i + 1] * b[j + 1] + a[i + 2] * b[j + 2];
  }
}
