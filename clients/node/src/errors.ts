// What can go wrong. Every error of ours is a StellateError with a stable upper-case `reason` (one of
// the protocol's ErrorReason) for programs and a message for people. What an oracle throws is not
// among them: it reaches the caller as itself.
import type { Mesh } from "./mesh.js";
import { decodeDetail, grpc } from "./wire.js";

export interface ErrorOptions {
  reason?: string;
  details?: Record<string, unknown>;
  mesh?: Mesh;
}

/** Base of all errors of this package. */
export class StellateError extends Error {
  /** Stable name of what happened, e.g. "ORACLE_NOT_FINITE". */
  readonly reason: string;
  /** What else is known, e.g. {fields: {epsilon: "must be positive"}}. */
  readonly details: Record<string, unknown>;
  /** The unfinished mesh as far as it came, where there is one. */
  mesh?: Mesh;

  constructor(message: string, options: ErrorOptions = {}) {
    super(message);
    this.name = new.target.name;
    this.reason = options.reason ?? "UNSPECIFIED";
    this.details = options.details ?? {};
    this.mesh = options.mesh;
  }
}

function kind(defaultReason: string) {
  return class extends StellateError {
    constructor(message: string, options: ErrorOptions = {}) {
      super(message, { ...options, reason: options.reason ?? defaultReason });
    }
  };
}

/** A specification that makes no sense. Mend the field that the message names. */
export class InvalidArgument extends kind("INVALID_ARGUMENT") {}
/** More than the server is willing to do. Ask for less, or raise its limit. */
export class LimitExceeded extends kind("LIMIT_EXCEEDED") {}
/** No mesh has this name: it is misspelt, or the mesh was deleted. */
export class MeshNotFound extends kind("MESH_NOT_FOUND") {}
/** A call out of order, such as serving a mesh that is over. */
export class FailedPrecondition extends kind("FAILED_PRECONDITION") {}
/** The server wants a token, and got none that it knows. */
export class Unauthenticated extends kind("UNAUTHENTICATED") {}
/** The oracle's answers break a rule, or the mesh got none. Mend the oracle. */
export class OracleError extends kind("ORACLE_FAILED") {}
/** The mesh was cancelled, by `signal` or by somebody else. */
export class Cancelled extends kind("CANCELLED") {}
/** The server cannot be reached, or is stopping. */
export class Unavailable extends kind("UNAVAILABLE") {}
/** No server was given, and there is no stellated on this machine to start. */
export class ServerNotFound extends kind("SERVER_NOT_FOUND") {}
/** A mesh that the chosen file format cannot hold. */
export class SaveError extends kind("FORMAT") {}
/** The mesh is finished and not proved good, which `requireCertified` insists on. */
export class NotCertified extends kind("NOT_CERTIFIED") {}

const DOMAIN = "stellate.v1";

type Kind = new (message: string, options?: ErrorOptions) => StellateError;

const BY_REASON: Record<string, Kind | undefined> = {
  INVALID_ARGUMENT: InvalidArgument,
  OUT_OF_ORDER: FailedPrecondition,
  LIMIT_EXCEEDED: LimitExceeded,
  MESH_NOT_FOUND: MeshNotFound,
  FAILED_PRECONDITION: FailedPrecondition,
  SHUTTING_DOWN: Unavailable,
  UNAUTHENTICATED: Unauthenticated,
  REVISION_TOO_NEW: InvalidArgument,
  NO_SEEDS: OracleError,
  NO_WORKER: OracleError,
  ANSWER_TIMEOUT: OracleError,
  WORKERS_DISAGREE: OracleError,
  INTERNAL: StellateError,
  JOURNAL_FULL: StellateError,
  JOURNAL_FAILED: StellateError,
  REPLAY_MISMATCH: StellateError,
};

const BY_CODE: { [code: number]: Kind | undefined } = {
  [grpc.status.INVALID_ARGUMENT]: InvalidArgument,
  [grpc.status.OUT_OF_RANGE]: InvalidArgument,
  [grpc.status.PERMISSION_DENIED]: Unauthenticated,
  [grpc.status.RESOURCE_EXHAUSTED]: LimitExceeded,
  [grpc.status.NOT_FOUND]: MeshNotFound,
  [grpc.status.FAILED_PRECONDITION]: FailedPrecondition,
  [grpc.status.UNAUTHENTICATED]: Unauthenticated,
  [grpc.status.ABORTED]: OracleError,
  [grpc.status.CANCELLED]: Cancelled,
  [grpc.status.UNAVAILABLE]: Unavailable,
  [grpc.status.DEADLINE_EXCEEDED]: Unavailable,
};

/** The class for one of the protocol's reasons; of a newer server's, for the code beside it. */
export function errorClass(reason: string, code: grpc.status = grpc.status.UNKNOWN): Kind {
  if (reason.startsWith("ORACLE_")) return OracleError;
  return BY_REASON[reason] ?? BY_CODE[code] ?? StellateError;
}

interface AnyMessage {
  type_url: string; // as protobufjs has it
  value: Uint8Array;
}

/** The reason, and what else the server says; nothing of what stands between us and it. */
function namedIn(bytes: Uint8Array): [string, Record<string, unknown>] {
  let reason = "";
  const details: Record<string, unknown> = {};
  const status = decodeDetail("Status", bytes) as unknown as { details: AnyMessage[] };
  for (const part of status.details) {
    const type = part.type_url.split("/").pop();
    if (type === "google.rpc.ErrorInfo") {
      const info = decodeDetail("ErrorInfo", part.value);
      if (info.domain !== DOMAIN) continue;
      reason = info.reason as string;
      Object.assign(details, info.metadata);
    } else if (type === "google.rpc.BadRequest") {
      const { fieldViolations } = decodeDetail("BadRequest", part.value);
      const violations = fieldViolations as { field: string; description: string }[];
      details.fields = Object.fromEntries(violations.map((v) => [v.field, v.description]));
    }
  }
  return [reason, details];
}

/** Our error for a failed rpc, with the reason and the fields that the server named. */
export function fromRpc(error: grpc.ServiceError): StellateError {
  let reason = "";
  const details: Record<string, unknown> = { grpcCode: grpc.status[error.code] };
  for (const value of error.metadata?.get("grpc-status-details-bin") ?? []) {
    try {
      const [named, more] = namedIn(value as Buffer);
      reason = named;
      Object.assign(details, more);
    } catch {
      continue; // of whatever stands between us and the server
    }
  }
  let message = error.details || grpc.status[error.code];
  if (error.code === grpc.status.UNAUTHENTICATED) {
    message += "; give a token with credentials: { token }";
  }
  return new (errorClass(reason, error.code))(message, { reason: reason || undefined, details });
}

/** For what a server sent that it must not send. */
export function protocolError(what: string): StellateError {
  return new StellateError(`the server broke the protocol: ${what}`, { reason: "PROTOCOL" });
}
