// Leads from mesh to mesh, each in its turn, as they grow, until somebody chooses.
import type { MeshRow } from "./messages";
import type { Time } from "./time";

const kLookSeconds = 3; // at each, once it is done
const kTouchSeconds = 8; // that whoever turns it or reads is left alone

export class Leader {
  private row: MeshRow | null = null; // of what is looked at
  private seen = 0; // its revisions
  private doneAt = Infinity;
  private touchedAt = -Infinity;

  constructor(
    public leads: boolean,
    private readonly time: Time,
    private readonly onNext: () => void,
  ) {
    for (const kind of ["pointerdown", "wheel", "keydown"]) {
      addEventListener(kind, () => (this.touchedAt = performance.now()), { passive: true });
    }
    setInterval(() => this.tick(performance.now()), 250);
  }

  // Another mesh is looked at.
  reset() {
    this.row = null;
    this.seen = 0;
    this.doneAt = Infinity;
  }

  // What was over before it was seen to grow is grown again.
  hear(row: MeshRow) {
    const ends = row.over && !this.row?.over;
    this.row = row;
    if (this.leads && ends && 2 * this.seen < row.revision) this.time.grow();
  }

  arrived(revision: number) {
    if (revision !== this.time.shown) this.seen++;
  }

  private tick(now: number) {
    const { row, time } = this;
    if (!this.leads || row === null) return;
    const all = time.shown >= row.revision || row.state !== "succeeded";
    const done = row.over && all && time.following && !time.replaying;
    this.doneAt = done ? Math.min(this.doneAt, now) : Infinity;
    const looked = now - this.doneAt > 1000 * kLookSeconds;
    if (looked && now - this.touchedAt > 1000 * kTouchSeconds) this.onNext();
  }
}
