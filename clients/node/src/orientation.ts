// Turning the simplices of a complex to agree with their neighbours.
import { sameRow, sortedOrder } from "./rows.js";

/**
 * The same simplices, some with their last two vertices exchanged, so that neighbours induce opposite
 * orientations on the facet they share; the first of each component stays, but that those of a
 * hypersurface are turned as a whole where their normals point inwards. undefined if that cannot be:
 * the complex is not orientable, or a facet is in more than two simplices. Rows have to be ascending.
 */
export function orient(
  simplices: Uint32Array,
  width: number,
  points: Float64Array,
  d: number,
): Uint32Array | undefined {
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
    const component = [start];
    for (const s of component) {
      for (let i = 0; i < width; i++) {
        const facet = other[s * width + i];
        if (facet < 0) continue;
        const neighbour = Math.floor(facet / width);
        // Facets without vertices of like parity have like orientations.
        const alike = (i - (facet % width)) % 2 === 0;
        const wanted = alike ? -turned[s] : turned[s];
        if (turned[neighbour] === -wanted) return undefined;
        if (turned[neighbour] === 0) component.push(neighbour);
        turned[neighbour] = wanted;
      }
    }
    let volume = 0; // (k+1)! times those of the cones from the origin
    for (const s of component) {
      const end = (s + 1) * width;
      if (turned[s] < 0) exchange(oriented, end);
      if (width !== d) continue;
      const corners = Array.from(oriented.subarray(s * width, end));
      volume += determinant(corners.map((id) => [...points.subarray(id * d, id * d + d)]));
    }
    if (volume < 0) for (const s of component) exchange(oriented, (s + 1) * width);
  }
  return oriented;
}

function exchange(rows: Uint32Array, end: number): void {
  [rows[end - 2], rows[end - 1]] = [rows[end - 1], rows[end - 2]];
}

function determinant(rows: number[][]): number {
  if (rows.length === 1) return rows[0][0];
  let sum = 0;
  rows.forEach((row, i) => {
    const minor = rows.filter((_, j) => j !== i).map((other) => other.slice(1));
    sum += (i % 2 ? -1 : 1) * row[0] * determinant(minor);
  });
  return sum;
}
