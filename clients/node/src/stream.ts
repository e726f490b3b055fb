// A server's stream that survives a lost connection.
import { fromRpc } from "./errors.js";
import type { Outage } from "./retry.js";
import type { grpc } from "./wire.js";

/** Its messages, to be iterated over once. After a break it goes on where it broke off. */
export class Stream<Message> implements AsyncIterable<Message> {
  /** Called before a stream is opened again: parts of what was incomplete will come once more. */
  onResume: () => void = () => {};
  private call?: grpc.ClientReadableStream<Message>;
  private closed = false;

  constructor(
    private readonly open: () => grpc.ClientReadableStream<Message>,
    /** Notes where to go on; true for the last message. */
    private readonly note: (message: Message) => boolean,
    private readonly outage: Outage,
  ) {}

  async *[Symbol.asyncIterator](): AsyncGenerator<Message> {
    try {
      while (!this.closed) {
        try {
          this.call = this.open();
          for await (const message of this.call as AsyncIterable<Message>) {
            this.outage.heard();
            const last = this.note(message);
            yield message;
            if (last || this.closed) return;
          }
        } catch (error) {
          if (this.closed) return;
          if (!isServiceError(error)) throw error;
          await this.outage.waitOrThrow(error, this.outage.explain(fromRpc(error)));
          this.onResume();
        }
      }
    } finally {
      this.close();
    }
  }

  /** Reads no more. */
  close(): void {
    this.closed = true;
    this.outage.stop();
    this.call?.cancel();
    this.call?.on("error", () => {}); // CANCELLED, as asked
  }
}

function isServiceError(error: unknown): error is grpc.ServiceError {
  return error instanceof Error && "metadata" in error && "code" in error;
}
