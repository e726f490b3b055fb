// The slider over a mesh's revisions: which is shown, and growing it again.
import { grouped } from "./panels";
import { at } from "./page";

const kReplaySeconds = 0.2; // a step
const kMostSteps = 60;

export class Time {
  shown = 0; // the revision on the screen; 0: none yet
  following = true; // the newest
  private grownTo = 0; // the newest that is known of
  private over = false;
  private awaited = 0; // as of `drawn`
  private replay: ReturnType<typeof setInterval> | undefined;

  // `ask`: for a revision to be shown; null: the newest, as it comes; counts what was asked. `drawn`: the
  // last of these that is on the screen. `always`: though there is but one.
  constructor(
    private readonly ask: (revision: number | null) => number,
    private readonly drawn: () => number,
    private readonly always: () => boolean,
  ) {
    at<HTMLInputElement>("revision").oninput = (e) => {
      const value = Number((e.target as HTMLInputElement).value);
      this.stop();
      this.show(value >= this.newest ? null : value);
    };
    at("live").onclick = () => {
      this.stop();
      this.show(null);
    };
    at("play").onclick = () => (this.replaying ? this.stop() : this.grow());
  }

  get replaying(): boolean {
    return this.replay !== undefined;
  }
  get newest(): number {
    return Math.max(this.grownTo, this.shown, 1);
  }

  // Of another mesh.
  reset() {
    this.stop();
    this.following = true;
    this.shown = this.grownTo = 0;
    this.over = false;
    at("revision-text").textContent = "";
    this.draw();
  }

  hear(revision: number, over = this.over) {
    this.grownTo = Math.max(this.grownTo, revision);
    this.over = over;
    this.draw();
  }

  // What is drawn from now on.
  arrived(revision: number, vertices: number) {
    this.shown = revision;
    at("revision-text").textContent =
      vertices > 0 || !this.following
        ? `revision ${revision} of ${this.newest} · ${grouped(vertices)} vertices`
        : "";
    this.draw();
  }

  show(revision: number | null) {
    this.following = revision === null;
    this.awaited = this.ask(revision);
    this.draw();
  }

  stop() {
    clearInterval(this.replay);
    this.replay = undefined;
    at("play").textContent = "replay";
  }

  // From where it is, from the newest on from the first.
  grow() {
    at("play").textContent = "pause";
    let next = this.following || this.shown >= this.newest ? 1 : this.shown;
    const step = Math.max(1, Math.round(this.newest / kMostSteps));
    const turn = () => {
      if (this.drawn() < this.awaited) return; // each step is seen
      if (next >= this.newest) {
        this.stop();
        return this.show(null);
      }
      at<HTMLInputElement>("revision").value = `${next}`;
      this.show(next);
      next += step;
    };
    this.replay = setInterval(turn, 1000 * kReplaySeconds);
    turn();
  }

  private draw() {
    const slider = at<HTMLInputElement>("revision");
    at("time").hidden = this.newest === 1 && !this.always();
    at("time").classList.toggle("idle", this.shown === 0);
    slider.max = `${this.newest}`;
    if (this.following) slider.value = slider.max;
    at<HTMLButtonElement>("live").disabled = this.following;
    at("live").textContent = this.over ? "newest" : "live";
  }
}
