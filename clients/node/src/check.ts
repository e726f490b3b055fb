// Whether an oracle is what it should be, and how large epsilon may be. A private server asks the
// questions, for clients in all languages alike.
import { Client } from "./client.js";
import { errorClass, OracleError } from "./errors.js";
import type { CheckReport__Output } from "./generated/stellate/v1/CheckReport.js";
import type { Oracle } from "./oracle.js";
import { Server } from "./server.js";
import { enumName } from "./wire.js";

/** One thing that was found. */
export interface Finding {
  /** "ERROR": a mesh will not come out right; "WARNING": it may not; "NOTE": worth knowing. */
  severity: string;
  /** Stable, e.g. "NOT_CLOSEST". */
  code: string;
  /** What is wrong, with the first counterexample. */
  message: string;
  /** What to do about it; may be empty. */
  advice: string;
}

/** What check() found. Lengths are in the coordinates' unit. */
export interface CheckReport {
  /** No error among the findings. */
  ok: boolean;
  /** Errors first, then warnings, then notes. */
  findings: Finding[];
  /** All of it in several lines, for people. */
  text: string;
  /** Points of M that were seen, and the queries that it took. */
  samples: number;
  queries: number;
  /** An estimate from above. */
  reach?: number;
  /** Components that points were seen on. */
  pieces?: number;
  /** Queries a second, by batch size, and the batch to answer in one call. */
  rates: Map<number, number>;
  bestBatch: number;
}

/**
 * Probes an oracle for its contract, before a mesh is made of its answers. What it throws is a finding,
 * too. `epsilon`: that a mesh is planned with.
 */
export async function check(oracle: Oracle, { epsilon = 0 } = {}): Promise<CheckReport> {
  const said = await examine(oracle, epsilon);
  const { ok, text, samples, queries, bestBatch } = said;
  const findings = said.findings.map(({ code, message, advice, severity }) => {
    return { code, message, advice, severity: enumName(severity, "SEVERITY_") };
  });
  const rates = new Map(said.rates.map((rate) => [rate.batch, rate.queriesPerSecond]));
  const reach = said._reach && said.reach;
  const pieces = said._pieces && said.pieces;
  return { ok, findings, text, samples, queries, reach, pieces, rates, bestBatch };
}

/**
 * A quarter of the reach that check() finds, to two digits, and a word about it: what mesh() takes for
 * the epsilon "auto". Throws OracleError where the oracle breaks its contract.
 */
export async function chooseEpsilon(oracle: Oracle): Promise<{ epsilon: number; reason: string }> {
  const { _epsilon, epsilon, epsilonReason, noEpsilon } = await examine(oracle, 0);
  if (_epsilon && epsilon !== undefined) return { epsilon, reason: epsilonReason };
  const { reason = "ORACLE_NO_REACH", message = "there is no epsilon" } = noEpsilon ?? {};
  throw new (errorClass(reason) ?? OracleError)(message, { reason });
}

async function examine(oracle: Oracle, epsilon: number): Promise<CheckReport__Output> {
  const server = await Server.start();
  const client = new Client(server);
  try {
    return await client.examine(oracle, epsilon);
  } finally {
    client.close();
    await server.close();
  }
}
