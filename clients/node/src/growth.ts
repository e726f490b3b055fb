// The client's copy of a mesh that grows by deltas.
import type { DeltaChunk__Output } from "./generated/stellate/v1/DeltaChunk.js";
import type { MeshDelta__Output } from "./generated/stellate/v1/MeshDelta.js";
import type { Orientation__Output } from "./generated/stellate/v1/Orientation.js";
import { protocolError } from "./errors.js";
import { bytesOfBits, joined, sameRow, sortedOrder, takeRows } from "./rows.js";
import { indices, numbers } from "./wire.js";

const UNSETTLED = 300_000; // vertex numbers of removed simplices at least; else half of those there

/**
 * Vertices and simplices as of the last complete revision. What comes and goes is put aside, and
 * settled for many revisions together. Everything throws a StellateError "PROTOCOL" where a delta does
 * not fit what came before.
 */
export class GrowingComplex {
  revision = 0;
  private count = 0;
  private coordinates = new Float64Array(1024);
  private rows: Uint32Array = new Uint32Array(); // in lexicographic order
  private added: Uint32Array[] = [];
  private removed: Uint32Array[] = [];
  private removedLength = 0;
  private pending: MeshDelta__Output[] = [];
  private bits?: Uint8Array; // the orientation of the last revision; not there: not known
  private boundary: [number, number][] = []; // vertices and their walls, as bits

  constructor(
    private readonly k: number,
    private readonly d: number,
  ) {}

  /** Takes one chunk; true when a revision is complete with it. */
  absorb(chunk: DeltaChunk__Output): boolean {
    const delta = chunk.delta;
    if (!delta) throw protocolError("a chunk without its delta");
    const begun = this.pending.at(-1)?.revision ?? delta.revision;
    if (delta.revision <= this.revision || begun !== delta.revision) {
      throw protocolError(`revision ${delta.revision} is out of order`);
    }
    this.pending.push(delta);
    this.bits = undefined;
    if (!chunk.complete) return false;
    const whole = this.pending;
    this.pending = [];
    try {
      for (const part of whole) this.addPoints(part.firstVertex, numbers(part.points, -1, this.d));
      for (const part of whole) this.change(part);
    } catch (error) {
      throw error instanceof RangeError ? protocolError(error.message) : error;
    }
    if (this.removedLength > Math.max(UNSETTLED, this.rows.length / 2)) this.settle();
    this.revision = delta.revision;
    return true;
  }

  /** Drops the chunks of a revision that was cut short: it will be sent again. */
  forgetPending(): void {
    this.pending = [];
  }

  /** Back to the empty mesh. What was given out stays what it is. */
  reset(): void {
    this.revision = this.count = this.removedLength = 0;
    this.coordinates = new Float64Array(1024);
    this.rows = new Uint32Array();
    this.added = [];
    this.removed = [];
    this.pending = [];
    this.boundary = [];
    this.bits = undefined;
  }

  /** Takes a chunk of the orientation, which comes after the last revision. */
  orient(chunk: Orientation__Output): void {
    const first = chunk.firstSimplex;
    const before = first === 0 ? new Uint8Array() : this.bits;
    this.bits = undefined;
    if (!chunk.orientable) return;
    if (!before || first !== 8 * before.length) {
      throw protocolError(`the orientation of simplex ${first} is out of order`);
    }
    this.bits = Buffer.concat([before, chunk.turned]);
  }

  /** A bit for each simplex, of a mesh that is over; undefined if it is not known. */
  turned(): Uint8Array | undefined {
    const count = this.simplices().length / (this.k + 1);
    if (this.bits) checkBits(this.bits, count);
    return this.bits;
  }

  /** [n], as bits the walls that each vertex lies on; undefined without a boundary. */
  walls(): BigUint64Array | undefined {
    if (!this.boundary.length) return undefined;
    const walls = new BigUint64Array(this.count);
    for (const [vertex, bits] of this.boundary) walls[vertex] = BigInt(bits);
    return walls;
  }

  /** Which of the vertices lie on walls. */
  addWalls(vertices: number[], walls: number[]): void {
    if (vertices.length !== walls.length || (vertices.at(-1) ?? -1) >= this.count) {
      const there = `the ${this.count} that there are`;
      throw protocolError(`walls of ${vertices.length} vertices do not fit ${there}`);
    }
    vertices.forEach((vertex, i) => this.boundary.push([vertex, walls[i]]));
  }

  /** [n, d]; vertices never change, so it stays true while the mesh grows. */
  points(): Float64Array {
    return this.coordinates.subarray(0, this.count * this.d);
  }

  /** [m, k+1], ids ascending in each row, rows in lexicographic order. */
  simplices(): Uint32Array {
    this.settle();
    return this.rows;
  }

  /** Makes simplices() cheap. */
  settle(): void {
    if (!this.added.length && !this.removed.length) return;
    const width = this.k + 1;
    const all = joined([this.rows, ...this.added, ...this.removed]);
    const total = all.length / width;
    const firstRemoved = total - this.removedLength / width;
    const order = sortedOrder(all, width);
    const left: number[] = [];
    for (let i = 0; i < total;) {
      let there = 0;
      const row = order[i];
      for (; i < total && sameRow(all, width, row, order[i]); i++) {
        there += order[i] < firstRemoved ? 1 : -1;
      }
      if (there < 0) throw protocolError("a delta removes simplices that are not there");
      if (there > 1) throw protocolError("a delta adds simplices that are there already");
      if (there) left.push(row);
    }
    this.rows = takeRows(all, width, left);
    this.added = [];
    this.removed = [];
    this.removedLength = 0;
  }

  private change(delta: MeshDelta__Output): void {
    this.addWalls(delta.boundaryVertices, delta.boundaryWalls);
    const added = indices(delta.added, -1, this.k + 1);
    const removed = indices(delta.removed, -1, this.k + 1);
    for (const id of added) {
      if (id >= this.count) {
        throw protocolError(`a simplex has vertex ${id} of ${this.count} vertices`);
      }
    }
    if (added.length) this.added.push(added);
    if (removed.length) this.removed.push(removed);
    this.removedLength += removed.length;
  }

  /** New vertices, the first with that id. */
  addPoints(first: number, block: Float64Array): void {
    if (!block.length) return;
    if (first !== this.count) {
      throw protocolError(`a delta starts at vertex ${first}, and there are ${this.count}`);
    }
    const begin = first * this.d;
    const end = begin + block.length;
    if (end > this.coordinates.length) {
      const larger = new Float64Array(Math.max(end, 2 * this.coordinates.length));
      larger.set(this.points());
      this.coordinates = larger;
    }
    this.coordinates.set(block, begin);
    this.count = end / this.d;
  }
}

/** Throws if an orientation is not that of so many simplices. */
export function checkBits(turned: Uint8Array, count: number): void {
  if (turned.length === bytesOfBits(count)) return;
  throw protocolError(`an orientation of ${turned.length} bytes came for ${count} simplices`);
}
