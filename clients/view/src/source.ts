// Where answers come from: the gateway of `stellate view`, or a recording inside the page.
//
// A call of the protocol is a WebSocket of its own. Each side proves to the other that it knows the
// session's key, which never travels; then the request goes out, and each binary frame is one
// response as the server sent it. What was taken in is acknowledged: the gateway lets no more than
// 4 MB be under way, and the server merges rounds for a page that is slow.

export interface CallEnd {
  code: number; // as of gRPC; 0: well
  message: string;
}

export type OnFrame = (frame: Uint8Array) => void | Promise<void>;

export interface CallOptions {
  stop?: AbortSignal;
  revision?: number; // what tells one recorded download from another
}

export interface Source {
  readonly live: boolean;
  call(
    method: string,
    request: Uint8Array,
    onFrame: OnFrame,
    options?: CallOptions,
  ): Promise<CallEnd>;
}

export interface Recording {
  replies: { method: string; revision?: number; frames: string[] }[];
}

const kUnavailable = 14;
const kUnauthenticated = 16;

function bytesOf(base64: string): Uint8Array {
  return Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
}

export class RecordedSource implements Source {
  readonly live = false;
  constructor(private recording: Recording) {}

  async call(method: string, _request: Uint8Array, onFrame: OnFrame, options: CallOptions = {}) {
    const replies = this.recording.replies.filter((reply) => reply.method === method);
    if (replies.length === 0) return { code: 5, message: "this file does not hold that" };
    // Not every revision is kept: the nearest will do.
    const away = ({ revision }: { revision?: number }) =>
      Math.abs((revision ?? 0) - (options.revision ?? 0));
    const reply = replies.reduce((best, r) => (away(r) < away(best) ? r : best));
    for (const frame of reply.frames) {
      if (options.stop?.aborted) break;
      await onFrame(bytesOf(frame));
    }
    return { code: 0, message: "" };
  }
}

const hex = (bytes: Uint8Array) =>
  Array.from(bytes, (b) => b.toString(16).padStart(2, "0")).join("");

export interface Greeting {
  server: string;
  mesh: string;
  secret: string; // that is good from now on
}

export class GatewaySource implements Source {
  readonly live = true;
  // What the gateway says of itself, once it has proved to be ours.
  onGreeting: (greeting: Greeting) => void = () => {};

  private constructor(
    private host: string,
    private secret: string,
    private key: CryptoKey,
  ) {}

  static async open(host: string, secret: string): Promise<GatewaySource> {
    return new GatewaySource(host, secret, await GatewaySource.keyOf(secret));
  }

  private static keyOf(secret: string): Promise<CryptoKey> {
    return crypto.subtle.importKey(
      "raw",
      new TextEncoder().encode(secret),
      { name: "HMAC", hash: "SHA-256" },
      false,
      ["sign"],
    );
  }

  private async proof(key: CryptoKey, who: string, nonce: string): Promise<string> {
    const text = new TextEncoder().encode(`${who} ${this.host} ${nonce}`);
    return hex(new Uint8Array(await crypto.subtle.sign("HMAC", key, text)));
  }

  call(
    method: string,
    request: Uint8Array,
    onFrame: OnFrame,
    { stop }: CallOptions = {},
  ): Promise<CallEnd> {
    return new Promise((resolve) => {
      const socket = new WebSocket(`ws://${this.host}/call/${method}`);
      socket.binaryType = "arraybuffer";
      const nonce = hex(crypto.getRandomValues(new Uint8Array(16)));
      const key = this.key;
      let greeted = false;
      let end: CallEnd = { code: kUnavailable, message: "the command `stellate view` is gone" };
      let queue: Promise<void> = Promise.resolve();
      // Whoever is at the other end need not agree.
      const leave = () => {
        socket.close();
        resolve(end);
      };
      stop?.addEventListener("abort", leave);

      const hear = async (text: string) => {
        const said = JSON.parse(text);
        if (said.nonce) {
          const proof = await this.proof(key, "page", said.nonce);
          socket.send(`${proof} ${nonce}`);
        } else if (said.proof) {
          if (said.proof !== (await this.proof(key, "gateway", nonce))) {
            end = { code: kUnauthenticated, message: "another program answers at this address" };
            return leave();
          }
          greeted = true;
          if (said.secret && said.secret !== this.secret) {
            this.secret = said.secret; // the one that the page was opened with holds but once
            this.key = await GatewaySource.keyOf(said.secret);
          }
          this.onGreeting(said);
          socket.send(request);
        } else if (said.end) {
          end = said.end;
        }
      };

      socket.onmessage = ({ data }) => {
        queue = queue.then(async () => {
          if (typeof data === "string") return hear(data);
          if (!greeted || stop?.aborted) return;
          await onFrame(new Uint8Array(data));
          if (socket.readyState === WebSocket.OPEN) socket.send(`${data.byteLength}`);
        });
        queue.catch((error: unknown) => {
          end = { code: 13, message: String(error) };
          leave();
        });
      };
      socket.onclose = () => {
        stop?.removeEventListener("abort", leave);
        void queue.catch(() => {}).then(() => resolve(end));
      };
    });
  }
}
