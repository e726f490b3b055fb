// The epsilon "auto": what the doctor says, and what it goes on with where that was too coarse.
import { chooseEpsilon } from "./check.js";
import { general } from "./decimal.js";
import { DOCTOR } from "./generated/shared.js";
import type { Oracle } from "./oracle.js";
import type { Report } from "./report.js";

/** An epsilon; if "auto" chose it, why, and how many finer ones may follow. */
export interface Choice {
  epsilon: number;
  reason: string;
  retries: number;
}

/** What an oracle is meshed with at first. */
export async function choose(oracle: Oracle, epsilon: number | "auto"): Promise<Choice> {
  if (epsilon !== "auto") return { epsilon, reason: "", retries: 0 };
  return { ...(await chooseEpsilon(oracle)), retries: DOCTOR.auto_retries };
}

/** What follows a mesh of that choice; undefined: nothing that a smaller epsilon would mend. */
export function finer(choice: Choice, report: Report): Choice | undefined {
  const found = choice.retries > 0 ? finerEpsilon(report) : undefined;
  return found && { ...found, retries: choice.retries - 1 };
}

/** A quarter of the reach that a certificate shows, where its mesh is too coarse for it. */
export function finerEpsilon(report: Report): { epsilon: number; reason: string } | undefined {
  const { certificate, termination, epsilon } = report;
  const ended = termination === "CONVERGED" || termination === "NO_PROGRESS";
  if (!certificate || certificate.certified || certificate.reachRefuted || !ended) return undefined;
  const reach = certificate.estimatedReach;
  const coarsest = DOCTOR.safe_ratio * reach;
  if (!(coarsest > 0 && coarsest < epsilon)) return undefined;
  const why =
    `a quarter of the reach, about ${general(reach, 3)} ` +
    `by the certificate of epsilon ${general(epsilon, 6)}, which was too coarse`;
  const quarter = rounded(reach / DOCTOR.auto_epsilon);
  const least = rounded(DOCTOR.auto_least_share * epsilon);
  if (quarter < least) return { epsilon: least, reason: `no finer in one step, though ${why}` };
  return { epsilon: quarter, reason: why };
}

function rounded(length: number): number {
  return Number(general(length, 2));
}
