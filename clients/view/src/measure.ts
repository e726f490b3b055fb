// Size and shape of simplices, any k and d, from their edges alone.
import type { MeshStore } from "./store";

export interface Histogram {
  name: string;
  unit: string;
  low: number;
  high: number;
  bins: number[];
}

// Twice the Gram matrix' worth: the circumcentre is p0 + sum b_i e_i, G b = diag(G) / 2.
export class Simplices {
  private readonly k: number;
  private readonly gram: Float64Array;
  private readonly work: Float64Array;
  radius = 0;
  volume = 0; // times k!
  longest = 0;
  shortest = 0;

  constructor(private readonly store: MeshStore) {
    this.k = store.k;
    this.gram = new Float64Array(this.k * this.k);
    this.work = new Float64Array(this.k * (this.k + 1));
  }

  private dot(o: number, p: number, q: number): number {
    const { points, d, units } = this.store;
    let sum = 0;
    for (let i = 0; i < d; i++) {
      const at = points[o * d + i];
      sum += (((points[p * d + i] - at) / units[i]) * (points[q * d + i] - at)) / units[i];
    }
    return sum;
  }

  measure(cell: number) {
    const { cells } = this.store;
    const { k, gram, work } = this;
    const at = cell * (k + 1);
    for (let i = 0; i < k; i++) {
      for (let j = i; j < k; j++) {
        const g = this.dot(cells[at], cells[at + 1 + i], cells[at + 1 + j]);
        gram[i * k + j] = gram[j * k + i] = g;
      }
    }
    this.longest = 0;
    this.shortest = Infinity;
    for (let i = 0; i < k; i++) {
      this.note(gram[i * k + i]);
      for (let j = i + 1; j < k; j++) {
        this.note(gram[i * k + i] + gram[j * k + j] - 2 * gram[i * k + j]);
      }
    }
    this.longest = Math.sqrt(this.longest);
    this.shortest = Math.sqrt(Math.max(this.shortest, 0));
    // Gauss, with pivots on the diagonal: the matrix is positive definite, or the simplex flat.
    let determinant = 1;
    for (let i = 0; i < k; i++) {
      for (let j = 0; j < k; j++) work[i * (k + 1) + j] = gram[i * k + j];
      work[i * (k + 1) + k] = gram[i * k + i] / 2;
    }
    for (let c = 0; c < k; c++) {
      const pivot = work[c * (k + 1) + c];
      determinant *= pivot;
      if (!(pivot > 0)) break;
      for (let r = 0; r < k; r++) {
        if (r === c) continue;
        const f = work[r * (k + 1) + c] / pivot;
        for (let j = c; j <= k; j++) work[r * (k + 1) + j] -= f * work[c * (k + 1) + j];
      }
    }
    this.volume = Math.sqrt(Math.max(determinant, 0));
    let squared = 0;
    for (let i = 0; i < k; i++) {
      squared += (work[i * (k + 1) + k] / work[i * (k + 1) + i]) * (gram[i * k + i] / 2);
    }
    this.radius = this.volume > 0 ? Math.sqrt(squared) : Infinity;
  }

  private note(squared: number) {
    if (squared > this.longest) this.longest = squared;
    if (squared < this.shortest) this.shortest = squared;
  }

  // Of a triangle, in degrees, each in turn.
  angles(cell: number, take: (degrees: number) => void) {
    const { cells } = this.store;
    for (let i = 0; i < 3; i++) {
      const o = cells[cell * 3 + i];
      const p = cells[cell * 3 + ((i + 1) % 3)];
      const q = cells[cell * 3 + ((i + 2) % 3)];
      const cosine = this.dot(o, p, q) / Math.sqrt(this.dot(o, p, p) * this.dot(o, q, q));
      take((Math.acos(Math.min(1, Math.max(-1, cosine))) * 180) / Math.PI);
    }
  }

  // Between the faces of a tetrahedron that meet in an edge, in degrees.
  dihedral(cell: number, take: (degrees: number) => void) {
    const { cells } = this.store;
    const ids = [0, 1, 2, 3].map((i) => cells[cell * 4 + i]);
    for (let a = 0; a < 4; a++) {
      for (let b = a + 1; b < 4; b++) {
        const [p, q] = [0, 1, 2, 3].filter((i) => i !== a && i !== b);
        const along = this.dot(ids[a], ids[b], ids[b]);
        const pe = this.dot(ids[a], ids[p], ids[b]);
        const qe = this.dot(ids[a], ids[q], ids[b]);
        const pp = this.dot(ids[a], ids[p], ids[p]) - (pe * pe) / along;
        const qq = this.dot(ids[a], ids[q], ids[q]) - (qe * qe) / along;
        const pq = this.dot(ids[a], ids[p], ids[q]) - (pe * qe) / along;
        const cosine = pq / Math.sqrt(pp * qq);
        take((Math.acos(Math.min(1, Math.max(-1, cosine))) * 180) / Math.PI);
      }
    }
  }
}

class Binned {
  readonly bins = new Array<number>(40).fill(0);
  constructor(
    readonly name: string,
    readonly unit: string,
    readonly low: number,
    readonly high: number,
  ) {}
  readonly add = (value: number) => {
    const place = Math.floor(((value - this.low) / (this.high - this.low)) * this.bins.length);
    this.bins[Math.min(Math.max(place, 0), this.bins.length - 1)]++;
  };
  result(): Histogram {
    const { name, unit, low, high, bins } = this;
    return { name, unit, low, high, bins };
  }
}

// Volume of the regular k-simplex over the k-th power of its edge, times k!: the fattest there is.
export const fattest = (k: number) => Math.sqrt((k + 1) / 2 ** k);

// Circumradii as shares of `most`, which is called `name`.
export function histograms(store: MeshStore, most: number, name: string): Histogram[] {
  const { k } = store;
  const size = new Binned(`circumradius / ${name}`, "", 0, 1);
  if (k === 1) {
    const simplices = new Simplices(store);
    for (let cell = 0; cell < store.simplices; cell++) {
      simplices.measure(cell);
      size.add(simplices.radius / most);
    }
    return [size.result()];
  }
  const ratio = new Binned("radius / shortest edge", "", 0.5, 2.5);
  const fat = new Binned("fatness / that of the regular simplex", "", 0, 1);
  const angle = new Binned(k === 2 ? "angles" : "dihedral angles", "°", 0, 180);
  const simplices = new Simplices(store);
  for (let cell = 0; cell < store.simplices; cell++) {
    simplices.measure(cell);
    size.add(simplices.radius / most);
    ratio.add(simplices.radius / simplices.shortest);
    fat.add(simplices.volume / simplices.longest ** k / fattest(k));
    if (k === 2) simplices.angles(cell, angle.add);
    if (k === 3) simplices.dihedral(cell, angle.add);
  }
  const all = [size, ratio, fat];
  if (k <= 3) all.push(angle);
  return all.map((binned) => binned.result());
}
