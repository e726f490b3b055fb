// Where a hyperplane meets a mesh.
import type { Palette, Shape } from "./look";
import type { Paint } from "./paint";
import type { MeshStore } from "./store";

// More segments than this are a fog, and slow.
export const kMostSegments = 400_000;

// Adds points on simplices, each a mix of two vertices.
export class Mix {
  readonly cells: number[] = []; // of each triangle or segment
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
      cells: this.cells,
    };
  }
}

// Each pair or triple of a simplex' vertices once, although several simplices have it; with the first.
export function faces(
  store: MeshStore,
  size: number,
  take: (ids: number[], cell: number) => boolean,
) {
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

// Where a hyperplane cuts each simplex: a tetrahedron in a triangle or a quadrangle, a triangle in a
// segment; what has more dimensions is shown by the segments of its triangles.
export function slice(
  store: MeshStore,
  projected: Float32Array,
  { values, palette, byCell }: Paint,
  height: (v: number) => number,
  mix = new Mix(),
): Shape {
  const { k, cells, simplices } = store;
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
        mix.cells.push(cell);
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
      mix.cells.push(at / 4, at / 4);
    } else if (above.length === 1 || below.length === 1) {
      const [alone, others] = above.length === 1 ? [above[0], below] : [below[0], above];
      for (const other of others) cut(alone, other);
      mix.cells.push(at / 4);
    }
  }
  return mix.shape("triangles", palette);
}
