// From a mesh and a look at it to what can be drawn: triangles or segments in space.
import { boundaryOf, wallOf } from "./boundary";
import type { Bare, Look, Palette, Shape } from "./look";
import { fattest, Simplices } from "./measure";
import type { MeshStore } from "./store";

// More segments than this are a fog, and slow.
const kMostSegments = 400_000;

// Adds points on simplices, each a mix of two vertices.
class Mix {
  private positions = new Float32Array(3072);
  private values = new Float32Array(1024);
  count = 0;

  add(projected: Float32Array, p: number, q: number, t: number, value: number) {
    if (this.values.length === this.count) {
      const positions = new Float32Array(6 * this.count);
      positions.set(this.positions);
      this.positions = positions;
      const values = new Float32Array(2 * this.count);
      values.set(this.values);
      this.values = values;
    }
    for (let i = 0; i < 3; i++) {
      this.positions[3 * this.count + i] =
        (1 - t) * projected[3 * p + i] + t * projected[3 * q + i];
    }
    this.values[this.count++] = value;
  }

  shape(kind: Shape["kind"], palette: Palette): Shape {
    return {
      kind,
      positions: this.positions.slice(0, 3 * this.count),
      values: this.values.slice(0, this.count),
      palette,
      index: null,
    };
  }
}

export function project(store: MeshStore, frame: number[]): Float32Array {
  const { d, points, vertices } = store;
  const out = new Float32Array(3 * vertices);
  const terms: [row: number, column: number, weight: number][] = [];
  frame.forEach((weight, i) => {
    if (weight !== 0) terms.push([Math.floor(i / d), i % d, weight]);
  });
  for (const [row, column, weight] of terms) {
    for (let v = 0; v < vertices; v++) out[3 * v + row] += weight * points[v * d + column];
  }
  return out;
}

export function extent(store: MeshStore, axis: number): [low: number, high: number] {
  let low = Infinity;
  let high = -Infinity;
  for (let v = 0, at = axis; v < store.vertices; v++, at += store.d) {
    const x = store.points[at];
    if (x < low) low = x;
    if (x > high) high = x;
  }
  return low <= high ? [low, high] : [0, 1];
}

// Vertices' values and what they are. Of what is told by simplex, walls and regions, none.
interface Paint {
  values: Float32Array; // of each vertex; NaN: no colour of its own
  palette: Palette;
  byCell: ((cell: number) => number) | null; // the same for all of a simplex
}

function paintOf(store: MeshStore, look: Look, epsilon: number): Paint {
  const values = valuesOf(store, look, epsilon);
  const { colour } = look;
  if (colour === "region") {
    return {
      values,
      palette: "region",
      byCell: (cell) => store.regionOf(cell),
    };
  }
  if (colour === "wall" && store.isBoundary) {
    const width = store.k + 1;
    const byCell = (cell: number) =>
      wallOf(store, [...store.cells.subarray(cell * width, (cell + 1) * width)]);
    return { values, palette: "wall", byCell };
  }
  return {
    values,
    palette: colour === "place" ? "place" : "map",
    byCell: null,
  };
}

// These simplices, `size` ids each, of vertices of their own: each has the value of its cell.
function apart(
  projected: Float32Array,
  ids: ArrayLike<number>,
  size: number,
  palette: Palette,
  valueOf: (row: number) => number,
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
  };
}

// Of each vertex, 0..1, or its place; NaN: no colour of its own.
function valuesOf(store: MeshStore, look: Look, epsilon: number): Float32Array {
  const { vertices, k, d } = store;
  const values = new Float32Array(vertices);
  if (look.colour === "plain" || look.colour === "wall" || look.colour === "region") {
    return values.fill(NaN);
  }
  if (look.colour === "place")
    return store.places ? values.map((_, v) => store.places![v]) : values.fill(NaN);
  if (look.colour === "order") {
    for (let v = 0; v < vertices; v++) values[v] = v / vertices;
  } else if (look.colour === "coordinate") {
    const [low, high] = extent(store, look.colourAxis);
    for (let v = 0; v < vertices; v++) {
      values[v] = (store.points[v * d + look.colourAxis] - low) / (high - low || 1);
    }
  } else {
    // The worst simplex at each vertex.
    const simplices = new Simplices(store);
    for (let cell = 0; cell < store.simplices; cell++) {
      simplices.measure(cell);
      const bad =
        look.colour === "size"
          ? Math.min(simplices.radius / epsilon, 1)
          : 1 - Math.min(simplices.volume / simplices.longest ** k / fattest(k), 1);
      for (let i = 0; i <= k; i++) {
        const v = store.cells[cell * (k + 1) + i];
        if (bad > values[v]) values[v] = bad;
      }
    }
  }
  return values;
}

// Each pair or triple of a simplex' vertices once, although several simplices have it; with the first.
function faces(store: MeshStore, size: number, take: (ids: number[], cell: number) => boolean) {
  const { k, cells, simplices } = store;
  const seen = new Set<string | number>();
  const choose = (at: number, first: number, ids: number[]): boolean => {
    if (ids.length === size) {
      const key = size === 2 ? ids[0] * 0x4000000 + ids[1] : ids.join(" ");
      if (seen.has(key)) return true;
      seen.add(key);
      return take(ids, at / (k + 1));
    }
    for (let i = first; i <= k; i++) {
      if (!choose(at, i + 1, [...ids, cells[at + i]])) return false;
    }
    return true;
  };
  for (let cell = 0; cell < simplices; cell++) {
    if (!choose(cell * (k + 1), 0, [])) return;
  }
}

function edges(store: MeshStore, projected: Float32Array, paint: Paint): Shape {
  const index: number[] = [];
  const cells: number[] = [];
  faces(store, 2, ([p, q], cell) => {
    cells.push(cell);
    return index.push(p, q) < 2 * kMostSegments;
  });
  const { values, palette, byCell } = paint;
  if (byCell) return apart(projected, index, 2, palette, (row) => byCell(cells[row]));
  return {
    kind: "segments",
    positions: projected,
    values,
    palette,
    index: Uint32Array.from(index),
  };
}

// Where a hyperplane cuts each simplex: a tetrahedron in a triangle or a quadrangle, a triangle in a
// segment; what has more dimensions is shown by the segments of its triangles.
function slice(
  store: MeshStore,
  projected: Float32Array,
  { values, palette, byCell }: Paint,
  height: (v: number) => number,
): Shape {
  const { k, cells, simplices } = store;
  const mix = new Mix();
  let value: number | null = null; // of all points of a simplex
  const cut = (p: number, q: number) => {
    const t = height(p) / (height(p) - height(q));
    mix.add(projected, p, q, t, value ?? (1 - t) * values[p] + t * values[q]);
  };
  if (k !== 3) {
    faces(store, Math.min(k + 1, 3), (ids, cell) => {
      value = byCell?.(cell) ?? null;
      const above = ids.filter((v) => height(v) >= 0);
      const below = ids.filter((v) => height(v) < 0);
      if (ids.length === 3 && above.length > 0 && below.length > 0) {
        const [alone, others] = above.length === 1 ? [above[0], below] : [below[0], above];
        cut(alone, others[0]);
        cut(alone, others[1]);
      }
      return mix.count < 2 * kMostSegments;
    });
    return mix.shape("segments", palette);
  }
  for (let at = 0; at < 4 * simplices; at += 4) {
    value = byCell?.(at / 4) ?? null;
    const above: number[] = [];
    const below: number[] = [];
    for (let i = 0; i < 4; i++) (height(cells[at + i]) >= 0 ? above : below).push(cells[at + i]);
    if (above.length === 2) {
      const [a, b] = above;
      const [p, q] = below;
      cut(a, p);
      cut(a, q);
      cut(b, q);
      cut(a, p);
      cut(b, q);
      cut(b, p);
    } else if (above.length === 1 || below.length === 1) {
      const [alone, others] = above.length === 1 ? [above[0], below] : [below[0], above];
      for (const other of others) cut(alone, other);
    }
  }
  return mix.shape("triangles", palette);
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
  const part = (ids: ArrayLike<number>, cellOf: (row: number) => number): Shape =>
    byCell
      ? apart(projected, ids, 3, palette, (row) => byCell(cellOf(row)))
      : {
          kind: "triangles",
          positions: projected,
          values,
          palette,
          index: Uint32Array.from(ids),
        };
  if (k === 2) {
    const index = new Uint32Array(3 * chosen.length);
    chosen.forEach((cell, i) => index.set(cells.subarray(3 * cell, 3 * cell + 3), 3 * i));
    return part(index, (row) => chosen[row]);
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
    (row) => shell[row].cell,
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
    return apart(projected, triangles, 3, "wall", wall);
  }
  if (byCell) return apart(projected, triangles, 3, palette, (row) => byCell(cells[row]));
  const index = Uint32Array.from(triangles);
  return { kind: "triangles", positions: projected, values, palette, index };
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
    };
  }
  return {
    positions,
    values: Float32Array.from(bare, (v) => v / vertices),
    palette: "map",
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
    if (byCell) return apart(projected, index, 3, palette, byCell);
    return { kind: "triangles", positions: projected, values, palette, index };
  }
  const height = heightOf(store, look);
  if (look.part === "slice" || k > 3) return slice(store, projected, paint, height);
  return below(store, projected, paint, height);
}
