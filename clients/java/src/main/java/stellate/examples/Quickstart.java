package stellate.examples;

import java.nio.file.Path;
import stellate.Mesh;
import stellate.Options;
import stellate.Oracle;
import stellate.ProgressBar;
import stellate.Stellate;

/**
 * Meshes a torus through an oracle of its own, and writes torus.obj and torus.txt. Arguments:
 * EPSILON OUTPUT_DIRECTORY, which may be left out. Exit status 0: certified.
 */
public final class Quickstart {
  private Quickstart() {}

  private static final class Torus implements Oracle {
    @Override
    public int dimension() {
      return 2;
    }

    @Override
    public int ambientDimension() {
      return 3;
    }

    @Override
    public double[][] boundingBox() {
      return new double[][] {{-1.5, -1.5, -0.5}, {1.5, 1.5, 0.5}};
    }

    @Override
    public void closestPoint(double[] x, double[] p, boolean[] found) {
      for (int i = 0; i < x.length; i += 3) {
        double ring = Math.hypot(x[i], x[i + 1]);
        double tube = Math.hypot(ring - 1, x[i + 2]);
        double scale = (1 + 0.4 * (ring - 1) / tube) / ring;
        p[i] = x[i] * scale;
        p[i + 1] = x[i + 1] * scale;
        p[i + 2] = 0.4 * x[i + 2] / tube;
      }
    }
  }

  public static void main(String[] arguments) throws Exception {
    double epsilon = arguments.length > 0 ? Double.parseDouble(arguments[0]) : 0.1;
    Path folder = Path.of(arguments.length > 1 ? arguments[1] : ".");
    Options options = new Options();
    options.onProgress = new ProgressBar();
    Mesh mesh = Stellate.mesh(new Torus(), epsilon, options);
    System.out.print(mesh.report().orElseThrow().getText());
    mesh.save(folder.resolve("torus.obj"));
    mesh.save(folder.resolve("torus.txt"));
    System.exit(mesh.certified() ? 0 : 1);
  }
}
