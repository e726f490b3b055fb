// From a mesh and a look at it to what can be drawn: triangles or segments in space.
import { boundaryOf, wallOf } from "./boundary";
import type { Bare, Look, Shape } from "./look";
import { fattest, Simplices } from "./measure";
import type { MeshStore } from "./store";

// More segments than this are a fog, and slow.
const kMostSegments = 400_000;

// Adds points on simplices, each a mix of two vertices.
class Mix {
  private positions = new Float32Array(3072);
  private values = new Float32Array(1024);
  count = 0;

  add(projected: Float32Array, value: Float32Array, p: number, q: number, t: number) {
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
    this.values[this.count++] = (1 - t) * value[p] + t * value[q];
  }

  shape(kind: Shape["kind"]): Shape {
    return {
      kind,
      positions: this.positions.slice(0, 3 * this.count),
      values: this.values.slice(0, this.count),
      byWall: false,
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

// Of each vertex, 0..1; NaN: no colour of its own.
function valuesOf(store: MeshStore, look: Look, epsilon: number): Float32Array {
  const { vertices, k, d } = store;
  const values = new Float32Array(vertices);
  if (look.colour === "plain" || look.colour === "wall") return values.fill(NaN);
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

// Each pair or triple of a simplex' vertices once, although several simplices have it.
function faces(store: MeshStore, size: number, take: (ids: number[]) => boolean) {
  const { k, cells, simplices } = store;
  const seen = new Set<string | number>();
  const choose = (at: number, first: number, ids: number[]): boolean => {
    if (ids.length === size) {
      const key = size === 2 ? ids[0] * 0x4000000 + ids[1] : ids.join(" ");
      if (seen.has(key)) return true;
      seen.add(key);
      return take(ids);
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

function edges(store: MeshStore, projected: Float32Array, values: Float32Array): Shape {
  const index: number[] = [];
  faces(store, 2, ([p, q]) => index.push(p, q) < 2 * kMostSegments);
  return {
    kind: "segments",
    positions: projected,
    values,
    byWall: false,
    index: Uint32Array.from(index),
  };
}

// Where a hyperplane cuts each simplex: a tetrahedron in a triangle or a quadrangle, a triangle in a
// segment; what has more dimensions is shown by the segments of its triangles.
function slice(
  store: MeshStore,
  projected: Float32Array,
  values: Float32Array,
  height: (v: number) => number,
): Shape {
  const { k, cells, simplices } = store;
  const mix = new Mix();
  const cut = (p: number, q: number) =>
    mix.add(projected, values, p, q, height(p) / (height(p) - height(q)));
  if (k !== 3) {
    faces(store, Math.min(k + 1, 3), (ids) => {
      const above = ids.filter((v) => height(v) >= 0);
      const below = ids.filter((v) => height(v) < 0);
      if (ids.length === 3 && above.length > 0 && below.length > 0) {
        const [alone, others] = above.length === 1 ? [above[0], below] : [below[0], above];
        cut(alone, others[0]);
        cut(alone, others[1]);
      }
      return mix.count < 2 * kMostSegments;
    });
    return mix.shape("segments");
  }
  for (let at = 0; at < 4 * simplices; at += 4) {
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
  return mix.shape("triangles");
}

// Whole simplices below the hyperplane: of a surface the triangles, of a 3-manifold the shell of
// triangles that parts them from the rest.
function below(
  store: MeshStore,
  projected: Float32Array,
  values: Float32Array,
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
  const part = { positions: projected, values, byWall: false };
  if (k === 2) {
    const index = new Uint32Array(3 * chosen.length);
    chosen.forEach((cell, i) => index.set(cells.subarray(3 * cell, 3 * cell + 3), 3 * i));
    return { kind: "triangles", ...part, index };
  }
  const once = new Map<string, number[]>();
  for (const cell of chosen) {
    for (let omit = 0; omit < 4; omit++) {
      const ids = [0, 1, 2, 3].filter((i) => i !== omit).map((i) => cells[4 * cell + i]);
      const key = ids.join(" ");
      if (!once.delete(key)) once.set(key, ids);
    }
  }
  return { kind: "triangles", ...part, index: Uint32Array.from([...once.values()].flat()) };
}

// The triangles that bound a 3-manifold; by wall, each has its own vertices.
function surface(
  store: MeshStore,
  projected: Float32Array,
  values: Float32Array,
  look: Look,
): Shape {
  const { triangles } = boundaryOf(store);
  if (look.colour !== "wall") {
    const index = Uint32Array.from(triangles);
    return { kind: "triangles", positions: projected, values, byWall: false, index };
  }
  const positions = new Float32Array(3 * triangles.length);
  triangles.forEach((id, i) => positions.set(projected.subarray(3 * id, 3 * id + 3), 3 * i));
  const walls = new Float32Array(triangles.length);
  for (let i = 0; i < triangles.length; i += 3) {
    walls.fill(wallOf(store, triangles.slice(i, i + 3)), i, i + 3);
  }
  return { kind: "triangles", positions, values: walls, byWall: true, index: null };
}

export function bareOf(store: MeshStore, projected: Float32Array): Bare {
  const { k, vertices, simplices, cells } = store;
  const covered = new Uint8Array(vertices);
  for (let i = 0; i < simplices * (k + 1); i++) covered[cells[i]] = 1;
  const bare: number[] = [];
  covered.forEach((is, v) => is || bare.push(v));
  const positions = new Float32Array(3 * bare.length);
  bare.forEach((v, i) => positions.set(projected.subarray(3 * v, 3 * v + 3), 3 * i));
  return { positions, values: Float32Array.from(bare, (v) => v / vertices) };
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
  const values = valuesOf(store, look, epsilon);
  const { k, cells, simplices } = store;
  if (look.part === "boundary" && k === 3) return surface(store, projected, values, look);
  if (look.part === "whole" || k === 1) {
    if (k !== 2) return edges(store, projected, values);
    const index = cells.slice(0, 3 * simplices);
    return { kind: "triangles", positions: projected, values, byWall: false, index };
  }
  const height = heightOf(store, look);
  if (look.part === "slice" || k > 3) return slice(store, projected, values, height);
  return below(store, projected, values, height);
}
