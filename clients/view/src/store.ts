// A mesh as it grows: vertices that only come, simplices that come and go.

type Growing = Float64Array | Uint32Array | Int32Array | Uint8Array;

function grown<T extends Growing>(array: T, size: number): T {
  if (array.length >= size) return array;
  const Type = array.constructor as new (size: number) => T;
  const larger = new Type(Math.max(size, 2 * array.length, 1024));
  larger.set(array);
  return larger;
}

export class MeshStore {
  points = new Float64Array();
  vertices = 0;
  cells = new Uint32Array();
  simplices = 0;
  revision = 0;
  walls = new Map<number, bigint>(); // of vertices at the boundary, those they lie on, as bits
  // Of each simplex so many: none, the region it is in, or, of a boundary, those at its two sides.
  labelCount = 0;
  labels = new Uint8Array();
  places: Uint8Array | null = null; // of each vertex, of a reconstruction that is over
  // Of a mesh that is over: which of its simplices, in lexicographic order, are turned, as bits; none
  // where it has no two sides. null: not known.
  turned: Uint8Array | null = null;

  // Open addressing: which simplex is where in `cells`. -1: free.
  private table = new Int32Array(1024).fill(-1);

  // `units`: of the axes, where they have different ones; the mesh is drawn, and measured, divided by
  // these.
  constructor(
    readonly k: number,
    readonly d: number,
    readonly units: ArrayLike<number> = new Float64Array(d).fill(1),
  ) {}

  clear() {
    this.vertices = this.simplices = this.revision = 0;
    this.walls.clear();
    this.labelCount = 0;
    this.places = this.turned = null;
    this.table = new Int32Array(1024).fill(-1);
  }

  addPoints(first: number, points: Float64Array) {
    const end = first + points.length / this.d;
    this.points = grown(this.points, end * this.d);
    this.points.set(points, first * this.d);
    this.vertices = Math.max(this.vertices, end);
  }

  // A part of it, from a simplex on that is a multiple of 8.
  addTurned(first: number, bits: Uint8Array) {
    if (first + 8 * bits.length >= this.simplices + 8) return; // of another mesh
    const whole = new Uint8Array(first / 8 + bits.length);
    if (this.turned) whole.set(this.turned.subarray(0, first / 8));
    whole.set(bits, first / 8);
    this.turned = whole;
  }

  addWalls(vertices: number[], walls: bigint[]) {
    vertices.forEach((vertex, i) => this.walls.set(vertex, walls[i]));
  }

  // Of a boundary alone: it has two labels on each simplex, also where there is one region.
  get isBoundary(): boolean {
    return this.labelCount === 2;
  }

  // The region that a simplex is in; of a boundary that with the larger label, which its normal leaves.
  regionOf(cell: number): number {
    if (this.labelCount === 0) return 1;
    const at = cell * this.labelCount;
    return Math.max(...this.labels.subarray(at, at + this.labelCount));
  }

  addCells(cells: Uint32Array, labels: Uint8Array = new Uint8Array()) {
    const width = this.k + 1;
    const count = cells.length / width;
    if (count > 0) this.turned = null;
    if (count > 0 && labels.length > 0) this.labelCount = labels.length / count;
    this.labels = grown(this.labels, (this.simplices + count) * this.labelCount);
    this.cells = grown(this.cells, (this.simplices + count) * width);
    this.reserve(this.simplices + count);
    for (let i = 0; i < count; i++) {
      const slot = this.find(cells, i * width);
      if (this.table[slot] >= 0) continue;
      this.cells.set(cells.subarray(i * width, (i + 1) * width), this.simplices * width);
      const own = labels.subarray(i * this.labelCount, (i + 1) * this.labelCount);
      this.labels.set(own, this.simplices * this.labelCount);
      this.table[slot] = this.simplices++;
    }
  }

  removeCells(cells: Uint32Array) {
    const width = this.k + 1;
    if (cells.length > 0) this.turned = null;
    for (let i = 0; i < cells.length; i += width) {
      const slot = this.find(cells, i);
      const hole = this.table[slot];
      if (hole < 0) continue;
      this.free(slot);
      const last = --this.simplices;
      if (hole === last) continue;
      this.table[this.find(this.cells, last * width)] = hole;
      this.cells.copyWithin(hole * width, last * width, (last + 1) * width);
      const count = this.labelCount;
      this.labels.copyWithin(hole * count, last * count, (last + 1) * count);
    }
  }

  // Of a simplex with these ids, ascending; -1: there is none.
  cellOf(ids: number[]): number {
    return ids.length === this.k + 1 ? this.table[this.find(Uint32Array.from(ids), 0)] : -1;
  }

  private hash(cells: Uint32Array, at: number): number {
    let h = 0x811c9dc5;
    for (let i = 0; i <= this.k; i++) h = Math.imul(h ^ cells[at + i], 0x9e3779b1) ^ (h >>> 15);
    return (h ^ (h >>> 13)) >>> 0;
  }

  // Where the simplex is, or where it would be.
  private find(cells: Uint32Array, at: number): number {
    const mask = this.table.length - 1;
    const width = this.k + 1;
    for (let slot = this.hash(cells, at) & mask; ; slot = (slot + 1) & mask) {
      const cell = this.table[slot];
      if (cell < 0) return slot;
      let i = 0;
      while (i < width && this.cells[cell * width + i] === cells[at + i]) i++;
      if (i === width) return slot;
    }
  }

  // Closes the gap, so that whoever was pushed on by the one that goes is still found.
  private free(gap: number) {
    const mask = this.table.length - 1;
    const width = this.k + 1;
    for (let slot = (gap + 1) & mask; this.table[slot] >= 0; slot = (slot + 1) & mask) {
      const home = this.hash(this.cells, this.table[slot] * width) & mask;
      if (((slot - home) & mask) < ((slot - gap) & mask)) continue;
      this.table[gap] = this.table[slot];
      gap = slot;
    }
    this.table[gap] = -1;
  }

  private reserve(cells: number) {
    if (2 * cells < this.table.length) return;
    let size = this.table.length;
    while (size <= 2 * cells) size *= 2;
    this.table = new Int32Array(size).fill(-1);
    const width = this.k + 1;
    for (let cell = 0; cell < this.simplices; cell++) {
      this.table[this.find(this.cells, cell * width)] = cell;
    }
  }
}
