// A rougher picture of triangles, quick to draw while it is turned: vertices that share a cell of a
// grid become one of them, and triangles that this makes flat are left out.

const kCells = 40; // along the longest side

export function roughIndex(
  positions: ArrayLike<number>,
  index: ArrayLike<number> | null,
): Uint32Array {
  const count = positions.length / 3;
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < positions.length; i++) {
    const x = positions[i];
    if (x < low[i % 3]) low[i % 3] = x;
    if (x > high[i % 3]) high[i % 3] = x;
  }
  const scale = kCells / (Math.max(...high.map((h, i) => h - low[i])) || 1);
  const first = new Map<number, number>();
  const one = new Uint32Array(count);
  for (let v = 0; v < count; v++) {
    let cell = 0;
    for (let i = 0; i < 3; i++) {
      cell = cell * (kCells + 1) + Math.floor((positions[3 * v + i] - low[i]) * scale);
    }
    const known = first.get(cell);
    if (known === undefined) first.set(cell, v);
    one[v] = known ?? v;
  }
  const corners = index?.length ?? count;
  const rough: number[] = [];
  for (let at = 0; at < corners; at += 3) {
    const [a, b, c] = [at, at + 1, at + 2].map((i) => one[index ? index[i] : i]);
    if (a !== b && b !== c && c !== a) rough.push(a, b, c);
  }
  return Uint32Array.from(rough);
}
