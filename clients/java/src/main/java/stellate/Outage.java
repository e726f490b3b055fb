package stellate;

import io.grpc.Status;
import io.grpc.StatusRuntimeException;
import java.io.IOException;
import java.util.concurrent.CountDownLatch;
import java.util.concurrent.ThreadLocalRandom;
import java.util.concurrent.TimeUnit;
import java.util.function.Consumer;
import java.util.function.Supplier;

/** The attempts at one call or stream while the server may be away. */
final class Outage {
  private static final Shared WAITS = Shared.RECONNECT;

  /** What the calls and streams of one client share. */
  static final class Patience {
    double giveUpSeconds = WAITS.number("give_up");
    Supplier<StellateException> hopeless = () -> null; // why the server will not come back
    Consumer<String> onOutage = said -> System.err.println("stellate: " + said);
    Runnable connect = () -> {};
    volatile boolean reached; // something was heard of the server: it was there
  }

  private final Patience patience;
  private final boolean quiet; // leaves it to others to report an outage
  private final CountDownLatch stopped = new CountDownLatch(1);
  private int attempts;
  private long lostAt;

  Outage(Patience patience, boolean quiet) {
    this.patience = patience;
    this.quiet = quiet;
  }

  /** Whether the attempt under way follows on one that was broken off. */
  boolean lasts() {
    return attempts > 0;
  }

  boolean isStopped() {
    return stopped.getCount() == 0;
  }

  /** Ends the wait, and lets no other begin. */
  void stop() {
    stopped.countDown();
  }

  /** The attempt brought something: the server is there. */
  void heard() {
    patience.reached = true;
    if (attempts > 0) {
      tell("the server is back after %.1f s".formatted(gone()));
      attempts = 0;
    }
  }

  /**
   * Whether the server, or the way to it, was lost, so that the same call may succeed later. What a
   * server drops arrives as CANCELLED where this side cancelled nothing, and what was about to be
   * written as UNKNOWN, because of a closed channel. What a server says has no cause.
   */
  static boolean isTransient(Status status) {
    return switch (status.getCode()) {
      case UNAVAILABLE, CANCELLED -> true;
      case INTERNAL, UNKNOWN ->
          status.getCause() instanceof IOException
              || String.valueOf(status.getDescription()).contains("RST_STREAM");
      default -> false;
    };
  }

  private double gone() {
    return (System.nanoTime() - lostAt) / 1e9;
  }

  private void tell(String said) {
    if (!quiet) {
      patience.onOutage.accept(said);
    }
  }

  /** Returns when it is time for another attempt; else throws what the error comes to. */
  void await(StatusRuntimeException error) {
    StellateException ours = StellateException.of(error);
    if (ours.kind() == StellateException.Kind.MESH_NOT_FOUND && lasts()) {
      throw new StellateException(
          StellateException.Kind.UNAVAILABLE,
          ours.reason(),
          "the server went away and came back without the mesh; it keeps meshes only with"
              + " --data-dir",
          error);
    }
    if (!isTransient(error.getStatus())) {
      throw ours;
    }
    StellateException hopeless = patience.hopeless.get();
    if (hopeless != null) {
      throw hopeless;
    }
    patience.reached |= "SHUTTING_DOWN".equals(ours.reason()); // said by a server
    if (isStopped() || !patience.reached) {
      throw ours;
    }
    if (attempts == 0) {
      lostAt = System.nanoTime();
      if (patience.giveUpSeconds > 0) {
        tell(
            "lost the server (%s): trying again for up to %.0f s"
                .formatted(ours.getMessage(), patience.giveUpSeconds));
      }
    }
    double left = patience.giveUpSeconds - gone();
    if (left <= 0) {
      String waited = attempts > 0 ? "; waited %.1f s for it".formatted(gone()) : "";
      throw new StellateException(
          StellateException.Kind.UNAVAILABLE, ours.reason(), ours.getMessage() + waited, error);
    }
    double longer = Math.pow(WAITS.number("pause_growth"), attempts);
    double full = Math.min(WAITS.number("first_pause") * longer, WAITS.number("longest_pause"));
    attempts++;
    // Shortened at random: the clients of a server that comes back do not come all together.
    double chance = ThreadLocalRandom.current().nextDouble();
    double pause = full * (1 - WAITS.number("pause_jitter") * chance);
    try {
      if (stopped.await((long) (1e9 * Math.min(pause, left)), TimeUnit.NANOSECONDS)) {
        throw ours;
      }
    } catch (InterruptedException interrupted) {
      Thread.currentThread().interrupt();
      throw ours;
    }
    patience.connect.run();
  }
}
