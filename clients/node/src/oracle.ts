// What a manifold has to answer, and the checks that answers pass before they are sent.
import { InvalidArgument, OracleError } from "./errors.js";

/** Points, and where they were found: one byte a point, 1 or 0. */
export interface Found {
  points: Float64Array;
  found: Uint8Array;
}

type Soon<T> = T | Promise<T>;

/**
 * A compact smooth k-submanifold M of R^d without boundary, 1 <= k < d, unless it has `walls`.
 *
 * Every method takes and returns whole batches, one point after the other, and may be async. The
 * answer to a query must not depend on the rest of its batch.
 */
export interface Oracle {
  /** k */
  dimension: number;
  /** d */
  ambientDimension: number;
  /** Where to look for M: two corners; or `seeds`. */
  boundingBox?: [ArrayLike<number>, ArrayLike<number>];
  /** [m, d], points near M, one at least on each component. */
  seeds?: Float64Array;
  /** [n, d] -> [n, d]: a point of M nearest to each; `Found` where some have none. */
  closestPoint(points: Float64Array, n: number): Soon<Float64Array | Found>;
  /**
   * The point of M nearest to each center [n, d] in the flat through it that is orthogonal to the
   * columns of its basis [n, d, k], within the radius [n].
   */
  intersectFlat?(
    centers: Float64Array,
    bases: Float64Array,
    radii: Float64Array,
    n: number,
  ): Soon<Found>;
  /** At points of M: [n, d] -> [n, d, k], orthonormal columns. */
  tangentBasis?(points: Float64Array, n: number): Soon<Float64Array>;
  /** At points of M: [n, d] -> [n], the local feature size or any positive lengths of yours. */
  localSize?(points: Float64Array, n: number): Soon<Float64Array>;
  /**
   * How many walls bound M, at most 53, which has a boundary then: it is where all walls are at least 0
   * on M^, a manifold without one, which the methods above describe; it may be R^d itself. Walls take
   * tangentBasis and the three methods below. The walls of a face ascend.
   */
  walls?: number;
  /** As closestPoint, of points of M^ where the walls of the face are 0, whatever the others are. */
  facePoint?(points: Float64Array, n: number, face: number[]): Soon<Float64Array | Found>;
  /** The walls' values at points, whose signs count: [n, d] -> [n, walls]. */
  clearances?(points: Float64Array, n: number): Soon<Float64Array>;
  /**
   * At points of a face, of each of its walls the unit normal within the tangent space along which the
   * wall's value falls: [n, d] -> [n, face.length, d].
   */
  conormals?(points: Float64Array, n: number, face: number[]): Soon<Float64Array>;
}

/** Throws InvalidArgument for an oracle that cannot be one. */
export function checkOracle(oracle: Oracle): void {
  for (const name of ["dimension", "ambientDimension"] as const) {
    const value: unknown = oracle[name];
    if (!Number.isInteger(value)) {
      throw new InvalidArgument(`the oracle's ${name} has to be a whole number: ${String(value)}`);
    }
  }
  if (typeof oracle.closestPoint !== "function") {
    throw new InvalidArgument("the oracle has no method closestPoint(points, n)");
  }
  if (oracle.walls !== undefined) checkWalls(oracle, oracle.walls);
  const d = oracle.ambientDimension;
  for (const corner of oracle.boundingBox ?? []) {
    if (corner.length !== d) {
      throw new InvalidArgument(`boundingBox has a corner of ${corner.length} numbers, not ${d}`);
    }
  }
  if (oracle.seeds && oracle.seeds.length % d !== 0) {
    throw new InvalidArgument(`${oracle.seeds.length} numbers are no seeds in R^${d}`);
  }
}

function checkWalls(oracle: Oracle, walls: number): void {
  if (!Number.isInteger(walls) || walls < 0 || walls > 53) {
    throw new InvalidArgument(`walls has to be a whole number up to 53, and is ${walls}`);
  }
  const wanted = ["tangentBasis", "facePoint", "clearances", "conormals"] as const;
  const lacking = walls ? wanted.filter((name) => oracle[name] === undefined) : [];
  if (lacking.length) {
    throw new InvalidArgument(`the oracle has walls, and lacks ${lacking.join(" and ")}`);
  }
}

/** An oracle as the server sees it: shapes and finiteness are checked, with clear words. */
export class CheckedOracle {
  readonly k: number;
  readonly d: number;
  readonly walls: number;

  constructor(private readonly oracle: Oracle) {
    checkOracle(oracle);
    this.k = oracle.dimension;
    this.d = oracle.ambientDimension;
    this.walls = oracle.walls ?? 0;
  }

  get capabilities() {
    return {
      intersectFlat: this.oracle.intersectFlat !== undefined,
      tangentBasis: this.oracle.tangentBasis !== undefined,
      localSize: this.oracle.localSize !== undefined,
      conormals: this.walls > 0,
    };
  }

  /** Of a face, if there is one. */
  async closestPoints(points: Float64Array, n: number, face: number[] = []): Promise<Found> {
    if (face.length) {
      return this.checked("facePoint", await this.oracle.facePoint?.(points, n, face), n);
    }
    const answer = await this.oracle.closestPoint(points, n);
    return this.checked("closestPoint", answer, n);
  }

  async intersections(
    centers: Float64Array,
    bases: Float64Array,
    radii: Float64Array,
    n: number,
  ): Promise<Found> {
    const answer = await this.oracle.intersectFlat?.(centers, bases, radii, n);
    return this.checked("intersectFlat", answer, n);
  }

  /** [n, d, k]; rows that were not found hold any basis. */
  async tangents(answer: Found, n: number): Promise<Float64Array> {
    const anywhere = new Float64Array(this.d * this.k);
    for (let a = 0; a < this.k; a++) anywhere[a * this.k + a] = 1;
    return this.atFound("tangentBasis", answer, n, anywhere);
  }

  /** [n]; rows that were not found hold any size. */
  async sizes(answer: Found, n: number): Promise<Float64Array> {
    return this.atFound("localSize", answer, n, Float64Array.of(1));
  }

  /** [n, walls]; rows that were not found hold any. */
  async clearances(answer: Found, n: number): Promise<Float64Array> {
    return this.atFound("clearances", answer, n, new Float64Array(this.walls));
  }

  /** [n, face.length, d]; rows that were not found hold any. */
  async conormals(answer: Found, n: number, face: number[]): Promise<Float64Array> {
    return this.atFound("conormals", answer, n, new Float64Array(face.length * this.d), face);
  }

  private async atFound(
    method: "tangentBasis" | "localSize" | "clearances" | "conormals",
    { points, found }: Found,
    n: number,
    anywhere: Float64Array,
    face: number[] = [],
  ): Promise<Float64Array> {
    const rows: number[] = [];
    for (let i = 0; i < n; i++) if (found[i]) rows.push(i);
    const everywhere = rows.length === n;
    const d = this.d;
    let asked = points;
    if (!everywhere) {
      asked = new Float64Array(rows.length * d);
      rows.forEach((row, i) => asked.set(points.subarray(row * d, row * d + d), i * d));
    }
    const width = anywhere.length;
    const answer = rows.length ? await this.oracle[method]?.(asked, rows.length, face) : asked;
    const values = numbersOf(method, answer, rows.length, width);
    values.forEach((value, i) => {
      if (!Number.isFinite(value)) throw notFinite(method, Math.floor(i / width), value);
    });
    if (everywhere) return values;
    const spread = new Float64Array(n * width);
    for (let i = 0; i < n; i++) spread.set(anywhere, i * width);
    rows.forEach((row, i) => spread.set(values.subarray(i * width, (i + 1) * width), row * width));
    return spread;
  }

  private checked(method: string, answer: unknown, n: number): Found {
    const some = typeof answer === "object" && answer !== null && "points" in answer;
    const points = numbersOf(method, some ? answer.points : answer, n, this.d);
    const found = some ? (answer as Partial<Found>).found : new Uint8Array(n).fill(1);
    if (!(found instanceof Uint8Array) || found.length !== n) {
      throw new OracleError(`${method}: found has to be a Uint8Array of ${n}`, {
        reason: "ORACLE_SHAPE",
      });
    }
    for (let i = 0; i < points.length; i++) {
      const row = Math.floor(i / this.d);
      if (!Number.isFinite(points[i]) && found[row]) throw notFinite(method, row, points[i]);
    }
    return { points, found };
  }
}

function numbersOf(method: string, value: unknown, n: number, width: number): Float64Array {
  if (value instanceof Float64Array && value.length === n * width) return value;
  throw new OracleError(
    `${method} returned ${whatIs(value)}; for ${n} points it has to be a Float64Array of ${n * width}`,
    { reason: "ORACLE_SHAPE" },
  );
}

// Of an answer: "a plain array of 6", "undefined".
function whatIs(value: unknown): string {
  if (value instanceof Float64Array) return `${value.length} numbers`;
  if (Array.isArray(value)) return `a plain array of ${value.length}`;
  if (typeof value !== "object" || value === null) return String(value);
  return `an object of class ${value.constructor?.name ?? "none"}`;
}

function notFinite(method: string, row: number, value: number): OracleError {
  return new OracleError(`${method} returned ${value} for point ${row} of its batch`, {
    reason: "ORACLE_NOT_FINITE",
  });
}
