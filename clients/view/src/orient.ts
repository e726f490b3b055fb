// Simplices as programs that read meshes want them: turned alike.
import type { MeshStore } from "./store";

// All ids, k + 1 of each simplex, as the server turned them: of a closed surface outwards. While a mesh
// grows, triangles that share an edge are turned the same way round, where the surface has two sides, and
// tetrahedra of space are positive.
export function oriented(store: MeshStore): Uint32Array {
  const { k, d, simplices } = store;
  const cells = store.cells.slice(0, simplices * (k + 1));
  if (store.turned !== null) {
    turnAsTold(store.turned, cells, k + 1);
    return cells;
  }
  if (k === 3 && d === 3) turnPositive(store, cells);
  if (k === 2) turnAlike(cells);
  return cells;
}

function turn(cells: Uint32Array, at: number) {
  [cells[at], cells[at + 1]] = [cells[at + 1], cells[at]];
}

// The bits are those of the rows in lexicographic order.
function turnAsTold(bits: Uint8Array, cells: Uint32Array, width: number) {
  const order = Uint32Array.from({ length: cells.length / width }, (_, i) => i);
  order.sort((a, b) => {
    let i = 0;
    while (i < width - 1 && cells[a * width + i] === cells[b * width + i]) i++;
    return cells[a * width + i] - cells[b * width + i];
  });
  order.forEach((cell, i) => {
    if ((bits[i >> 3] >> (i & 7)) & 1) turn(cells, cell * width + width - 2);
  });
}

function turnPositive({ points }: MeshStore, cells: Uint32Array) {
  for (let at = 0; at < cells.length; at += 4) {
    const [a, b, c] = [1, 2, 3].map((i) =>
      [0, 1, 2].map((x) => points[3 * cells[at + i] + x] - points[3 * cells[at] + x]),
    );
    const det =
      a[0] * (b[1] * c[2] - b[2] * c[1]) -
      a[1] * (b[0] * c[2] - b[2] * c[0]) +
      a[2] * (b[0] * c[1] - b[1] * c[0]);
    if (det < 0) turn(cells, at);
  }
}

// From triangle to triangle across edges. Sides are as they came with the first of each component.
function turnAlike(cells: Uint32Array) {
  const kMost = 0x4000000; // above all ids
  const sides = new Map<number, number[]>(); // triangles at each edge
  const keyOf = (p: number, q: number) => Math.min(p, q) * kMost + Math.max(p, q);
  const edges = (at: number) =>
    [0, 1, 2].map((i) => [cells[at + i], cells[at + ((i + 1) % 3)]] as const);
  for (let at = 0; at < cells.length; at += 3) {
    for (const [p, q] of edges(at)) {
      const key = keyOf(p, q);
      const known = sides.get(key);
      if (known) known.push(at);
      else sides.set(key, [at]);
    }
  }
  const done = new Uint8Array(cells.length / 3);
  for (let first = 0; first < cells.length; first += 3) {
    if (done[first / 3]) continue;
    done[first / 3] = 1;
    const stack = [first];
    while (stack.length > 0) {
      const at = stack.pop()!;
      for (const [p, q] of edges(at)) {
        for (const next of sides.get(keyOf(p, q))!) {
          if (done[next / 3]) continue;
          done[next / 3] = 1;
          // Neighbours that are turned alike go through their edge in opposite directions.
          if (edges(next).some(([a, b]) => a === p && b === q)) turn(cells, next);
          stack.push(next);
        }
      }
    }
  }
}
