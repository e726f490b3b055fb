// Points in, a mesh out.
import type { Client } from "./client.js";
import { Cancelled, NotCertified, protocolError } from "./errors.js";
import { checkSave, type Mesh } from "./mesh.js";
import { infoFrom, type MeshInfo, type Progress, progressFrom } from "./report.js";
import { assemble, connect, type Connection, judged } from "./session.js";
import { CheckedPoints, type PointOptions } from "./upload.js";

export interface ReconstructOptions extends Connection, PointOptions {
  onProgress?: (progress: Progress) => void;
  /** Aborting it cancels the mesh: Cancelled. */
  signal?: AbortSignal;
}

/**
 * Makes a mesh of points on a manifold, or near it: [n, d], one point after the other. Point i is vertex i of
 * the mesh; `mesh.places` says what became of it. `requireCertified`: a mesh that is not certified is
 * NotCertified. `save`: a file to write.
 */
export async function reconstruct(
  points: Float64Array,
  options: ReconstructOptions & { requireCertified?: boolean; save?: string },
): Promise<Mesh> {
  const { requireCertified, save, onProgress, signal, ...rest } = options;
  const { server, credentials, reconnectSeconds, keepaliveSeconds, onOutage, headers, ...asked } =
    rest;
  const checked = new CheckedPoints(points, asked);
  if (save !== undefined) checkSave(save, asked.dimension, asked.ambientDimension);
  signal?.throwIfAborted();
  const link = { server, credentials, reconnectSeconds, keepaliveSeconds, onOutage, headers };
  const [client, close] = await connect(link);
  try {
    const info = await client.declarePoints(checked);
    try {
      const mesh = await finished(client, info, checked, onProgress, signal);
      if (save !== undefined) await mesh.save(save);
      if (requireCertified && !mesh.certified) {
        throw new NotCertified(`the mesh is not certified: ${mesh.report?.verdict}`, { mesh });
      }
      return mesh;
    } finally {
      await client.delete(info.name, { once: true }).catch(() => {}); // it ends with its server
    }
  } finally {
    await close();
  }
}

async function finished(
  client: Client,
  info: MeshInfo,
  points: CheckedPoints,
  onProgress: ((progress: Progress) => void) | undefined,
  signal: AbortSignal | undefined,
): Promise<Mesh> {
  const watch = client.watch(info.name, 0, true);
  const ending = new AbortController(); // of the upload
  let failure: { error: unknown } | undefined;
  const upload = client.upload(info.name, points, ending.signal).catch((error: unknown) => {
    failure = { error };
    watch.close();
  });
  const leave = () => watch.close();
  signal?.addEventListener("abort", leave);
  try {
    let final: MeshInfo | undefined;
    for await (const event of watch) {
      if (event.progress) onProgress?.(progressFrom(event.progress));
      else if (event.final) final = infoFrom(event.final);
    }
    if (signal?.aborted) throw new Cancelled("the reconstruction is cancelled");
    // How the mesh ended says more than why its upload was refused then.
    if (!final && failure) {
      const now = await client.get(info.name);
      if (now.over) final = now;
      else throw failure.error;
    }
    if (!final) throw protocolError("it ended the watch too early");
    return judged(await assemble(client, final, 0), final);
  } finally {
    signal?.removeEventListener("abort", leave);
    ending.abort();
    await upload;
  }
}
