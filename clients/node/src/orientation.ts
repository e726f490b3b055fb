// Turning the simplices of a complex to agree with their neighbours.
import { sameRow, sortedOrder } from "./rows.js";

/**
 * The same simplices, some with their first two vertices exchanged, so that neighbours induce opposite
 * orientations on the facet they share. undefined if that cannot be: the complex is not orientable, or
 * a facet is in more than two simplices. Rows have to be ascending.
 */
export function orient(simplices: Uint32Array, width: number): Uint32Array | undefined {
  const count = simplices.length / width;
  const facets = new Uint32Array(count * width * (width - 1));
  let at = 0;
  for (let s = 0; s < count; s++) {
    for (let left = 0; left < width; left++) {
      for (let i = 0; i < width; i++) if (i !== left) facets[at++] = simplices[s * width + i];
    }
  }
  // Facet f is that of simplex f / width without its vertex f % width.
  const other = new Int32Array(count * width).fill(-1);
  const order = sortedOrder(facets, width - 1);
  for (let i = 1; i < order.length; i++) {
    if (!sameRow(facets, width - 1, order[i - 1], order[i])) continue;
    if (other[order[i - 1]] >= 0) return undefined;
    other[order[i]] = order[i - 1];
    other[order[i - 1]] = order[i];
  }
  const turned = new Int8Array(count); // 0: not seen, 1: as it is, -1: turned
  const oriented = simplices.slice();
  for (let start = 0; start < count; start++) {
    if (turned[start]) continue;
    turned[start] = 1;
    const front = [start];
    for (let s = front.pop(); s !== undefined; s = front.pop()) {
      for (let i = 0; i < width; i++) {
        const facet = other[s * width + i];
        if (facet < 0) continue;
        const neighbour = Math.floor(facet / width);
        // Facets without vertices of like parity have like orientations.
        const alike = (i - (facet % width)) % 2 === 0;
        const wanted = alike ? -turned[s] : turned[s];
        if (turned[neighbour] === -wanted) return undefined;
        if (turned[neighbour] === 0) front.push(neighbour);
        turned[neighbour] = wanted;
      }
    }
  }
  for (let s = 0; s < count; s++) {
    if (turned[s] > 0) continue;
    oriented[s * width] = simplices[s * width + 1];
    oriented[s * width + 1] = simplices[s * width];
  }
  return oriented;
}
