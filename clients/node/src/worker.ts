// A worker: a ServeOracle stream, on which the server asks and an oracle answers.
import { setTimeout as sleep } from "node:timers/promises";
import { FailedPrecondition, fromRpc, InvalidArgument } from "./errors.js";
import type { QueryChunk__Output } from "./generated/stellate/v1/QueryChunk.js";
import type { ServeOracleRequest } from "./generated/stellate/v1/ServeOracleRequest.js";
import type { ServeOracleResponse__Output } from "./generated/stellate/v1/ServeOracleResponse.js";
import type { Welcome__Output } from "./generated/stellate/v1/Welcome.js";
import type { CheckedOracle, Found } from "./oracle.js";
import type { Outage } from "./retry.js";
import { enumName, grpc, numbers, type Stub, toWire } from "./wire.js";

const ANSWER_BYTES = 3_000_000; // an answer has to stay below the server's 4 MB
const MESSAGE_BYTES = 4000;
const BUSY_SHARE = 0.25; // of the time that the server bears silence
const LOOK_AGAIN = 100; // milliseconds

type Call = grpc.ClientDuplexStream<ServeOracleRequest, ServeOracleResponse__Output>;

/** Thrown for what broke the stream; kept apart from what an oracle may throw. */
class Broken extends Error {
  constructor(readonly error: grpc.ServiceError) {
    super(error.message);
  }
}

/** The oracle's answers to one chunk, as they are sent. Throws whatever the oracle does. */
export async function answer(
  oracle: CheckedOracle,
  chunk: QueryChunk__Output,
): Promise<ServeOracleRequest> {
  const { d, k } = oracle;
  const points = numbers(chunk.points, -1, d);
  const n = points.length / d;
  let reply;
  if (chunk.kind === "QUERY_KIND_INTERSECT_FLAT") {
    const bases = numbers(chunk.bases, n, d, k);
    reply = await oracle.intersections(points, bases, numbers(chunk.radii, n), n);
  } else if (chunk.kind === "QUERY_KIND_CLOSEST_POINT") {
    reply = await oracle.closestPoints(points, n, chunk.face);
  } else {
    throw new Error(`the server asks a question of kind ${chunk.kind}, unknown to this client`);
  }
  const all = reply.found.every((one) => one !== 0);
  return {
    answers: {
      lease: chunk.lease,
      points: toWire(reply.points, n, d),
      found: all ? undefined : Buffer.from(reply.found.map((one) => (one ? 1 : 0))),
      tangents: chunk.wantTangents ? toWire(await oracle.tangents(reply, n), n, d, k) : undefined,
      sizes: chunk.wantSizes ? toWire(await oracle.sizes(reply, n), n) : undefined,
      ...(chunk.wantClearances ? await wallsAt(oracle, reply, n, chunk.face) : {}),
    },
  };
}

/** What the walls are at the points, and, on a face, its conormals. */
async function wallsAt(oracle: CheckedOracle, reply: Found, n: number, face: number[]) {
  const clearances = toWire(await oracle.clearances(reply, n), n, oracle.walls);
  if (!face.length) return { clearances };
  const conormals = await oracle.conormals(reply, n, face);
  return { clearances, conormals: toWire(conormals, n, face.length, oracle.d) };
}

export interface WorkerOptions {
  /** Its name, for logs. */
  worker?: string;
  /** Most points in one call of the oracle; by default the server decides. */
  maxChunk?: number;
}

/** Serves one mesh until it is over, or stop() is called; a lost stream is opened again. */
export class Worker {
  private call?: Call;
  private stopped = false;
  private readonly hello: { mesh: string; worker: string; maxChunkQueries: number };

  constructor(
    private readonly stub: Stub,
    private readonly oracle: CheckedOracle,
    mesh: string,
    { worker, maxChunk }: WorkerOptions,
    private readonly outage: Outage,
    /** Gets what the oracle threw; returns whether the server gets it as well. */
    private readonly onFailure: (error: unknown) => boolean = () => true,
  ) {
    if (maxChunk !== undefined && !(Number.isInteger(maxChunk) && maxChunk >= 1)) {
      throw new InvalidArgument(`maxChunk has to be a whole number from 1 on, and is ${maxChunk}`);
    }
    const { d, k, walls } = oracle;
    const numbers = d * (k + 1 + Math.min(k, walls)) + walls;
    const most = Math.max(1, Math.floor(ANSWER_BYTES / (8 * numbers + 9)));
    const maxChunkQueries = Math.min(most, maxChunk ?? most);
    this.hello = { mesh, worker: worker ?? "", maxChunkQueries };
  }

  /** The state that the mesh ended in, "" when stopped before. Throws what the oracle throws. */
  async run(): Promise<string> {
    for (;;) {
      try {
        return await this.serve();
      } catch (broken) {
        if (!(broken instanceof Broken)) throw broken;
        if (this.stopped) return "";
        const ours = fromRpc(broken.error);
        if (ours instanceof FailedPrecondition) {
          const state = await this.howItEnded(); // before this worker came, or while it was away
          if (state) return state;
        }
        try {
          await this.outage.waitOrThrow(broken.error, ours);
        } catch (error) {
          if (this.stopped) return "";
          throw error;
        }
      }
    }
  }

  /** Ends the stream: what is unanswered goes to another worker. */
  stop(): void {
    this.stopped = true;
    this.outage.stop();
    this.call?.cancel();
  }

  /** The mesh is over: a lost stream is not opened again. */
  finish(): void {
    this.outage.stop();
  }

  private async serve(): Promise<string> {
    const call = (this.call = this.stub.ServeOracle());
    let lease: number | undefined; // of the chunk that the oracle is at
    let teller: NodeJS.Timeout | undefined;
    let failure: { error: unknown } | undefined;
    let state = "";
    call.write({ hello: this.hello });
    if (this.stopped) call.cancel();
    try {
      for await (const response of responses(call)) {
        if (failure) continue; // until the server has taken note
        this.outage.heard();
        if (response.queries) {
          lease = response.queries.lease;
          try {
            call.write(await answer(this.oracle, response.queries));
          } catch (error) {
            failure = { error };
            if (this.onFailure(error)) call.write({ failure: { lease, message: words(error) } });
            call.end(); // without a word as a worker that has to go
          }
          lease = undefined;
        } else if (response.welcome) {
          this.compare(response.welcome);
          const every = 1000 * BUSY_SHARE * response.welcome.answerSeconds;
          if (every > 0 && !teller) {
            teller = setInterval(() => {
              if (lease !== undefined) call.write({ busy: { lease } });
            }, every).unref();
          }
        } else if (response.over) {
          state = enumName(response.over.state, "MESH_STATE_");
          call.end();
        }
      }
    } catch (error) {
      if (!failure) throw error; // else ABORTED, as announced
    } finally {
      clearInterval(teller);
      call.cancel(); // unless it has ended
    }
    if (failure) throw failure.error;
    return state;
  }

  /** Of a mesh that takes no more workers; "" if that cannot be found out. */
  private async howItEnded(): Promise<string> {
    for (let i = 0; i < 300 && !this.stopped; i++) {
      const mesh = await new Promise<{ state: string; endTime: unknown } | undefined>((resolve) =>
        this.stub.GetMesh({ name: this.hello.mesh }, (error, reply) =>
          resolve(error || !reply ? undefined : { state: reply.state, endTime: reply.endTime }),
        ),
      );
      if (!mesh) return "";
      if (mesh.endTime) return enumName(mesh.state, "MESH_STATE_");
      await sleep(LOOK_AGAIN); // it is just about to end
    }
    return "";
  }

  /** Leaves the mesh alone if this oracle is not of its kind. */
  private compare(welcome: Welcome__Output): void {
    const { k, d, capabilities } = this.oracle;
    const names = ["intersectFlat", "tangentBasis", "localSize"] as const;
    const missing = names.filter((name) => welcome.oracle?.[name] && !capabilities[name]);
    let problem = "";
    if (welcome.dimension !== k || welcome.ambientDimension !== d) {
      problem =
        `the mesh has dimension ${welcome.dimension} in R^${welcome.ambientDimension}, ` +
        `and this oracle's manifold has dimension ${k} in R^${d}`;
    } else if (welcome.walls !== this.oracle.walls) {
      problem = `the mesh has ${welcome.walls} walls, and this manifold ${this.oracle.walls}`;
    } else if (missing.length) {
      problem = `the mesh was declared with ${missing.join(" and ")}, which this oracle lacks`;
    }
    if (problem) {
      throw new InvalidArgument(`${problem}: all workers of a mesh have to serve one manifold`);
    }
  }
}

async function* responses(call: Call): AsyncGenerator<ServeOracleResponse__Output> {
  try {
    for await (const response of call) yield response as ServeOracleResponse__Output;
  } catch (error) {
    throw new Broken(error as grpc.ServiceError);
  }
}

/** What the oracle threw, as the server gets it. */
function words(error: unknown): string {
  const said = Buffer.from(String(error)).subarray(0, MESSAGE_BYTES).toString();
  return said.replace(/\ufffd+$/, ""); // a character that was cut
}
