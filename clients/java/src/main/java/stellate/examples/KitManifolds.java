package stellate.examples;

import stellate.Oracle;
import stellate.ProductOfCircles;
import stellate.Torus;

/** The manifolds that `stellate conform` asks about. */
final class KitManifolds {
  static final Torus TORUS = new Torus(1, 0.4);

  private KitManifolds() {}

  /** What the kit calls name; null where it is not here. */
  static Oracle named(String name) {
    if (name.startsWith("circle:")) {
      return new Circle(Integer.parseInt(name.substring(7)));
    }
    return switch (name) {
      case "torus" -> TORUS;
      case "clifford" -> new ProductOfCircles(2);
      case "sphere" -> new Sphere();
      case "lune" -> new Surface.CutSphere(2);
      case "half" -> new Changed(KitManifolds::refuseLeft);
      case "raises" ->
          new Changed(
              (x, found) -> {
                throw new java.io.IOException("on purpose"); // of kind RAISED
              });
      case "slow" -> new Changed((x, found) -> Thread.sleep(2000));
      default -> null;
    };
  }

  private static void refuseLeft(double[] x, boolean[] found) {
    for (int i = 0; i < found.length; i++) {
      found[i] &= x[3 * i] >= 0;
    }
  }

  /** What is done to the answers of the torus. */
  interface Change {
    void to(double[] x, boolean[] found) throws Exception;
  }

  /** The torus, after something was done to its answers. */
  private static final class Changed extends Surface.OfTorus {
    private final Change change;

    Changed(Change change) {
      this.change = change;
    }

    @Override
    public void closestPoint(double[] x, double[] points, boolean[] found) throws Exception {
      super.closestPoint(x, points, found);
      change.to(x, found);
    }
  }

  /** The torus, with a seed in place of its box. */
  static final class Seeded extends Surface.OfTorus {
    @Override
    public double[] seeds() {
      return new double[] {1.4, 0, 0};
    }
  }

  /** The unit circle of the first two coordinates of R^d. */
  private record Circle(int ambientDimension) implements Oracle.WithTangents {
    @Override
    public int dimension() {
      return 1;
    }

    @Override
    public void closestPoint(double[] x, double[] points, boolean[] found) {
      for (int i = 0; i < x.length; i += ambientDimension) {
        double length = Math.hypot(x[i], x[i + 1]);
        points[i] = x[i] / length;
        points[i + 1] = x[i + 1] / length;
      }
    }

    @Override
    public void tangentBasis(double[] points, double[] bases) {
      for (int i = 0; i < points.length; i += ambientDimension) {
        bases[i] = -points[i + 1];
        bases[i + 1] = points[i];
      }
    }
  }

  /** The unit sphere with tangents; its sizes are 1 + z / 2. */
  private static final class Sphere extends Surface.Sphere implements Oracle.WithTangents {
    @Override
    public void tangentBasis(double[] points, double[] bases) {
      tangentsOfSphere(points, bases);
    }

    @Override
    public void localSize(double[] points, double[] sizes) {
      for (int i = 0; i < sizes.length; i++) {
        sizes[i] = 1 + points[3 * i + 2] / 2;
      }
    }
  }
}
