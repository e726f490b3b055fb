// Where a mesh is at fault, on the screen.
import type { Look } from "./look";
import type { FromWorker, Scene } from "./messages";
import { extent } from "./paint";
import type { MeshStore } from "./store";

export interface Faults {
  all: number[][]; // ids of each that can be shown
  chosen: number[];
}

// Of those that the certificate names, `width` ids each. What is beyond the boundary has no place.
export function faultsIn(
  store: MeshStore,
  found: { ids: Uint32Array; width: number } | undefined,
  chosen: number,
): Faults {
  if (!found) return { all: [], chosen: [] };
  const { ids, width } = found;
  const each = Array.from({ length: ids.length / width }, (_, i) =>
    [...ids.subarray(i * width, (i + 1) * width)].filter((id) => id < store.vertices),
  );
  return { all: each, chosen: each[chosen] ?? [] };
}

// Of a surface about these vertices, on the screen; zero where there is none.
function normalOf(
  store: MeshStore,
  projected: Float32Array,
  ids: number[],
): [number, number, number] {
  const wanted = new Set(ids);
  const sum: [number, number, number] = [0, 0, 0];
  if (store.k !== 2) return sum;
  for (let at = 0; at < store.simplices * 3; at += 3) {
    const cell = store.cells.subarray(at, at + 3);
    if (!cell.some((id) => wanted.has(id))) continue;
    const [a, b] = [1, 2].map((v) =>
      [0, 1, 2].map((i) => projected[3 * cell[v] + i] - projected[3 * cell[0] + i]),
    );
    const cross = [0, 1, 2].map((i) => {
      const [j, l] = [(i + 1) % 3, (i + 2) % 3];
      return a[j] * b[l] - a[l] * b[j];
    });
    // Triangles are turned this way or that.
    const side = cross.reduce((dot, x, i) => dot + x * sum[i], 0) < 0 ? -1 : 1;
    cross.forEach((x, i) => (sum[i] += side * x));
  }
  return sum;
}

// All edges of simplices with one of these vertices, as ids.
function starEdges(store: MeshStore, ids: number[]): number[] {
  const wanted = new Set(ids);
  const width = store.k + 1;
  const edges: number[] = [];
  for (let at = 0; at < store.simplices * width; at += width) {
    const cell = store.cells.subarray(at, at + width);
    if (!cell.some((id) => wanted.has(id))) continue;
    for (let a = 0; a < width; a++) {
      for (let b = a + 1; b < width; b++) edges.push(cell[a], cell[b]);
    }
  }
  return edges;
}

type Marks = Pick<Scene, "faults" | "faultEdges" | "chosen" | "chosenEdges">;

export function marksOf(store: MeshStore, projected: Float32Array, faults: Faults): Marks {
  const at = (id: number) => [...projected.subarray(3 * id, 3 * id + 3)];
  const there = (ids: number[]) => Float32Array.from(ids.flatMap(at));
  const edges = faults.all.flatMap((ids) =>
    ids.flatMap((a, i) => ids.slice(i + 1).flatMap((b) => [a, b])),
  );
  return {
    faults: there(faults.all.flat()),
    faultEdges: there(edges),
    chosen: there(faults.chosen),
    chosenEdges: there(faults.chosen.length > 0 ? starEdges(store, faults.chosen) : []),
  };
}

// Of a vertex or a simplex.
export function pinOf(
  store: MeshStore,
  projected: Float32Array,
  ids: number[],
): Pick<Scene, "pinned" | "pinnedEdges"> {
  const known = ids.filter((id) => id < store.vertices);
  const marks = marksOf(store, projected, { all: [known], chosen: [] });
  return { pinned: marks.faults, pinnedEdges: marks.faultEdges };
}

type Flight = Extract<FromWorker, { type: "fly" }>;

// To the chosen one, near enough to see it, far enough for all simplices about it.
export function flightTo(
  store: MeshStore,
  look: Look,
  projected: Float32Array,
  epsilon: number,
  { chosen }: Faults,
): Flight | null {
  if (chosen.length === 0) return null;
  const mean = (of: (id: number) => number) =>
    chosen.reduce((sum, id) => sum + of(id), 0) / chosen.length;
  const centre: Flight["centre"] = [0, 1, 2].map((i) =>
    mean((id) => projected[3 * id + i]),
  ) as Flight["centre"];
  let radius = 0;
  for (const id of starEdges(store, chosen)) {
    radius = Math.max(radius, Math.hypot(...centre.map((c, i) => projected[3 * id + i] - c)));
  }
  const [low, high] = extent(store, look.axis); // where the slice has to be to show it
  return {
    type: "fly",
    centre,
    radius: radius || epsilon,
    normal: normalOf(store, projected, chosen),
    level: (mean((id) => store.points[id * store.d + look.axis]) - low) / (high - low || 1),
    text: `${chosen.length === 1 ? "vertex" : "vertices"} ${chosen.join(" ")}`,
  };
}
