// Rows of vertex numbers, [m, width] one after the other, in lexicographic order.

/** The order that sorts the rows; equal rows keep theirs. One counting sort a column. */
export function sortedOrder(rows: Uint32Array, width: number): Uint32Array {
  const count = rows.length / width;
  let order = Uint32Array.from({ length: count }, (_, i) => i);
  let most = 0;
  for (const id of rows) if (id > most) most = id;
  let next = new Uint32Array(count);
  for (let column = width - 1; column >= 0; column--) {
    const start = new Uint32Array(most + 2);
    for (let i = column; i < rows.length; i += width) start[rows[i] + 1]++;
    for (let id = 0; id <= most; id++) start[id + 1] += start[id];
    for (const row of order) next[start[rows[row * width + column]]++] = row;
    [order, next] = [next, order];
  }
  return order;
}

/** Whether rows a and b are the same. */
export function sameRow(rows: Uint32Array, width: number, a: number, b: number): boolean {
  for (let i = 0; i < width; i++) if (rows[a * width + i] !== rows[b * width + i]) return false;
  return true;
}

/** The chosen rows, one after the other. */
export function takeRows(rows: Uint32Array, width: number, chosen: ArrayLike<number>): Uint32Array {
  const taken = new Uint32Array(chosen.length * width);
  for (let i = 0; i < chosen.length; i++) {
    for (let j = 0; j < width; j++) taken[i * width + j] = rows[chosen[i] * width + j];
  }
  return taken;
}

/** How many bytes that many bits take. */
export function bytesOfBits(count: number): number {
  return Math.ceil(count / 8);
}

/** Whether bit i is set, eight in a byte, the first in the lowest. */
export function isSet(bits: Uint8Array, i: number): boolean {
  return ((bits[i >> 3] >> (i & 7)) & 1) === 1;
}

/** The bits in another order. */
export function takeBits(bits: Uint8Array, order: Uint32Array): Uint8Array {
  const taken = new Uint8Array(bytesOfBits(order.length));
  order.forEach((from, to) => {
    if (isSet(bits, from)) taken[to >> 3] |= 1 << (to & 7);
  });
  return taken;
}

/** One array of several. */
export function joined(blocks: Uint32Array[]): Uint32Array {
  const all = new Uint32Array(blocks.reduce((length, block) => length + block.length, 0));
  let at = 0;
  for (const block of blocks) {
    all.set(block, at);
    at += block.length;
  }
  return all;
}
