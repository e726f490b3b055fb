package stellate;

import java.util.Locale;
import java.util.function.Consumer;
import stellate.v1.Phase;
import stellate.v1.Progress;

/** An onProgress that keeps one live line on a terminal, and else prints few plain lines. */
public final class ProgressBar implements Consumer<Progress> {
  private final boolean live = System.console() != null;
  private final long pause = live ? 50_000_000L : 5_000_000_000L; // nanoseconds
  private long shown;
  private Phase phase = Phase.PHASE_UNSPECIFIED;

  @Override
  public void accept(Progress progress) {
    if (progress.getPhase() == phase && System.nanoTime() - shown < pause) {
      return;
    }
    shown = System.nanoTime();
    phase = progress.getPhase();
    String line =
        "%s %3.0f%%  %d vertices  %d simplices  %.1f s"
            .formatted(
                phase.name().replace("PHASE_", "").toLowerCase(Locale.ROOT),
                100 * progress.getFraction(),
                progress.getVertices(),
                progress.getSimplices(),
                progress.getElapsedSeconds());
    if (!live) {
      System.err.println(line);
    } else {
      System.err.print("\r" + line + "\u001b[K" + (phase == Phase.PHASE_DONE ? "\n" : ""));
    }
  }
}
