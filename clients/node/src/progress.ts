// Showing a mesh at work.
import type { WriteStream } from "node:tty";
import type { Progress } from "./report.js";

const REDRAW = 50; // milliseconds
const PLAIN = 5000;

/** An `onProgress` that keeps one live line on a terminal, and else prints few plain lines. */
export function progressBar(file: WriteStream = process.stderr): (progress: Progress) => void {
  let shown = -Infinity;
  let phase = "";
  return (progress) => {
    const now = performance.now();
    const due = now - shown >= (file.isTTY ? REDRAW : PLAIN);
    if (progress.phase === phase && !due) return;
    shown = now;
    phase = progress.phase;
    const share = `${Math.round(100 * progress.fraction)}%`.padStart(4);
    const left = progress.remainingSeconds;
    const line =
      `${phase.toLowerCase()} ${share}  ${progress.vertices} vertices  ` +
      `${progress.simplices} simplices  ${progress.elapsedSeconds.toFixed(1)} s` +
      (left > 0 ? `, ${left.toFixed(0)} s left` : "");
    if (!file.isTTY) file.write(`${line}\n`);
    else file.write(`\r${line.slice(0, file.columns - 1)}\x1b[K${phase === "DONE" ? "\n" : ""}`);
  };
}
