// Points on their way to a server, through breaks of the connection.
import { createHash } from "node:crypto";
import { InvalidArgument } from "./errors.js";
import type { PointsChunk } from "./generated/stellate/v1/PointsChunk.js";
import type { Reconstruction } from "./generated/stellate/v1/Reconstruction.js";
import { toWire } from "./wire.js";

const CHUNK_BYTES = 1 << 20; // of the points in a message, where the server takes as much

/** What is asked of a mesh of points. Ranges are the server's to check. */
export interface PointOptions {
  /** k of the manifold, 1 to 3. */
  dimension: number;
  /** d, more than k: the points' array is [n, d], one point after the other. */
  ambientDimension: number;
  /** [n, d, k], of each point orthonormal tangent vectors, its columns. Default: estimated. */
  tangents?: Float64Array;
  /** The standard deviation of each coordinate, a length; 0: the points are exact. Default: as they show. */
  noise?: number;
  /** A promise: the manifold's reach is at least this length. Exact points may then be proved. */
  reach?: number;
  /** The share of the points that may be left out, 0 to 0.5. Default: one in a thousand. */
  drop?: number;
  /** False: the manifold may have a boundary, and the mesh ends where the points do. */
  closed?: boolean;
  /**
   * "only": the weighted tangential Delaunay complex. Stars are made to agree by weights of points alone, or
   * the mesh is refused. Default: "auto", tilings first.
   */
  weights?: "auto" | "only";
  /** True: points may be added where nothing else makes stars agree. They are vertices after the points. */
  steiner?: boolean;
  label?: string;
  workerWaitSeconds?: number;
  answerSeconds?: number;
}

const KNOWN: ReadonlySet<string> = new Set([
  "dimension",
  "ambientDimension",
  "tangents",
  "noise",
  "reach",
  "drop",
  "closed",
  "weights",
  "steiner",
  "label",
  "workerWaitSeconds",
  "answerSeconds",
]);

const WEIGHTINGS = { auto: "WEIGHTING_AUTO", only: "WEIGHTING_ONLY" } as const;

/** Points, and what is asked of their mesh: checked, as the protocol has it. */
export class CheckedPoints {
  readonly spec: Reconstruction;
  readonly count: number;

  constructor(
    readonly points: Float64Array,
    private readonly options: PointOptions,
  ) {
    const unknown = Object.keys(options).find((name) => !KNOWN.has(name));
    if (unknown !== undefined) throw new InvalidArgument(`there is no option '${unknown}'`);
    const { dimension: k, ambientDimension: d, tangents } = options;
    for (const [name, value] of Object.entries({ dimension: k, ambientDimension: d })) {
      if (!Number.isInteger(value) || value < 1) {
        throw new InvalidArgument(`${name} has to be a whole number from 1 on, and is ${value}`);
      }
    }
    this.count = points.length / d;
    if (!Number.isInteger(this.count)) {
      throw new InvalidArgument(`${points.length} numbers are no whole points of R^${d}`);
    }
    const bad = points.findIndex((x) => !Number.isFinite(x));
    if (bad >= 0) throw new InvalidArgument(`point ${Math.floor(bad / d)} is not finite`);
    if (tangents && tangents.length !== k * points.length) {
      throw new InvalidArgument(
        `tangents have ${tangents.length} numbers, and need ${k * points.length}: [n, d, k]`,
      );
    }
    const { weights = "auto", workerWaitSeconds, answerSeconds } = options;
    if (!Object.hasOwn(WEIGHTINGS, weights)) {
      throw new InvalidArgument(`weights has to be "auto" or "only", and is ${String(weights)}`);
    }
    this.spec = {
      dimension: k,
      ambientDimension: d,
      points: this.count,
      tangents: tangents !== undefined,
      open: options.closed === false,
      label: options.label,
      limits: { workerWaitSeconds, answerSeconds },
      noise: options.noise,
      declaredReach: options.reach,
      drop: options.drop,
      weights: WEIGHTINGS[weights],
      steiner: options.steiner === true,
    };
  }

  /** The messages of an upload, from a point on. `mostBytes`: that the server takes in one. */
  *chunks(mesh: string, first: number, mostBytes: number): Generator<PointsChunk> {
    const { dimension: k, ambientDimension: d, tangents } = this.options;
    const numbers = d * (tangents ? 1 + k : 1);
    const rows = Math.max(1, Math.floor(Math.min(CHUNK_BYTES, mostBytes / 2) / (8 * numbers)));
    yield { mesh };
    for (let row = first; row < this.count; row += rows) {
      const end = Math.min(row + rows, this.count);
      const block = toWire(this.points.subarray(row * d, end * d), end - row, d);
      const bases = tangents?.subarray(row * d * k, end * d * k);
      const more = bases ? { tangents: toWire(bases, end - row, d, k) } : {};
      yield { points: { firstRow: row, points: block, ...more } };
    }
    const more = tangents ? { tangentsSha256: digest(tangents) } : {};
    yield { end: { pointsSha256: digest(this.points), ...more } };
  }
}

function digest(values: Float64Array): Buffer {
  const { buffer, byteOffset, byteLength } = values;
  return createHash("sha256")
    .update(new Uint8Array(buffer, byteOffset, byteLength))
    .digest();
}
