// What bounds a mesh: (k-1)-faces in one simplex alone, on walls that all their vertices share, and
// what these have in common.
import type { MeshStore } from "./store";

export interface Boundary {
  triangles: number[]; // ids
  cells: number[]; // of each of them, the simplex that it is a side of
  segments: number[]; // of surfaces all of the boundary, else where walls meet
  points: number[]; // ends and corners
  facets: number; // all (k-1)-faces
  parts: number; // that these are connected in
}

interface Face {
  ids: number[];
  walls: bigint; // that all of it lies on
  cell: number; // one that it is of
}

const kNone: Boundary = {
  triangles: [],
  cells: [],
  segments: [],
  points: [],
  facets: 0,
  parts: 0,
};

// As bits, those that all of these lie on.
export function wallsOf(store: MeshStore, ids: number[]): bigint {
  return ids.reduce((walls, id) => walls & (store.walls.get(id) ?? 0n), ~0n);
}

export const kSeveral = 255;

// The one wall that these lie on.
export function wallOf(store: MeshStore, ids: number[]): number {
  const walls = wallsOf(store, ids);
  for (let wall = 0; wall < 64; wall++) {
    if (((walls >> BigInt(wall)) & 1n) === 1n)
      return walls >> BigInt(wall) === 1n ? wall : kSeveral;
  }
  return kSeveral;
}

const without = (ids: number[], omit: number) => ids.filter((_, i) => i !== omit);

function facetsInOne(store: MeshStore): Face[] {
  const width = store.k + 1;
  const once = new Map<string, Face>();
  for (let at = 0; at < store.simplices * width; at += width) {
    const cell = [...store.cells.subarray(at, at + width)];
    if (cell.filter((id) => store.walls.has(id)).length < store.k) continue;
    for (let omit = 0; omit < width; omit++) {
      const ids = without(cell, omit);
      const walls = wallsOf(store, ids);
      const key = ids.join(" ");
      if (walls !== 0n && !once.delete(key)) once.set(key, { ids, walls, cell: at / width });
    }
  }
  return [...once.values()];
}

// Of faces' own faces those that lie on more walls than a face that has them.
function ridges(store: MeshStore, faces: Face[]): Face[] {
  const found = new Map<string, Face>();
  for (const { ids, walls, cell } of faces) {
    for (let omit = 0; omit < ids.length; omit++) {
      const inner = without(ids, omit);
      const more = wallsOf(store, inner);
      if (more !== walls) found.set(inner.join(" "), { ids: inner, walls: more, cell });
    }
  }
  return [...found.values()];
}

function countParts(faces: Face[]): number {
  const above = new Map<number, number>();
  const root = (id: number): number => {
    let top = id;
    while (above.has(top) && above.get(top) !== top) top = above.get(top)!;
    above.set(id, top);
    return top;
  };
  let parts = 0;
  for (const { ids } of faces) {
    for (const id of ids) {
      if (above.has(id)) continue;
      above.set(id, id);
      parts++;
    }
    for (const id of ids) {
      const [a, b] = [root(ids[0]), root(id)];
      if (a === b) continue;
      above.set(b, a);
      parts--;
    }
  }
  return parts;
}

function find(store: MeshStore): Boundary {
  if (store.walls.size === 0) return kNone;
  if (store.isBoundary) return creases(store);
  let faces = facetsInOne(store);
  const found = { ...kNone, facets: faces.length, parts: countParts(faces) };
  for (let size = store.k; size > 0; size--) {
    const ids = faces.flatMap((face) => face.ids);
    if (size === 3) {
      found.triangles = ids;
      found.cells = faces.map((face) => face.cell);
    }
    if (size === 2) found.segments = ids;
    if (size === 1) found.points = ids;
    faces = ridges(store, faces);
  }
  return found;
}

// A boundary alone does not end; where walls meet, it has creases and corners.
function creases(store: MeshStore): Boundary {
  const width = store.k + 1;
  const cells = Array.from({ length: store.simplices }, (_, cell) => {
    const ids = [...store.cells.subarray(cell * width, (cell + 1) * width)];
    return { ids, walls: wallsOf(store, ids), cell };
  });
  const found = { ...kNone };
  let faces = ridges(store, cells);
  for (let size = store.k; size > 0; size--) {
    const ids = faces.flatMap((face) => face.ids);
    if (size === 2) found.segments = ids;
    if (size === 1) found.points = ids;
    faces = ridges(store, faces);
  }
  return found;
}

const known = new WeakMap<MeshStore, { revision: number; boundary: Boundary }>();

export function boundaryOf(store: MeshStore): Boundary {
  const last = known.get(store);
  if (last?.revision === store.revision) return last.boundary;
  const boundary = find(store);
  known.set(store, { revision: store.revision, boundary });
  return boundary;
}

// In words; empty: the mesh has none.
export function describe(store: MeshStore): string {
  const { facets, parts, points } = boundaryOf(store);
  if (facets === 0) return "";
  const counted = (n: number, one: string, many: string) =>
    `${n.toLocaleString("en")} ${n === 1 ? one : many}`;
  if (store.k === 1) return counted(facets, "end", "ends");
  const [one, many] = [
    ["edge", "edges"],
    ["triangle", "triangles"],
  ][store.k - 2] ?? [`${store.k - 1}-face`, `${store.k - 1}-faces`];
  const said = `${counted(facets, one, many)} in ${counted(parts, "part", "parts")}`;
  return points.length > 0 ? `${said}, ${counted(points.length, "corner", "corners")}` : said;
}
