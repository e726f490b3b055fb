package stellate.examples;

import java.io.BufferedReader;
import java.io.InputStreamReader;
import java.nio.charset.StandardCharsets;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import stellate.Client;
import stellate.Credentials;
import stellate.Mesh;
import stellate.Options;
import stellate.Stellate;
import stellate.StellateException;
import stellate.Torus;
import stellate.v1.Report;

/** Obeys tests/languages/conform.py: see there. */
public final class Conform {
  private Conform() {}

  public static void main(String[] arguments) throws Exception {
    var in = new BufferedReader(new InputStreamReader(System.in, StandardCharsets.UTF_8));
    try (Client client = new Client(arguments[0], Credentials.NONE).onOutage(said -> {})) {
      for (String line = in.readLine(); line != null; line = in.readLine()) {
        System.out.println(obey(client, line.split(" ")));
      }
    }
  }

  private static String obey(Client client, String[] words) throws Exception {
    List<Mesh> all = new ArrayList<>();
    try {
      if (words[0].equals("save")) {
        Mesh.loadTxt(Path.of(words[1])).save(Path.of(words[2]));
        return "saved";
      }
      if (words[0].equals("create")) {
        Options options = new Options();
        options.spec.setLabel(words[1]);
        client.create(new Torus(1, 0.4), 1, options);
      }
      Stellate.watch(client, words[1], all::add);
    } catch (StellateException error) {
      if (error.kind() != StellateException.Kind.CANCELLED || error.mesh().isEmpty()) {
        return "error " + error.kind() + " " + error.reason();
      }
      all.add(error.mesh().get());
    }
    Mesh last = all.get(all.size() - 1);
    last.save(Path.of(words[2]));
    Report report = last.report().orElseThrow();
    String ended = name(report.getTermination(), "TERMINATION_");
    String level = name(report.getCertificate().getLevel(), "CERTIFICATE_LEVEL_");
    return "mesh " + last.revision + " " + ended + " " + level;
  }

  /** Without its prefix, or UNKNOWN, which a newer server's is. */
  private static String name(Enum<?> value, String prefix) {
    return value.name().equals("UNRECOGNIZED") ? "UNKNOWN" : value.name().replace(prefix, "");
  }
}
