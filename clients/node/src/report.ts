// How a mesh stands, how it ended, and what was proved of it: the protocol's messages, with
// enumerators as names without their prefix.
import type { Certificate__Output } from "./generated/stellate/v1/Certificate.js";
import type { Counts__Output } from "./generated/stellate/v1/Counts.js";
import type { Failure__Output } from "./generated/stellate/v1/Failure.js";
import type { Mesh__Output } from "./generated/stellate/v1/Mesh.js";
import type { Progress__Output } from "./generated/stellate/v1/Progress.js";
import type { Report__Output } from "./generated/stellate/v1/Report.js";
import { enumName } from "./wire.js";

/** A picture of a mesh at work. `phase` is "SEEDING", "REFINING", "CERTIFYING" or "DONE". */
export type Progress = Omit<Progress__Output, "phase"> & { phase: string };
/** `level` is "REFUSED", "SAMPLED" or "PROVED". */
export type Certificate = Omit<Certificate__Output, "level"> & { level: string };

export interface Report {
  /** "CONVERGED", "VERTEX_BUDGET", "ROUND_BUDGET", "CANCELLED", "ORACLE_FAILED", "NO_PROGRESS" */
  termination: string;
  certified: boolean;
  /** In plain words; the first thing wrong if not certified. */
  verdict: string;
  failure?: Failure__Output;
  counts?: Counts__Output;
  certificate?: Certificate;
  elapsedSeconds: number;
  /** That the mesh was made with. */
  epsilon: number;
  /** Why it is that, where mesh() or watch() chose it; else "". */
  epsilonReason: string;
  /** With which epsilon to mesh again, where this one was too coarse for a certificate: "auto" does. */
  finer?: { epsilon: number; reason: string };
  /** All of it in several lines, for people. */
  text: string;
}

/** A mesh on the server, without its geometry. */
export interface MeshInfo {
  name: string;
  /** "WAITING", "RUNNING", "SUCCEEDED", "STOPPED", "CANCELLED" or "FAILED" */
  state: string;
  label: string;
  dimension: number;
  ambientDimension: number;
  epsilon: number;
  over: boolean;
  revision: number;
  progress?: Progress;
  report?: Report;
  workers: number;
  watchers: number;
}

export function progressFrom(message: Progress__Output): Progress {
  return { ...message, phase: enumName(message.phase, "PHASE_") };
}

export function reportFrom(message: Report__Output, epsilon: number): Report {
  const proved = message.certificate;
  return {
    termination: enumName(message.termination, "TERMINATION_"),
    certified: proved?.certified ?? false,
    verdict: proved?.verdict ?? message.failure?.message ?? "",
    failure: message.failure ?? undefined,
    counts: message.counts ?? undefined,
    certificate: proved
      ? { ...proved, level: enumName(proved.level, "CERTIFICATE_LEVEL_") }
      : undefined,
    elapsedSeconds: message.elapsedSeconds,
    epsilon,
    epsilonReason: "",
    finer: message.finer ?? undefined,
    text: message.text,
  };
}

export function infoFrom(mesh: Mesh__Output): MeshInfo {
  return {
    name: mesh.name,
    state: enumName(mesh.state, "MESH_STATE_"),
    label: mesh.spec?.label ?? "",
    dimension: (mesh.spec?.dimension ?? 0) - (mesh.spec?.boundaryOnly ? 1 : 0),
    ambientDimension: mesh.spec?.ambientDimension ?? 0,
    epsilon: mesh.spec?.epsilon ?? 0,
    over: mesh.endTime != null,
    revision: mesh.revision,
    progress: mesh.progress ? progressFrom(mesh.progress) : undefined,
    report: mesh.report ? reportFrom(mesh.report, mesh.spec?.epsilon ?? 0) : undefined,
    workers: mesh.workers,
    watchers: mesh.watchers,
  };
}
