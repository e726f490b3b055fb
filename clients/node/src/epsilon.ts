// The epsilon "auto": what the doctor says, and what it goes on with where that was too coarse.
import { chooseEpsilon } from "./check.js";
import { AUTO } from "./generated/shared.js";
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
  return { ...(await chooseEpsilon(oracle)), retries: AUTO.retries };
}

/** What follows a mesh of that choice; undefined: nothing that a smaller epsilon would mend. */
export function finer(choice: Choice, report: Report): Choice | undefined {
  const found = choice.retries > 0 ? report.finer : undefined;
  return found && { ...found, retries: choice.retries - 1 };
}
