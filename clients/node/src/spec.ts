// From an oracle and options to the protocol's MeshSpec. Ranges are the server's to check.
import type { Criteria as WireCriteria } from "./generated/stellate/v1/Criteria.js";
import type { MeshLimits as WireLimits } from "./generated/stellate/v1/MeshLimits.js";
import type { MeshSpec } from "./generated/stellate/v1/MeshSpec.js";
import { InvalidArgument } from "./errors.js";
import type { CheckedOracle, Oracle } from "./oracle.js";
import { toWire } from "./wire.js";

type Plain<T> = { [Name in keyof T as Name extends `_${string}` ? never : Name]?: number };

/** All that is asked of a mesh beside its oracle. mesh.proto says what each means. */
export interface MeshOptions
  extends Omit<Plain<WireCriteria>, "speculative" | "commonCentre">, Plain<WireLimits> {
  /** Largest circumradius of a simplex, a length. */
  epsilon: number;
  speculative?: boolean;
  commonCentre?: boolean;
  seeds?: Float64Array;
  randomSeed?: number | bigint;
  label?: string;
  boxSeeds?: number;
  components?: number;
  /** A promise: M's reach is at least this. */
  reach?: number;
  coverBox?: boolean;
  audit?: "standard" | "thorough";
}

const CRITERIA = [
  "radiusEdgeBound",
  "sliverBound",
  "pickingRadius",
  "smallSliverRadius",
  "candidates",
  "advanceStep",
  "flatAlternations",
  "speculative",
  "commonCentre",
  "sizeRate",
  "maxDeviation",
  "protection",
] as const;
const LIMITS = [
  "maxVertices",
  "maxRounds",
  "workerWaitSeconds",
  "answerSeconds",
  "maxBatchQueries",
  "busySeconds",
] as const;
const SPEC = ["label", "boxSeeds", "components", "coverBox"] as const;
const OTHERS = ["epsilon", "seeds", "randomSeed", "reach", "audit"] as const;
const KNOWN: ReadonlySet<string> = new Set([...CRITERIA, ...LIMITS, ...SPEC, ...OTHERS]);

function picked<Name extends string>(
  options: { [name in Name]?: unknown },
  names: readonly Name[],
): Record<string, unknown> {
  const given = names.filter((name) => options[name] !== undefined);
  return Object.fromEntries(given.map((name) => [name, options[name]]));
}

/** Throws InvalidArgument for an unknown option or a value of the wrong type. */
export function meshSpec(checked: CheckedOracle, oracle: Oracle, options: MeshOptions): MeshSpec {
  for (const [name, value] of Object.entries(options) as [string, unknown][]) {
    const wrong = (what: string) =>
      new InvalidArgument(`${name} ${what}`, { details: { fields: { [name]: what } } });
    if (!KNOWN.has(name)) throw wrong(`is no option; known: ${[...KNOWN].sort().join(", ")}`);
    const like = { label: "string", audit: "string", seeds: "object" }[name];
    const flag = name === "coverBox" || name === "speculative" || name === "commonCentre";
    const wanted = like ?? (flag ? "boolean" : typeof value === "bigint" ? "bigint" : "number");
    if (value !== undefined && typeof value !== wanted) {
      throw wrong(`has to be a ${wanted}, and is ${typeof value}`);
    }
  }
  if (options.epsilon === undefined) throw new InvalidArgument("epsilon, a length, has no default");
  const { audit, randomSeed } = options;
  if (audit !== undefined && audit !== "standard" && audit !== "thorough") {
    throw new InvalidArgument(`audit is ${String(audit)} but must be "standard" or "thorough"`);
  }
  const seeds = options.seeds ?? oracle.seeds;
  const d = checked.d;
  return {
    dimension: checked.k,
    ambientDimension: d,
    epsilon: options.epsilon,
    oracle: checked.capabilities,
    walls: checked.walls,
    boundingBox: oracle.boundingBox && {
      lower: toWire(Float64Array.from(oracle.boundingBox[0]), d),
      upper: toWire(Float64Array.from(oracle.boundingBox[1]), d),
    },
    seeds: seeds && toWire(seeds, seeds.length / d, d),
    criteria: picked(options, CRITERIA),
    limits: picked(options, LIMITS),
    ...picked(options, SPEC),
    ...(randomSeed === undefined ? {} : { randomSeed: randomSeed.toString() }),
    ...(options.reach === undefined ? {} : { declaredReach: options.reach }),
    ...(audit === undefined ? {} : { audit: audit === "thorough" ? 2 : 1 }),
  };
}
