package stellate;

import java.io.BufferedReader;
import java.io.IOException;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.Comparator;
import java.util.List;
import java.util.concurrent.TimeUnit;
import java.util.stream.Stream;

/** A stellated of this process's own, which ends with it whatever happens. */
public final class Server implements AutoCloseable {
  private static final int STOP_SECONDS = 10;
  private static final String SAID = " listening on ";

  private final Process process;
  private final Path folder;
  private final String address;

  private Server(Process process, Path folder, String address) {
    this.process = process;
    this.folder = folder;
    this.address = address;
  }

  /** The server binary: $STELLATED, else build/ of a source tree around us, else PATH. */
  public static Path findStellated() {
    String named = System.getenv("STELLATED");
    List<Path> candidates = new ArrayList<>();
    if (named != null && !named.isEmpty()) {
      candidates.add(Path.of(named));
      onPath(named).forEach(candidates::add);
    } else {
      for (Path at = Path.of("").toAbsolutePath(); at != null; at = at.getParent()) {
        if (Files.isRegularFile(at.resolve("proto/stellate/v1/stellate.proto"))) {
          candidates.add(at.resolve("build/release/bin/stellated"));
        }
      }
      onPath("stellated").forEach(candidates::add);
    }
    return firstProgram(
        candidates,
        "no server was given and no stellated found to start: name a server, or set $STELLATED to"
            + " the binary, or put it on PATH, or build it (clients/quickstart does)");
  }

  private static Path firstProgram(List<Path> candidates, String noneIsThere) {
    return candidates.stream()
        .filter(path -> Files.isRegularFile(path) && Files.isExecutable(path))
        .findFirst()
        .orElseThrow(() -> notFound(noneIsThere, null));
  }

  private static StellateException notFound(String words, IOException cause) {
    var kind = StellateException.Kind.SERVER_NOT_FOUND;
    return new StellateException(kind, "SERVER_NOT_FOUND", words, cause);
  }

  private static Stream<Path> onPath(String name) {
    String path = System.getenv("PATH");
    return Stream.of((path == null ? "" : path).split(":")).map(part -> Path.of(part, name));
  }

  /** On a unix socket that only this user may enter; flags are more of stellated's. */
  public static Server start(String... flags) {
    return start(null, flags);
  }

  /** At listen, "host:port"; it returns when it listens. */
  public static Server start(String listen, String[] flags) {
    List<String> all = new ArrayList<>(List.of("--drain-seconds", "0"));
    if (listen == null) { // one that answers no pings is merely busy in an oracle
      all.addAll(List.of("--keepalive", "600", "--keepalive-timeout", "600"));
    }
    all.addAll(List.of(flags));
    return launch(findStellated().toString(), listen, all);
  }

  private static Server launch(String program, String listen, List<String> flags) {
    try {
      Path folder = Files.createTempDirectory("stellate-");
      // A session of its own: Ctrl-C is for the client, which cancels its meshes first.
      List<String> command = new ArrayList<>(List.of("setsid"));
      command.add(program);
      command.addAll(List.of("--exit-with-parent", "--listen"));
      command.add(listen == null ? "unix:" + folder.resolve("socket") : listen);
      command.addAll(flags);
      ProcessBuilder builder = new ProcessBuilder(command);
      Process process = builder.redirectError(folder.resolve("log").toFile()).start();
      BufferedReader out = process.inputReader(StandardCharsets.UTF_8);
      String line = out.readLine();
      boolean listens = line != null && line.contains(SAID);
      String address = listens ? line.substring(line.indexOf(SAID) + SAID.length()) : "";
      Server server = new Server(process, folder, address);
      if (!listens) {
        process.onExit().join();
        StellateException why = server.whyGone();
        server.close();
        throw why;
      }
      return server;
    } catch (IOException error) {
      throw notFound("cannot start " + program + ": " + error.getMessage(), error);
    }
  }

  /** Where clients reach it, "unix:/path" or "host:port". */
  public String address() {
    return address;
  }

  /** With the last words of a server that is no more; null for one that runs. */
  StellateException whyGone() {
    if (process.isAlive()) {
      return null;
    }
    String words;
    try {
      words = Files.readString(folder.resolve("log"));
    } catch (IOException error) {
      words = error.toString();
    }
    return new StellateException(
        StellateException.Kind.UNAVAILABLE,
        "SERVER_GONE",
        "stellated ended with status "
            + process.exitValue()
            + ": "
            + words.substring(Math.max(0, words.length() - 2000)).strip());
  }

  /** Stops it and removes its directory. May be called again. */
  @Override
  public void close() {
    process.destroy();
    try {
      if (!process.waitFor(STOP_SECONDS, TimeUnit.SECONDS)) {
        process.destroyForcibly();
      }
    } catch (InterruptedException error) {
      process.destroyForcibly();
      Thread.currentThread().interrupt();
    }
    try (Stream<Path> files = Files.walk(folder)) {
      for (Path file : files.sorted(Comparator.reverseOrder()).toList()) {
        Files.deleteIfExists(file);
      }
    } catch (IOException | java.io.UncheckedIOException error) {
      return; // somebody else was first
    }
  }
}
