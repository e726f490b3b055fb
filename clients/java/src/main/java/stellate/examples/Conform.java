package stellate.examples;

import java.io.BufferedReader;
import java.io.InputStreamReader;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.Scanner;
import java.util.stream.LongStream;
import stellate.Client;
import stellate.Credentials;
import stellate.Mesh;
import stellate.Options;
import stellate.Oracle;
import stellate.ReconstructOptions;
import stellate.Stellate;
import stellate.StellateException;
import stellate.v1.Report;

/** Obeys `stellate conform`, whose help says what each line wants. */
public final class Conform {
  private final String server;
  private final Client client;

  private Conform(String server, Client client) {
    this.server = server;
    this.client = client;
  }

  public static void main(String[] arguments) throws Exception {
    var in = new BufferedReader(new InputStreamReader(System.in, StandardCharsets.UTF_8));
    try (Client client = connect(arguments[0], Credentials.NONE)) {
      Conform conform = new Conform(arguments[0], client);
      for (String line = in.readLine(); line != null; line = in.readLine()) {
        System.out.println(conform.obey((line + "  ").split(" ", -1)));
      }
    }
  }

  private static Client connect(String server, Credentials credentials) {
    return new Client(server, credentials).onOutage(said -> {});
  }

  private String obey(String[] words) throws Exception {
    try {
      return switch (words[0]) {
        case "serve" -> serve(words[1], words[2]);
        case "watch" -> watch(words[1], Path.of(words[2]));
        case "create" -> create(words[1], words[2]);
        case "reconstruct" -> reconstruct(Path.of(words[1]), words[2], words[3]);
        case "save" -> {
          Mesh.loadTxt(Path.of(words[1])).save(Path.of(words[2]));
          yield "saved";
        }
        default -> "unsupported";
      };
    } catch (StellateException error) {
      String said = error.getMessage().replace('\n', ' ');
      boolean raised = error.kind() == StellateException.Kind.RAISED;
      return "error " + (raised ? "oracle" : error.kind()) + " " + error.reason() + " " + said;
    }
  }

  private String serve(String mesh, String name) throws Exception {
    Oracle oracle = KitManifolds.named(name);
    return oracle == null ? "unsupported" : "over " + client.serve(oracle, mesh, "", 0);
  }

  private String watch(String name, Path path) throws Exception {
    List<Mesh> all = new ArrayList<>();
    try {
      Stellate.watch(client, name, all::add);
    } catch (StellateException error) {
      if (error.kind() != StellateException.Kind.CANCELLED || error.mesh().isEmpty()) {
        throw error;
      }
      all.add(error.mesh().get());
    }
    Mesh last = all.get(all.size() - 1);
    last.save(path);
    if (last.walls != null) {
      List<String> lines = LongStream.of(last.walls).mapToObj(Long::toUnsignedString).toList();
      Files.write(Path.of(path + ".walls"), lines);
    }
    return "mesh " + last.revision + " " + ended(last);
  }

  private static String ended(Mesh mesh) {
    Report report = mesh.report().orElseThrow();
    String level = name(report.getCertificate().getLevel(), "CERTIFICATE_LEVEL_");
    return name(report.getTermination(), "TERMINATION_") + " " + level;
  }

  private String reconstruct(Path path, String k, String d) throws Exception {
    try (Scanner numbers = new Scanner(path, StandardCharsets.UTF_8)) {
      double[] points = numbers.tokens().mapToDouble(Double::parseDouble).toArray();
      var options = ReconstructOptions.on(client);
      Mesh mesh = Stellate.reconstruct(points, Integer.parseInt(k), Integer.parseInt(d), options);
      return "mesh - " + ended(mesh);
    }
  }

  private String create(String label, String how) {
    Options options = new Options();
    options.spec.setLabel(label);
    Oracle oracle =
        switch (how) {
          case "seeds" -> new KitManifolds.Seeded();
          case "walls" -> KitManifolds.named("lune");
          default -> KitManifolds.TORUS;
        };
    String token = how.startsWith("token=") ? how.substring(6) : null;
    try (Client known = connect(server, Credentials.token(token))) {
      return "created " + known.create(oracle, 0.5, options).getName();
    }
  }

  /** Without its prefix, or UNKNOWN, which a newer server's is. */
  private static String name(Enum<?> value, String prefix) {
    return value.name().equals("UNRECOGNIZED") ? "UNKNOWN" : value.name().replace(prefix, "");
  }
}
