// A mesh, finished or growing.
import { readFile, rename, writeFile } from "node:fs/promises";
import { extname } from "node:path";
import { general } from "./decimal.js";
import { SaveError } from "./errors.js";
import type { Progress, Report } from "./report.js";
import { isSet, sameRow, sortedOrder, takeRows } from "./rows.js";

/** A simplicial k-complex in R^d. */
export class Mesh {
  constructor(
    /** k */
    readonly dimension: number,
    /** d */
    readonly ambientDimension: number,
    /** [n, d], one point after the other. */
    readonly points: Float64Array,
    /** [m, k+1], zero-based, ids ascending in each row, rows in lexicographic order. */
    readonly simplices: Uint32Array,
    /** One for each round that changed the mesh. */
    readonly revision: number,
    /** How it stood at this revision. */
    readonly progress?: Progress,
    /** How it ended and what is proved; not there while it grows. */
    readonly report?: Report,
    /** [n], as bits the walls that each vertex lies on; not there without a boundary. */
    readonly walls?: BigUint64Array,
    /** The protocol's Orientation.turned: see orientedSimplices(). */
    readonly turned?: Uint8Array,
    /** [n], of a reconstruction: what became of each point, "OK", "MERGED", "EDGE"... */
    readonly places?: string[],
    /** [n, d], of one from noisy points: the positions that the complex was built on. */
    readonly smoothed?: Float64Array,
  ) {}

  get vertexCount(): number {
    return this.points.length / this.ambientDimension;
  }

  get simplexCount(): number {
    return this.simplices.length / (this.dimension + 1);
  }

  /** Whether the mesh is finished and proved good. */
  get certified(): boolean {
    return this.report?.certified ?? false;
  }

  /**
   * The (k-1)-faces that are in one simplex alone, [m, k], in lexicographic order; each lies on the
   * walls that all its vertices have in common.
   */
  boundary(): Uint32Array {
    const k = this.dimension;
    const faces = new Uint32Array(this.simplices.length * k);
    let at = 0;
    for (let row = 0; row < this.simplices.length; row += k + 1) {
      for (let left = row; left <= row + k; left++) {
        for (let i = row; i <= row + k; i++) if (i !== left) faces[at++] = this.simplices[i];
      }
    }
    const order = sortedOrder(faces, k);
    const same = (i: number, j: number) =>
      i >= 0 && j < order.length && sameRow(faces, k, order[i], order[j]);
    const once = [...order].filter((_, i) => !same(i - 1, i) && !same(i, i + 1));
    return takeRows(faces, k, once);
  }

  /**
   * The simplices with the last two vertices of some exchanged so that neighbours agree, and the
   * normals of a hypersurface point outwards. The server tells it of meshes that are over. Undefined if
   * the mesh is not orientable, and where that is not known: while it grows, and of a .txt file.
   */
  orientedSimplices(): Uint32Array | undefined {
    if (!this.turned) return undefined;
    const oriented = this.simplices.slice();
    for (let s = 0; s < this.simplexCount; s++) {
      if (!isSet(this.turned, s)) continue;
      const last = (s + 1) * (this.dimension + 1) - 1;
      [oriented[last - 1], oriented[last]] = [oriented[last], oriented[last - 1]];
    }
    return oriented;
  }

  /**
   * Writes .txt (any k and d, exact: "k d nv ns", coordinates, ids from zero) or .obj (curves and
   * surfaces, d <= 3, oriented as orientedSimplices() are). `stellate download` writes the other formats.
   * Throws SaveError for what the format cannot hold.
   */
  async save(path: string): Promise<void> {
    checkSave(path, this.dimension, this.ambientDimension);
    const text = extname(path) === ".txt" ? this.toTxt() : this.toObj();
    const part = `${path}.part`; // the file takes its name when it is whole
    await writeFile(part, text);
    await rename(part, path);
  }

  private toTxt(): string {
    const [k, d] = [this.dimension, this.ambientDimension];
    const head = `${k} ${d} ${this.vertexCount} ${this.simplexCount}`;
    return [head, ...lines(this.points, d), ...lines(this.simplices, k + 1), ""].join("\n");
  }

  private toObj(): string {
    const d = this.ambientDimension;
    const fill = d === 2 ? " 0" : "";
    const letter = this.dimension === 1 ? "l" : "f";
    const ids = (this.orientedSimplices() ?? this.simplices).map((id) => id + 1);
    const vertices = lines(this.points, d).map((line) => `v ${line}${fill}`);
    const cells = lines(ids, this.dimension + 1).map((line) => `${letter} ${line}`);
    return [...vertices, ...cells, ""].join("\n");
  }
}

/** Reads the .txt format back, to the last bit. */
export async function loadTxt(path: string): Promise<Mesh> {
  const words = (await readFile(path, "utf8")).trim().split(/\s+/).map(Number);
  const [k, d, vertices, simplices] = words;
  const end = 4 + d * vertices;
  if (words.length !== end + (k + 1) * simplices || words.some(Number.isNaN)) {
    throw new SaveError(`${path} does not have the numbers that its first line speaks of`);
  }
  const points = Float64Array.from(words.slice(4, end));
  return new Mesh(k, d, points, Uint32Array.from(words.slice(end)), 0);
}

/** Throws SaveError if a mesh of that kind cannot be saved under the name. */
export function checkSave(path: string, k: number, d: number): void {
  const ending = extname(path);
  if (ending === ".txt") return;
  if (ending !== ".obj") {
    throw new SaveError(
      `${path} has to end in .txt or .obj; "stellate download" writes the other formats`,
    );
  }
  if (k > 2 || d > 3) {
    throw new SaveError(`.obj holds curves and surfaces in the plane and in space: take .txt`);
  }
}

function lines(values: Float64Array | Uint32Array, width: number): string[] {
  const rows: string[] = [];
  for (let i = 0; i < values.length; i += width) {
    rows.push(Array.from(values.subarray(i, i + width), (value) => general(value, 17)).join(" "));
  }
  return rows;
}
