// Riding out the absence of a server.
import { setTimeout as sleep } from "node:timers/promises";
import { MeshNotFound, StellateError, Unavailable } from "./errors.js";
import { RECONNECT } from "./generated/shared.js";
import { grpc } from "./wire.js";

/**
 * Whether the server, or the way to it, was lost, so that the same call may succeed later. What a
 * server drops arrives as CANCELLED where this side cancelled nothing, or as a stream that was reset.
 */
export function isTransient(error: grpc.ServiceError): boolean {
  const { code, details } = error;
  if (code === grpc.status.INTERNAL || code === grpc.status.UNKNOWN) {
    return (details ?? "").includes("RST_STREAM");
  }
  return code === grpc.status.UNAVAILABLE || code === grpc.status.CANCELLED;
}

/** What the calls and streams of one client share. */
export interface Patience {
  giveUpSeconds: number;
  /** Waits a moment for a connection. */
  connect(): Promise<void>;
  /** Why the server will not come back, if that is known. */
  hopeless(): StellateError | undefined;
  /** Called when the server is lost, and when it is back. */
  onOutage(message: string): void;
  /** Something was heard of the server: it was there. */
  reached: boolean;
}

/** The attempts at one call or stream. A `quiet` one leaves it to others to report an outage. */
export class Outage {
  private readonly ending = new AbortController();
  private attempts = 0;
  private lostAt = 0;

  constructor(
    private readonly patience: Patience,
    private readonly quiet = false,
  ) {}

  /** Whether the attempt under way follows on one that was broken off. */
  get lasts(): boolean {
    return this.attempts > 0;
  }

  get stopped(): boolean {
    return this.ending.signal.aborted;
  }

  /** Ends the wait, and lets no other begin. */
  stop(): void {
    this.ending.abort();
  }

  /** The attempt brought something: the server is there. */
  heard(): void {
    this.patience.reached = true;
    if (!this.attempts) return;
    this.tell(`the server is back after ${((Date.now() - this.lostAt) / 1000).toFixed(1)} s`);
    this.attempts = 0;
  }

  /** What a mesh that is not there means when it was there before. */
  explain(error: StellateError): StellateError {
    if (!(error instanceof MeshNotFound) || !this.lasts) return error;
    return new Unavailable(
      "the server went away and came back without the mesh; it keeps meshes only with --data-dir",
      { reason: error.reason, details: error.details },
    );
  }

  /** Returns when it is time for another attempt; throws `ours` where waiting is of no use. */
  async waitOrThrow(error: grpc.ServiceError, ours: StellateError): Promise<void> {
    if (!isTransient(error)) throw ours;
    const hopeless = this.patience.hopeless();
    if (hopeless) throw hopeless;
    if (ours.reason === "SHUTTING_DOWN") this.patience.reached = true; // said by a server
    if (this.stopped || !this.patience.reached) throw ours;
    const now = Date.now();
    if (!this.attempts) {
      this.lostAt = now;
      const most = this.patience.giveUpSeconds;
      if (most > 0)
        this.tell(`lost the server (${ours.message}): trying again for up to ${most} s`);
    }
    const left = this.patience.giveUpSeconds - (now - this.lostAt) / 1000;
    if (left <= 0) {
      const waited = `; waited ${((now - this.lostAt) / 1000).toFixed(1)} s for it`;
      const message = ours.message + (this.attempts ? waited : "");
      throw new Unavailable(message, { reason: ours.reason, details: ours.details });
    }
    const longer = RECONNECT.pause_growth ** this.attempts;
    const full = Math.min(RECONNECT.first_pause * longer, RECONNECT.longest_pause);
    this.attempts++;
    // Shortened at random: the clients of a server that comes back do not come all together.
    const pause = Math.min(full * (1 - RECONNECT.pause_jitter * Math.random()), left);
    try {
      await sleep(1000 * pause, undefined, { signal: this.ending.signal });
    } catch {
      throw ours;
    }
    await this.patience.connect();
  }

  private tell(message: string): void {
    if (!this.quiet) this.patience.onOutage(message);
  }
}
