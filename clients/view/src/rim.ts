// Where a mesh with boundary ends, as far as it is to be seen.
import { boundaryOf, wallOf } from "./boundary";
import type { Look, Rim } from "./look";
import { heightOf } from "./shape";
import type { MeshStore } from "./store";

const rows = (ids: number[], size: number): number[][] =>
  Array.from({ length: ids.length / size }, (_, i) => ids.slice(i * size, (i + 1) * size));

// Where the slice of a 3-manifold ends.
function cut(store: MeshStore, look: Look, projected: Float32Array): Rim {
  const height = heightOf(store, look);
  const segments: number[] = [];
  const walls: number[] = [];
  for (const ids of rows(boundaryOf(store).triangles, 3)) {
    const above = ids.filter((v) => height(v) >= 0);
    const below = ids.filter((v) => height(v) < 0);
    if (above.length === 0 || below.length === 0) continue;
    const [alone, others] = above.length === 1 ? [above[0], below] : [below[0], above];
    for (const other of others) {
      const t = height(alone) / (height(alone) - height(other));
      for (let i = 0; i < 3; i++)
        segments.push((1 - t) * projected[3 * alone + i] + t * projected[3 * other + i]);
    }
    walls.push(wallOf(store, ids));
  }
  return {
    segments: Float32Array.from(segments),
    walls: Uint8Array.from(walls),
    points: new Float32Array(),
    pointWalls: new Uint8Array(),
  };
}

// As much of these segments as is below; `height` of their ends tells.
function clipped(
  segments: number[][],
  projected: Float32Array,
  height: (v: number) => number,
): { ids: number[]; ends: number[] }[] {
  return segments.flatMap((ids) => {
    const [p, q] = height(ids[0]) < 0 ? ids : [ids[1], ids[0]];
    if (height(p) >= 0) return [];
    const t = height(q) < 0 ? 1 : height(p) / (height(p) - height(q));
    const from = [...projected.subarray(3 * p, 3 * p + 3)];
    const to = from.map((x, i) => (1 - t) * x + t * projected[3 * q + i]);
    return [{ ids, ends: [...from, ...to] }];
  });
}

// Of what is cut open: the rim as far as it is left, and that of the cut.
function cutRim(store: MeshStore, look: Look, projected: Float32Array): Rim {
  const height = heightOf(store, look);
  const boundary = boundaryOf(store);
  const left = clipped(rows(boundary.segments, 2), projected, height);
  const points = boundary.points.filter((v) => height(v) < 0);
  const across = store.k === 3 ? cut(store, look, projected) : null;
  return {
    segments: Float32Array.from([...left.flatMap(({ ends }) => ends), ...(across?.segments ?? [])]),
    walls: Uint8Array.from([
      ...left.map(({ ids }) => wallOf(store, ids)),
      ...(across?.walls ?? []),
    ]),
    points: Float32Array.from(points.flatMap((v) => [...projected.subarray(3 * v, 3 * v + 3)])),
    pointWalls: Uint8Array.from(points.map((v) => wallOf(store, [v]))),
  };
}

export function rimOf(store: MeshStore, look: Look, projected: Float32Array): Rim {
  if (look.part === "slice" && store.k === 3) return cut(store, look, projected);
  if (look.part === "cut" && store.k < 4) return cutRim(store, look, projected);
  const height = heightOf(store, look);
  const seen = (ids: number[]) =>
    look.part === "whole" ||
    look.part === "boundary" ||
    (look.part === "below" && ids.every((v) => height(v) < 0));
  const at = (id: number) => [...projected.subarray(3 * id, 3 * id + 3)];
  const boundary = boundaryOf(store);
  const segments = rows(boundary.segments, 2).filter(seen);
  const points = rows(boundary.points, 1).filter(seen);
  return {
    segments: Float32Array.from(segments.flat().flatMap(at)),
    walls: Uint8Array.from(segments.map((ids) => wallOf(store, ids))),
    points: Float32Array.from(points.flat().flatMap(at)),
    pointWalls: Uint8Array.from(points.map((ids) => wallOf(store, ids))),
  };
}
