// The service call by call, for those who need more than mesh().
import { randomBytes } from "node:crypto";
import { channelCredentials, type Credentials, staysOnThisMachine } from "./credentials.js";
import { headersInterceptor, tokenHeader } from "./credentials.js";
import { fromRpc, InvalidArgument, MeshNotFound, protocolError, StellateError } from "./errors.js";
import type { CheckReport__Output } from "./generated/stellate/v1/CheckReport.js";
import type { DownloadMeshResponse__Output } from "./generated/stellate/v1/DownloadMeshResponse.js";
import type { ExamineResponse__Output } from "./generated/stellate/v1/ExamineResponse.js";
import type { MeshSpec } from "./generated/stellate/v1/MeshSpec.js";
import type { Mesh__Output } from "./generated/stellate/v1/Mesh.js";
import type { ServerInfo__Output } from "./generated/stellate/v1/ServerInfo.js";
import type { PointsChunk } from "./generated/stellate/v1/PointsChunk.js";
import type { ReconstructReply__Output } from "./generated/stellate/v1/ReconstructReply.js";
import type { WatchMeshResponse__Output } from "./generated/stellate/v1/WatchMeshResponse.js";
import type { ListMeshesResponse__Output } from "./generated/stellate/v1/ListMeshesResponse.js";
import { RECONNECT, RETRIES } from "./generated/shared.js";
import { CheckedOracle, type Oracle } from "./oracle.js";
import { infoFrom, type MeshInfo } from "./report.js";
import { Outage, type Patience } from "./retry.js";
import { Server } from "./server.js";
import { type MeshOptions, meshSpec } from "./spec.js";
import { Stream } from "./stream.js";
import type { CheckedPoints } from "./upload.js";
import { Worker, type WorkerOptions } from "./worker.js";
import { grpc, Stub } from "./wire.js";

const CONNECT_SECONDS = 1;
const NO_PINGS = 2_000_000_000; // milliseconds
const LARGEST_MESSAGE = 64 << 20;

export interface ClientOptions {
  credentials?: Credentials;
  /** How long a server that was there and went away is waited for; 0: not at all. Default 180. */
  reconnectSeconds?: number;
  /** How long a silent server is trusted before it is pinged; twice as long to answer. Default 4. */
  keepaliveSeconds?: number;
  /** Called when the server is lost and when it is back. Default: standard error. */
  onOutage?: (message: string) => void;
  /**
   * Headers of every call, asked for at each. With OpenTelemetry the spans of a server go on in the trace
   * of the program: `() => { const sent = {}; propagation.inject(context.active(), sent); return sent; }`.
   */
  headers?: () => Record<string, string>;
}

type Unary<Request, Reply> = (
  request: Request,
  options: grpc.CallOptions,
  callback: (error: grpc.ServiceError | null, reply?: Reply) => void,
) => grpc.ClientUnaryCall;

/** A connection to a server: "host:port", "unix:/path" or a Server. */
export class Client {
  readonly address: string;
  private readonly stub: Stub;
  private readonly patience: Patience;

  constructor(server: string | Server, options: ClientOptions = {}) {
    this.address = server instanceof Server ? server.address : server;
    if (!/^unix:|^[^/]*:[0-9]+$/.test(this.address)) {
      throw new InvalidArgument(
        `server has to be 'host:port' or 'unix:/path', and is '${this.address}'`,
      );
    }
    const credentials = options.credentials ?? {};
    // A private server needs no pings: its end shows immediately.
    const isPrivate = server instanceof Server && this.address.startsWith("unix:");
    const ping = isPrivate ? NO_PINGS : 1000 * (options.keepaliveSeconds ?? RECONNECT.keepalive);
    this.stub = new Stub(this.address, channelCredentials(this.address, credentials), {
      "grpc.max_receive_message_length": LARGEST_MESSAGE,
      "grpc.max_send_message_length": LARGEST_MESSAGE,
      "grpc.keepalive_time_ms": ping,
      "grpc.keepalive_timeout_ms": Math.min(RECONNECT.ping_patience * ping, NO_PINGS),
      // The pauses between attempts are ours; gRPC's own would be up to two minutes.
      "grpc.initial_reconnect_backoff_ms": 1000 * RECONNECT.first_connection_pause,
      "grpc.max_reconnect_backoff_ms": 1000 * RECONNECT.longest_connection_pause,
      "grpc.service_config": RETRIES, // a reply that was lost on the way
      // Proxies are for the outside.
      ...(staysOnThisMachine(this.address) ? { "grpc.enable_http_proxy": 0 } : {}),
      interceptors: [
        headersInterceptor(() => ({ ...options.headers?.(), ...tokenHeader(credentials) })),
      ],
    });
    this.patience = {
      giveUpSeconds: options.reconnectSeconds ?? RECONNECT.give_up,
      connect: () => this.connect(),
      hopeless: () => (server instanceof Server && !server.alive ? server.whyGone() : undefined),
      onOutage: options.onOutage ?? ((message) => console.warn(`stellate: ${message}`)),
      reached: false,
    };
  }

  /**
   * Declares a mesh, which waits to be served. Repeated when the server is lost: an id of its own lets
   * the server know the mesh again.
   */
  async create(oracle: Oracle, options: MeshOptions): Promise<MeshInfo> {
    return this.createFrom(this.specOf(oracle, options));
  }

  /** What create() asks for. */
  specOf(oracle: Oracle, options: MeshOptions): MeshSpec {
    // Round trips are what a far server costs.
    const far = staysOnThisMachine(this.address) ? {} : { speculative: true };
    return meshSpec(new CheckedOracle(oracle), oracle, { ...far, ...options });
  }

  /** As create(), in the protocol's own message. */
  async createFrom(spec: MeshSpec): Promise<MeshInfo> {
    const call: Unary<object, Mesh__Output> = this.stub.CreateMesh.bind(this.stub);
    return infoFrom(await this.unary(call, { spec, meshId: randomBytes(16).toString("hex") }));
  }

  /** Declares a mesh of points, which waits for them. Not repeated: whether it made the mesh would not be known. */
  async declarePoints(points: CheckedPoints): Promise<MeshInfo> {
    try {
      const reply = await this.sendPoints([{ spec: points.spec }]);
      this.patience.reached = true;
      return infoFrom(replied(reply));
    } catch (error) {
      throw asOurs(error);
    }
  }

  /**
   * Sends the points of a mesh that was declared so. After a break it goes on from what the server has.
   * Returns once all are recorded, or throws when `signal` is aborted.
   */
  async upload(name: string, points: CheckedPoints, signal: AbortSignal): Promise<MeshInfo> {
    const most = Number((await this.info()).maxMessageBytes);
    const outage = new Outage(this.patience, true); // the watch tells
    signal.addEventListener("abort", () => outage.stop());
    for (;;) {
      try {
        const { rows } = await this.sendPoints([{ mesh: name }], signal);
        const reply = await this.sendPoints(points.chunks(name, Number(rows), most), signal);
        outage.heard();
        return infoFrom(replied(reply));
      } catch (error) {
        const ours = outage.explain(asOurs(error));
        if (ours === error || signal.aborted) throw ours;
        await outage.waitOrThrow(error as grpc.ServiceError, ours);
      }
    }
  }

  /** One call of Reconstruct: these messages, the server's reply. Throws the grpc.ServiceError. */
  private async sendPoints(
    chunks: Iterable<PointsChunk>,
    signal?: AbortSignal,
  ): Promise<ReconstructReply__Output> {
    let settle: (error: grpc.ServiceError | null, reply?: ReconstructReply__Output) => void;
    const reply = new Promise<ReconstructReply__Output>((resolve, reject) => {
      settle = (error, reply) =>
        reply ? resolve(reply) : reject(error ?? protocolError("it took points without a reply"));
    });
    const call = this.stub.Reconstruct((error, reply) => settle(error, reply));
    const over = reply.then(
      () => true,
      () => true,
    );
    const cancel = () => call.cancel();
    signal?.addEventListener("abort", cancel);
    if (signal?.aborted) cancel();
    try {
      for (const chunk of chunks) {
        // Where the reader is slow, or the call has ended before all was sent.
        const drained = new Promise<boolean>((resolve) => call.write(chunk, () => resolve(false)));
        if (await Promise.race([drained, over])) break;
      }
      call.end();
      return await reply;
    } finally {
      signal?.removeEventListener("abort", cancel);
    }
  }

  /** A mesh as it stands. Throws MeshNotFound. */
  async get(name: string): Promise<MeshInfo> {
    const call: Unary<object, Mesh__Output> = this.stub.GetMesh.bind(this.stub);
    return infoFrom(await this.unary(call, { name }));
  }

  /** All meshes, oldest first, fetched page by page. */
  async *list(pageSize = 0): AsyncGenerator<MeshInfo> {
    const call: Unary<object, ListMeshesResponse__Output> = this.stub.ListMeshes.bind(this.stub);
    let pageToken = "";
    do {
      const page = await this.unary(call, { pageSize, pageToken });
      yield* page.meshes.map(infoFrom);
      pageToken = page.nextPageToken;
    } while (pageToken);
  }

  /** Ends a mesh; what there is of it stays readable. With `once` a lost server is an error. */
  async cancel(name: string, { once = false } = {}): Promise<MeshInfo> {
    const call: Unary<object, Mesh__Output> = this.stub.CancelMesh.bind(this.stub);
    return infoFrom(await this.unary(call, { name }, { once }));
  }

  /** Cancels a mesh if it runs, and forgets it. */
  async delete(name: string, { once = false } = {}): Promise<void> {
    const outage = new Outage(this.patience);
    const call: Unary<object, object> = this.stub.DeleteMesh.bind(this.stub);
    try {
      await this.unary(call, { name }, { once, outage });
    } catch (error) {
      // Else an attempt whose answer was lost has done it.
      if (!(error instanceof MeshNotFound && outage.lasts)) throw error;
    }
  }

  /** What the server is and allows. */
  async info(): Promise<ServerInfo__Output> {
    const call: Unary<object, ServerInfo__Output> = this.stub.GetServerInfo.bind(this.stub);
    return this.unary(call, {});
  }

  /** Has this server examine an oracle: see check(). */
  async examine(oracle: Oracle, epsilon: number): Promise<CheckReport__Output> {
    const call = this.stub.Examine({ spec: this.specOf(oracle, { epsilon }) });
    let failure: unknown;
    try {
      for await (const response of call) {
        const { mesh, report } = response as ExamineResponse__Output;
        if (report) return report;
        if (!mesh) continue;
        await this.serve(oracle, mesh.name).catch((error: unknown) => (failure = error));
      }
    } catch (error) {
      throw (failure ?? fromRpc(error as grpc.ServiceError)) as Error; // there was no examination
    }
    throw protocolError("it ended an examination without a report");
  }

  /** Serves a mesh with this oracle until it is over; the state it ended in, e.g. "SUCCEEDED". */
  async serve(oracle: Oracle, name: string, options: WorkerOptions = {}): Promise<string> {
    return this.worker(oracle, name, options).run();
  }

  /** A worker to run() and stop(). A `quiet` one leaves it to others to report an outage. */
  worker(
    oracle: Oracle,
    name: string,
    options: WorkerOptions & { quiet?: boolean; onFailure?: (error: unknown) => boolean } = {},
  ): Worker {
    const outage = new Outage(this.patience, options.quiet);
    return new Worker(
      this.stub,
      new CheckedOracle(oracle),
      name,
      options,
      outage,
      options.onFailure,
    );
  }

  /** The mesh's events as they come, in the protocol's own messages, across lost connections. */
  watch(name: string, fromRevision = 0, progressOnly = false): Stream<WatchMeshResponse__Output> {
    const request = { name, fromRevision, progressOnly };
    return new Stream(
      () => this.stub.WatchMesh(request),
      (event) => {
        if (event.delta?.complete) request.fromRevision = event.delta.delta?.revision ?? 0;
        else if (event.resetMesh) request.fromRevision = 0;
        return event.final != null;
      },
      new Outage(this.patience),
    );
  }

  /** A mesh as it was at one revision, 0 being the newest, in the protocol's own messages. */
  parts(name: string, revision = 0): Stream<DownloadMeshResponse__Output> {
    const request = { name, revision, position: 0 };
    return new Stream(
      () => this.stub.DownloadMesh(request),
      (part) => {
        request.revision = part.revision;
        request.position = part.nextPosition;
        return part.complete;
      },
      new Outage(this.patience),
    );
  }

  close(): void {
    this.stub.close();
  }

  private connect(): Promise<void> {
    // What is wrong the next attempt will tell.
    const until = Date.now() + 1000 * CONNECT_SECONDS;
    return new Promise((resolve) => this.stub.waitForReady(until, () => resolve()));
  }

  private async unary<Request, Reply>(
    call: Unary<Request, Reply>,
    request: Request,
    { once = false, outage = new Outage(this.patience) } = {},
  ): Promise<Reply> {
    if (once) outage.stop();
    for (;;) {
      const deadline = Date.now() + 1000 * RECONNECT.call;
      const [error, reply] = await new Promise<[grpc.ServiceError | null, Reply | undefined]>(
        (resolve) => call(request, { deadline }, (error, reply) => resolve([error, reply])),
      );
      if (!error && reply !== undefined) {
        outage.heard();
        return reply;
      }
      const failed = error ?? new StellateError("the server answered nothing");
      if (failed instanceof StellateError) throw failed;
      await outage.waitOrThrow(failed, fromRpc(failed));
    }
  }
}

function replied({ mesh }: ReconstructReply__Output): Mesh__Output {
  if (!mesh) throw protocolError("it took points without saying of what mesh");
  return mesh;
}

function asOurs(error: unknown): StellateError {
  return error instanceof StellateError ? error : fromRpc(error as grpc.ServiceError);
}
