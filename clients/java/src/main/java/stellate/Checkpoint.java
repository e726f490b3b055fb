package stellate;

import java.io.IOException;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.LinkOption;
import java.nio.file.Path;
import java.nio.file.StandardCopyOption;
import java.nio.file.StandardOpenOption;
import java.nio.file.attribute.PosixFilePermission;
import java.nio.file.attribute.PosixFilePermissions;
import java.util.Arrays;
import java.util.Set;
import stellate.v1.MeshSpec;

/**
 * A directory in which one mesh outlives the processes that make it, as
 * clients/shared/checkpoint.toml lays it out.
 */
final class Checkpoint {
  private static final Shared LAYOUT = Shared.CHECKPOINT;

  private final Path folder;
  private final Path record;

  Checkpoint(Path folder) {
    this.folder = folder;
    record = folder.resolve(LAYOUT.word("record"));
  }

  private StellateException wrong(String what) {
    return StellateException.invalid("the checkpoint " + folder + " " + what);
  }

  private StellateException unusable(IOException error) {
    return wrong("cannot be used: " + error);
  }

  /** Starts the private server, once that of a killed process has come to its end. */
  Server server() {
    try {
      insistOnOwn();
    } catch (IOException error) {
      throw unusable(error);
    }
    if (Files.exists(folder.resolve(LAYOUT.word("python_record")))) {
      throw wrong("is of the Python client: take another directory");
    }
    String data = folder.resolve(LAYOUT.word("server")).toString();
    String kept = LAYOUT.word("keep_finished_seconds");
    long deadline =
        System.currentTimeMillis() + (long) (1000 * LAYOUT.number("last_server_seconds"));
    while (true) {
      try {
        return Server.start("--data-dir", data, "--keep-finished-seconds", kept);
      } catch (StellateException error) {
        if (!error.getMessage().contains("another server uses")) {
          throw error;
        }
        pauseUntil(deadline);
      }
    }
  }

  /** Makes the folder; refuses one in which others could have put what we would believe. */
  private void insistOnOwn() throws IOException {
    if (Files.isSymbolicLink(folder)) {
      throw wrong("is a link: name the directory that it leads to");
    }
    if (!Files.exists(folder)) {
      if (folder.toAbsolutePath().getParent() != null) {
        Files.createDirectories(folder.toAbsolutePath().getParent());
      }
      Files.createDirectory(
          folder,
          PosixFilePermissions.asFileAttribute(PosixFilePermissions.fromString("rwx------")));
    }
    if (!isOwn(folder)) {
      throw wrong("belongs to another user: take another directory");
    }
    Set<PosixFilePermission> modes =
        Files.getPosixFilePermissions(folder, LinkOption.NOFOLLOW_LINKS);
    if (modes.contains(PosixFilePermission.GROUP_WRITE)
        || modes.contains(PosixFilePermission.OTHERS_WRITE)) {
      throw wrong(
          "may be written by others ("
              + PosixFilePermissions.toString(modes)
              + "): take another directory, or, if all in it is yours, chmod go-w");
    }
  }

  private static boolean isOwn(Path path) throws IOException {
    Object owner = Files.getAttribute(path, "unix:uid", LinkOption.NOFOLLOW_LINKS);
    return owner.equals(Files.getAttribute(Path.of("/proc/self"), "unix:uid"));
  }

  private void pauseUntil(long deadline) {
    try {
      if (System.currentTimeMillis() < deadline) {
        Thread.sleep(100);
        return;
      }
    } catch (InterruptedException error) {
      Thread.currentThread().interrupt();
    }
    throw new StellateException(
        StellateException.Kind.FAILED_PRECONDITION,
        "FAILED_PRECONDITION",
        "another process is meshing in the checkpoint "
            + folder
            + ": wait for its end, or take another directory");
  }

  /** The mesh that is there, or a new one. */
  stellate.v1.Mesh declare(Client client, MeshSpec spec) {
    MeshSpec wanted = spec.toBuilder().clearLabel().build();
    String name = "";
    try {
      if (Files.exists(record, LinkOption.NOFOLLOW_LINKS)) {
        if (!Files.isRegularFile(record, LinkOption.NOFOLLOW_LINKS) || !isOwn(record)) {
          throw wrong(
              "has a record that is a link, or no file of this user's: take another directory");
        }
        byte[] kept = Files.readAllBytes(record);
        int end = 0;
        while (end < kept.length && kept[end] != '\n') {
          end++;
        }
        // What may follow the name is of clients that choose epsilon.
        name = new String(kept, 0, end, StandardCharsets.UTF_8).split(" ", 2)[0];
        int from = Math.min(end + 1, kept.length);
        if (!MeshSpec.parseFrom(Arrays.copyOfRange(kept, from, kept.length)).equals(wanted)) {
          throw wrong(
              "is of a mesh of another specification: take another directory, or remove it");
        }
      }
      stellate.v1.Mesh found = null;
      for (stellate.v1.Mesh info : client.list()) {
        if (info.getName().equals(name)) {
          found = info;
        } else {
          client.delete(info.getName()); // was forgotten, or never put down
        }
      }
      if (found == null) {
        found = client.create(spec);
        note(found.getName(), wanted.toByteArray());
      }
      return found;
    } catch (IOException error) {
      throw unusable(error);
    }
  }

  /** All of it or nothing. */
  private void note(String name, byte[] wanted) throws IOException {
    byte[] head = (name + "\n").getBytes(StandardCharsets.UTF_8);
    byte[] all = Arrays.copyOf(head, head.length + wanted.length);
    System.arraycopy(wanted, 0, all, head.length, wanted.length);
    Path draft = folder.resolve(LAYOUT.word("draft"));
    Files.deleteIfExists(draft); // of a process that was killed; a link itself, not where it leads
    Files.write(draft, all, StandardOpenOption.CREATE_NEW, StandardOpenOption.WRITE);
    Files.move(draft, record, StandardCopyOption.ATOMIC_MOVE, StandardCopyOption.REPLACE_EXISTING);
  }

  /** Has the next call begin from the start where this mesh has failed for good. */
  void forgetAfter(StellateException error) {
    boolean over = error.mesh().flatMap(Mesh::report).isPresent();
    if (!over || error.reason().startsWith("JOURNAL_")) {
      return; // with more room for its journal it goes on
    }
    try {
      Files.deleteIfExists(record);
    } catch (IOException kept) {
      error.addSuppressed(kept);
    }
  }
}
