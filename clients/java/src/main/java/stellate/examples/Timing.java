package stellate.examples;

import java.io.BufferedReader;
import java.io.InputStreamReader;
import java.nio.charset.StandardCharsets;
import stellate.Client;
import stellate.Credentials;
import stellate.Mesh;
import stellate.Options;
import stellate.Stellate;
import stellate.Torus;

/**
 * For every line "EPSILON" on standard input meshes the torus on the server that is named, and
 * prints "SECONDS VERTICES SIMPLICES".
 */
public final class Timing {
  private Timing() {}

  public static void main(String[] arguments) throws Exception {
    var in = new BufferedReader(new InputStreamReader(System.in, StandardCharsets.UTF_8));
    try (Client client = new Client(arguments[0], Credentials.NONE)) {
      for (String line = in.readLine(); line != null; line = in.readLine()) {
        long begin = System.nanoTime();
        double epsilon = Double.parseDouble(line.strip());
        Mesh mesh = Stellate.mesh(new Torus(1, 0.4), epsilon, Options.on(client));
        double seconds = (System.nanoTime() - begin) / 1e9;
        System.out.println(seconds + " " + mesh.vertexCount() + " " + mesh.simplexCount());
      }
    }
  }
}
