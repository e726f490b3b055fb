// From a mesh and a look at it to what can be drawn: triangles or segments in space.
import { boundaryOf, wallOf } from "./boundary";
import type { Bare, Look, Palette, Shape } from "./look";
import { cutOff } from "./cut";
import { extent, paintOf, type Paint } from "./paint";
import { faces, kMostSegments, slice } from "./slice";
import type { MeshStore } from "./store";

export function project(store: MeshStore, frame: number[]): Float32Array {
  const { d, points, vertices, units } = store;
  const out = new Float32Array(3 * vertices);
  const terms: [row: number, column: number, weight: number][] = [];
  frame.forEach((weight, i) => {
    if (weight !== 0) terms.push([Math.floor(i / d), i % d, weight / units[i % d]]);
  });
  for (const [row, column, weight] of terms) {
    for (let v = 0; v < vertices; v++) out[3 * v + row] += weight * points[v * d + column];
  }
  return out;
}

// These simplices, `size` ids each, of vertices of their own: each has the value of its cell.
function apart(
  projected: Float32Array,
  ids: ArrayLike<number>,
  size: number,
  palette: Palette,
  valueOf: (row: number) => number,
  cells: ArrayLike<number> | null,
): Shape {
  const positions = new Float32Array(3 * ids.length);
  const values = new Float32Array(ids.length);
  for (let i = 0; i < ids.length; i++) {
    positions.set(projected.subarray(3 * ids[i], 3 * ids[i] + 3), 3 * i);
    values[i] = valueOf(Math.floor(i / size));
  }
  return {
    kind: size === 3 ? "triangles" : "segments",
    positions,
    values,
    palette,
    index: null,
    cells,
  };
}

function edges(store: MeshStore, projected: Float32Array, paint: Paint): Shape {
  const index: number[] = [];
  const cells: number[] = [];
  faces(store, 2, ([p, q], cell) => {
    cells.push(cell);
    return index.push(p, q) < 2 * kMostSegments;
  });
  const { values, palette, byCell } = paint;
  if (byCell) return apart(projected, index, 2, palette, (row) => byCell(cells[row]), cells);
  return {
    kind: "segments",
    positions: projected,
    values,
    palette,
    index: Uint32Array.from(index),
    cells,
  };
}

// Whole simplices below the hyperplane: of a surface the triangles, of a 3-manifold the shell of
// triangles that parts them from the rest.
function below(
  store: MeshStore,
  projected: Float32Array,
  { values, palette, byCell }: Paint,
  height: (v: number) => number,
): Shape {
  const { k, cells, simplices } = store;
  const width = k + 1;
  const chosen: number[] = [];
  for (let cell = 0; cell < simplices; cell++) {
    let all = true;
    for (let i = 0; i < width && all; i++) all = height(cells[cell * width + i]) < 0;
    if (all) chosen.push(cell);
  }
  const part = (ids: ArrayLike<number>, of: number[]): Shape =>
    byCell
      ? apart(projected, ids, 3, palette, (row) => byCell(of[row]), of)
      : {
          kind: "triangles",
          positions: projected,
          values,
          palette,
          index: Uint32Array.from(ids),
          cells: of,
        };
  if (k === 2) {
    const index = new Uint32Array(3 * chosen.length);
    chosen.forEach((cell, i) => index.set(cells.subarray(3 * cell, 3 * cell + 3), 3 * i));
    return part(index, chosen);
  }
  const once = new Map<string, { ids: number[]; cell: number }>();
  for (const cell of chosen) {
    for (let omit = 0; omit < 4; omit++) {
      const ids = [0, 1, 2, 3].filter((i) => i !== omit).map((i) => cells[4 * cell + i]);
      const key = ids.join(" ");
      if (!once.delete(key)) once.set(key, { ids, cell });
    }
  }
  const shell = [...once.values()];
  return part(
    shell.flatMap(({ ids }) => ids),
    shell.map(({ cell }) => cell),
  );
}

// The triangles that bound a 3-manifold.
function surface(
  store: MeshStore,
  projected: Float32Array,
  { values, palette, byCell }: Paint,
  look: Look,
): Shape {
  const { triangles, cells } = boundaryOf(store);
  if (look.colour === "wall") {
    const wall = (row: number) => wallOf(store, triangles.slice(3 * row, 3 * row + 3));
    return apart(projected, triangles, 3, "wall", wall, cells);
  }
  if (byCell) return apart(projected, triangles, 3, palette, (row) => byCell(cells[row]), cells);
  const index = Uint32Array.from(triangles);
  return { kind: "triangles", positions: projected, values, palette, index, cells };
}

export function bareOf(store: MeshStore, projected: Float32Array, look: Look): Bare {
  const { k, vertices, simplices, cells } = store;
  const covered = new Uint8Array(vertices);
  for (let i = 0; i < simplices * (k + 1); i++) covered[cells[i]] = 1;
  const bare: number[] = [];
  covered.forEach((is, v) => is || bare.push(v));
  const positions = new Float32Array(3 * bare.length);
  bare.forEach((v, i) => positions.set(projected.subarray(3 * v, 3 * v + 3), 3 * i));
  const { places } = store;
  if (look.colour === "place" && places) {
    return {
      positions,
      values: Float32Array.from(bare, (v) => places[v]),
      palette: "place",
      ids: bare,
    };
  }
  return {
    positions,
    values: Float32Array.from(bare, (v) => v / vertices),
    palette: "map",
    ids: bare,
  };
}

// Of vertices, above the slice. One on the very level counts as above: no segment of length zero over
// nothing.
export function heightOf(store: MeshStore, look: Look): (v: number) => number {
  const [low, high] = extent(store, look.axis);
  const level = low + look.level * (high - low);
  const { points, d } = store;
  return (v) => points[v * d + look.axis] - level;
}

export function shapeOf(
  store: MeshStore,
  look: Look,
  projected: Float32Array,
  epsilon: number,
): Shape {
  const paint = paintOf(store, look, epsilon);
  const { k, cells, simplices } = store;
  if (look.part === "boundary" && k === 3) return surface(store, projected, paint, look);
  if (look.part === "whole" || k === 1) {
    if (k !== 2) return edges(store, projected, paint);
    const { values, palette, byCell } = paint;
    const index = cells.slice(0, 3 * simplices);
    if (byCell) return apart(projected, index, 3, palette, byCell, null);
    return { kind: "triangles", positions: projected, values, palette, index, cells: null };
  }
  const height = heightOf(store, look);
  if (look.part === "cut" && k <= 3) return cutOff(store, projected, paint, look, height);
  if (look.part === "slice" || k > 3) return slice(store, projected, paint, height);
  return below(store, projected, paint, height);
}
