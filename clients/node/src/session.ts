// A mesh from its declaration to its end: the server asks, the oracle answers, we watch.
import { setTimeout as sleep } from "node:timers/promises";
import { Checkpoint } from "./checkpoint.js";
import { Client, type ClientOptions } from "./client.js";
import { choose, finer } from "./epsilon.js";
import { Cancelled, errorClass, FailedPrecondition, InvalidArgument } from "./errors.js";
import { NotCertified, protocolError, StellateError } from "./errors.js";
import type { Orientation__Output } from "./generated/stellate/v1/Orientation.js";
import { checkBits, GrowingComplex } from "./growth.js";
import { checkSave, Mesh } from "./mesh.js";
import type { Oracle } from "./oracle.js";
import { infoFrom, type MeshInfo, type Progress, progressFrom } from "./report.js";
import { bytesOfBits, isSet, joined, sortedOrder, takeBits, takeRows } from "./rows.js";
import { Server } from "./server.js";
import type { MeshOptions } from "./spec.js";
import type { Worker, WorkerOptions } from "./worker.js";
import { Places } from "./places.js";
import { indices, numbers } from "./wire.js";

const FAREWELL = 2000; // milliseconds that a worker may take to end when no call waits for it

/** Where the server is; without `server` one is started, and stopped afterwards. */
export interface Connection extends ClientOptions {
  server?: string | Server | Client;
}

export interface RunOptions
  extends Connection, Omit<MeshOptions, "epsilon">, Omit<WorkerOptions, "worker"> {
  /**
   * Largest circumradius of a simplex, a length; "auto": what chooseEpsilon() says, and, where the mesh
   * came out too coarse to certify, a quarter of the reach that its certificate shows, twice at most.
   */
  epsilon: number | "auto";
  /** Called with each epsilon that "auto" takes, before it is meshed with, and why. */
  onEpsilon?: (epsilon: number, reason: string) => void;
  /** Streams that call the oracle in parallel; more than one helps an async oracle. Default 1. */
  workers?: number;
  onProgress?: (progress: Progress) => void;
  /**
   * A directory, made if it is not there, in which the mesh outlives this program: the same call goes
   * on from where the last one was aborted or killed, or its oracle threw, and gives a mesh that is
   * finished immediately. For private servers; one that is named keeps its meshes with --data-dir.
   */
  checkpoint?: string;
  /** Aborting it cancels the mesh: Cancelled, with the mesh so far in the error's `mesh`. */
  signal?: AbortSignal;
}

/** A client, and what has to be closed after it. */
export async function connect(options: Connection): Promise<[Client, () => Promise<void>]> {
  const { server, credentials, reconnectSeconds, keepaliveSeconds, onOutage, headers } = options;
  if (server instanceof Client) {
    if (credentials) throw new InvalidArgument("a Client has its credentials already");
    return [server, async () => {}];
  }
  if (!server && credentials) throw new InvalidArgument("credentials are for a server: say which");
  const at = server ?? (await Server.start());
  const stop = async () => (server ? undefined : (at as Server).close());
  try {
    const given = { credentials, reconnectSeconds, keepaliveSeconds, onOutage, headers };
    const client = new Client(at, given);
    return [client, () => (client.close(), stop())];
  } catch (error) {
    await stop();
    throw error;
  }
}

/**
 * Meshes the oracle's manifold. `requireCertified`: a mesh that is not proved good is NotCertified.
 * `save`: files to write; a name that cannot work is an error before any question.
 */
export async function mesh(
  oracle: Oracle,
  options: RunOptions & { requireCertified?: boolean; save?: string },
): Promise<Mesh> {
  const { requireCertified, save, ...rest } = options;
  if (save !== undefined) checkSave(save, oracle.dimension, oracle.ambientDimension);
  let last: Mesh | undefined;
  for await (const grown of run(oracle, rest, false)) last = grown;
  if (!last) throw protocolError("it ended the watch too early");
  if (save !== undefined) await last.save(save);
  if (requireCertified && !last.certified) {
    throw new NotCertified(`the mesh is not certified: ${last.report?.verdict}`, { mesh: last });
  }
  return last;
}

/**
 * The mesh as it grows, the last with its report; where epsilon "auto" was too coarse a finer mesh begins
 * after that, from nothing. With the name of a mesh in place of an oracle, one
 * that others serve is watched. Leaving the loop cancels the mesh, or leaves that of others alone.
 */
export function watch(oracle: Oracle, options: RunOptions): AsyncGenerator<Mesh>;
export function watch(
  name: string,
  options: Connection & { onProgress?: (progress: Progress) => void },
): AsyncGenerator<Mesh>;
export async function* watch(
  what: Oracle | string,
  options: RunOptions | Connection,
): AsyncGenerator<Mesh> {
  if (typeof what !== "string") {
    yield* run(what, options as RunOptions, true);
    return;
  }
  if (!options.server)
    throw new InvalidArgument("to watch a mesh by its name, say on which server");
  const [client, close] = await connect(options);
  try {
    const info = await client.get(what);
    yield* follow(client, info, (options as RunOptions).onProgress, true);
  } finally {
    await close();
  }
}

/** One more worker for a mesh: see Client.serve. Throws what the oracle throws. */
export async function serve(
  oracle: Oracle,
  name: string,
  options: Connection & WorkerOptions,
): Promise<string> {
  const [client, close] = await connect(options);
  try {
    return await client.serve(oracle, name, options);
  } finally {
    await close();
  }
}

/** Fetches a mesh that is on a server; one that is not over is refused, or its end waited for. */
export async function download(
  name: string,
  options: Connection & { wait?: boolean; revision?: number },
): Promise<Mesh> {
  const [client, close] = await connect(options);
  try {
    let info = await client.get(name);
    const asItIs = (options.revision ?? 0) > 0;
    if (!info.over && !asItIs) {
      if (!options.wait) throw new FailedPrecondition(`${name} is not over: ${info.state}`);
      for await (const event of client.watch(name, 0, true)) {
        if (event.final) info = infoFrom(event.final);
      }
    }
    const fetched = await assemble(client, info, options.revision ?? 0);
    return asItIs ? fetched : judged(fetched, info);
  } finally {
    await close();
  }
}

export async function assemble(client: Client, info: MeshInfo, wanted: number): Promise<Mesh> {
  const { dimension: k, ambientDimension: d } = info;
  const growth = new GrowingComplex(k, d);
  const cells: Uint32Array[] = [];
  const oriented: OrientedPart[] = [];
  const places = new Places();
  let revision = 0;
  for await (const part of client.parts(info.name, wanted)) {
    revision = part.revision;
    const block = indices(part.cells, -1, k + 1);
    cells.push(block);
    if (block.length) oriented.push({ count: block.length / (k + 1), told: part.orientation });
    growth.addPoints(part.firstVertex, numbers(part.points, -1, d));
    growth.addWalls(part.boundaryVertices, part.boundaryWalls);
    if (part.places) places.add(part.places, d);
  }
  const rows = joined(cells);
  const order = sortedOrder(rows, k + 1);
  const sorted = takeRows(rows, k + 1, order);
  const bits = allBits(oriented, order.length);
  const last = info.over && revision === info.revision;
  return new Mesh(
    k,
    d,
    growth.points(),
    sorted,
    revision,
    last ? info.progress : undefined,
    last ? info.report : undefined,
    growth.walls(),
    bits && takeBits(bits, order),
    places.names(growth.points().length / d),
    places.smoothed(growth.points().length),
  );
}

interface OrientedPart {
  count: number; // of simplices
  told: Orientation__Output | null;
}

/** The orientation of all parts, one after the other; undefined where one is without. */
function allBits(parts: OrientedPart[], count: number): Uint8Array | undefined {
  const bits = new Uint8Array(bytesOfBits(count));
  let at = 0;
  for (const part of parts) {
    if (!part.told?.orientable) return undefined;
    checkBits(part.told.turned, part.count);
    for (let i = 0; i < part.count; i++, at++) {
      if (isSet(part.told.turned, i)) bits[at >> 3] |= 1 << (at & 7);
    }
  }
  return bits;
}

/**
 * A mesh by the events of its watch: at every revision and at its end, or at its end alone. Throws
 * Cancelled, with the mesh so far, once `leaving` is aborted.
 */
export async function* follow(
  client: Client,
  info: MeshInfo,
  onProgress: ((progress: Progress) => void) | undefined,
  every: boolean,
  leaving?: AbortSignal,
): AsyncGenerator<Mesh> {
  const { dimension: k, ambientDimension: d } = info;
  const growth = new GrowingComplex(k, d);
  const stream = client.watch(info.name);
  leaving?.addEventListener("abort", () => stream.close());
  stream.onResume = () => growth.forgetPending();
  let progress: Progress | undefined;
  const soFar = (report?: Mesh["report"]) =>
    new Mesh(
      k,
      d,
      growth.points(),
      growth.simplices(),
      growth.revision,
      progress,
      report,
      growth.walls(),
      report && growth.turned(),
    );
  for await (const event of stream) {
    if (event.delta) {
      if (growth.absorb(event.delta) && every) yield soFar();
    } else if (event.resetMesh) {
      growth.reset();
    } else if (event.orientation) {
      growth.orient(event.orientation);
    } else if (event.progress) {
      progress = progressFrom(event.progress);
      onProgress?.(progress);
      if (progress.phase === "CERTIFYING") growth.settle(); // while the server is busy
    } else if (event.final) {
      const final = infoFrom(event.final);
      progress = final.progress;
      if (progress) onProgress?.(progress);
      yield judged(soFar(final.report), final);
    }
  }
  if (leaving?.aborted) throw new Cancelled("the mesh is left as it is", { mesh: soFar() });
}

export function judged(mesh: Mesh, { state, report }: MeshInfo): Mesh {
  if (state === "CANCELLED") throw new Cancelled("the mesh was cancelled", { mesh });
  if (state === "FAILED") {
    const reason = report?.failure?.reason || "ORACLE_FAILED";
    const message = report?.failure?.message || "the mesh failed, and the server says not why";
    throw new (errorClass(reason))(message, { reason, mesh });
  }
  return mesh;
}

async function* run(oracle: Oracle, options: RunOptions, every: boolean): AsyncGenerator<Mesh> {
  const { workers = 1, onProgress, signal, maxChunk, server, epsilon: wanted, ...more } = options;
  const { checkpoint, onEpsilon, ...rest } = more;
  const { credentials, reconnectSeconds, keepaliveSeconds, onOutage, headers, ...others } = rest;
  if (!Number.isInteger(workers) || workers < 1) {
    throw new InvalidArgument(`workers has to be a whole number from 1 on, and is ${workers}`);
  }
  signal?.throwIfAborted();
  const kept = checkpoint === undefined ? undefined : new Checkpoint(checkpoint);
  if (kept && (server || credentials)) {
    throw new InvalidArgument(
      "a checkpoint is for a private server: one that is named keeps meshes itself",
    );
  }
  const own = await kept?.server();
  const link = { credentials, reconnectSeconds, keepaliveSeconds, onOutage, headers };
  const [client, close] = await connect({ server: own ?? server, ...link });
  const serving = { workers, onProgress, signal, maxChunk, checkpoint };
  let coarse: Mesh | undefined;
  try {
    const taken = wanted === "auto" ? kept?.choice() : undefined;
    let choice = taken ?? (await choose(oracle, wanted));
    for (let next: typeof choice | undefined; ; choice = next) {
      const { epsilon, reason } = choice;
      if (reason) onEpsilon?.(epsilon, reason);
      const spec = client.specOf(oracle, { ...others, epsilon });
      const again = coarse !== undefined;
      const info = await (kept?.declare(client, spec, choice, again) ?? client.createFrom(spec));
      next = undefined;
      for await (const grown of served(client, oracle, info, serving, every)) {
        if (grown.report) {
          grown.report.epsilonReason = reason;
          next = signal?.aborted ? undefined : finer(choice, grown.report);
          coarse = grown;
        }
        if (every || !next) yield grown;
      }
      if (!next) return;
    }
  } catch (error) {
    kept?.forgetAfter(error);
    if (error instanceof StellateError) error.mesh ??= coarse;
    throw error;
  } finally {
    await close();
    await own?.close();
  }
}

async function* served(
  client: Client,
  oracle: Oracle,
  info: MeshInfo,
  options: Pick<RunOptions, "onProgress" | "signal" | "maxChunk" | "checkpoint"> & {
    workers: number;
  },
  every: boolean,
): AsyncGenerator<Mesh> {
  let failure: { error: unknown } | undefined;
  const kept = options.checkpoint !== undefined;
  const leaving = new AbortController(); // a mesh that is kept waits for a better oracle
  const onFailure = (error: unknown) => {
    failure ??= { error };
    if (kept) leaving.abort();
    return !kept;
  };
  const all: Worker[] = Array.from({ length: options.workers }, (_, i) =>
    client.worker(oracle, info.name, {
      worker: `node-${i + 1}`,
      maxChunk: options.maxChunk,
      quiet: true,
      onFailure,
    }),
  );
  // What the server refuses, or its absence, the watch reports.
  const done = all.map((worker) =>
    worker.run().catch((error: unknown) => {
      if (error instanceof InvalidArgument) onFailure(error);
    }),
  );
  const cancel = () =>
    kept ? leaving.abort() : void client.cancel(info.name, { once: true }).catch(() => {});
  options.signal?.addEventListener("abort", cancel);
  if (options.signal?.aborted) cancel(); // while the mesh was declared
  let ended = false;
  try {
    for await (const grown of follow(client, info, options.onProgress, every, leaving.signal)) {
      ended = grown.report !== undefined;
      if (ended) for (const worker of all) worker.finish();
      yield grown;
    }
  } catch (error) {
    // Our own exception says more than the server's account of it.
    if (!failure && kept && leaving.signal.aborted) {
      const { mesh } = error as Cancelled;
      const words = `the mesh is kept in ${options.checkpoint}: the same call goes on from there`;
      throw new Cancelled(words, { mesh });
    }
    if (!failure || (error instanceof Cancelled && !kept)) throw error;
    const ours = failure.error;
    if (ours instanceof StellateError && error instanceof StellateError) ours.mesh = error.mesh;
    throw ours;
  } finally {
    options.signal?.removeEventListener("abort", cancel);
    if (!ended) for (const worker of all) worker.stop();
    await Promise.race([Promise.all(done), sleep(FAREWELL, undefined, { ref: false })]);
    for (const worker of all) worker.stop();
    // It ends with its server, or is kept.
    if (!kept) await client.delete(info.name, { once: true }).catch(() => {});
  }
}
