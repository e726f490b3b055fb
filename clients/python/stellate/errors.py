"""What can go wrong, as exceptions.

Every error of ours is a StellateError with a stable upper-case `reason` for programs (one of the
protocol's ErrorReason) and a message for people. An exception that an oracle raises is not among
them: it reaches the caller as itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import grpc
import numpy as np
from google.protobuf.message import DecodeError

from . import _shared
from ._complex import Complex
from ._generated import status_details_pb2 as details_pb

__all__ = [
    "Cancelled",
    "ExecutorError",
    "FailedPrecondition",
    "Interrupted",
    "InvalidArgument",
    "LimitExceeded",
    "MeshNotFound",
    "NotCertified",
    "NotConverged",
    "OracleError",
    "SaveError",
    "ServerNotFound",
    "StellateError",
    "Unauthenticated",
    "Unavailable",
    "UncertifiedWarning",
    "ViewerNotFound",
]


class StellateError(Exception):
    """Base of all errors of this package.

    Attributes:
      reason: stable name of what happened, e.g. "ORACLE_NOT_FINITE".
      details: what else is known, e.g. {"fields": {"epsilon": "must be positive"}}.
      mesh: the unfinished mesh as far as it came, where there is one.
    """

    default_reason = "UNSPECIFIED"

    def __init__(
        self,
        message: str,
        reason: str | None = None,
        details: Mapping[str, Any] | None = None,
        mesh: Complex | None = None,
    ) -> None:
        super().__init__(message)
        self.reason = reason or self.default_reason
        self.details = dict(details or {})
        self.mesh = mesh


class InvalidArgument(StellateError, ValueError):
    """A specification that makes no sense. Mend the field that the message names."""

    default_reason = "INVALID_ARGUMENT"


class LimitExceeded(StellateError):
    """More than the server is willing to do. Ask for less, or raise its limit."""

    default_reason = "LIMIT_EXCEEDED"


class MeshNotFound(StellateError, LookupError):
    """No mesh has this name: it is misspelt, or the mesh was deleted."""

    default_reason = "MESH_NOT_FOUND"


class FailedPrecondition(StellateError):
    """A call out of order, such as serving a mesh that is over."""

    default_reason = "FAILED_PRECONDITION"


class Unauthenticated(StellateError, PermissionError):
    """The server wants a token, and got none that it knows. See stellate.Credentials."""

    default_reason = "UNAUTHENTICATED"


class Interrupted(KeyboardInterrupt):
    """Ctrl-C while there was work to do. Programs that catch KeyboardInterrupt catch it.

    Attributes:
      mesh: what there is of the mesh; None if there is none, or at a second Ctrl-C, which ends
        everything in one batch.
    """

    def __init__(self, message: str, mesh: Complex | None = None) -> None:
        super().__init__(message)
        self.mesh = mesh


class OracleError(StellateError):
    """The oracle's answers break a rule, or the mesh got none. Mend the oracle."""

    default_reason = "ORACLE_FAILED"


class ExecutorError(StellateError):
    """An executor that lost what it was given. The mesh is still there: see stellate.executors."""

    default_reason = "EXECUTOR"


class Cancelled(StellateError):
    """The mesh was cancelled by somebody else."""

    default_reason = "CANCELLED"


class Unavailable(StellateError, ConnectionError):
    """The server cannot be reached, or is stopping."""

    default_reason = "UNAVAILABLE"


class ServerNotFound(StellateError, FileNotFoundError):
    """No server address was given, and there is no stellated on this machine to start."""

    default_reason = "SERVER_NOT_FOUND"


class ViewerNotFound(StellateError, FileNotFoundError):
    """No command line was found to show meshes with, or it was built without its page."""

    default_reason = "VIEWER_NOT_FOUND"


class SaveError(StellateError, ValueError):
    """A mesh that the chosen file format cannot hold."""

    default_reason = "FORMAT"


class NotCertified(StellateError):
    """The mesh is finished and not proved good, as stellate.mesh(require_certified=True) demands.

    The mesh is the exception's `mesh`, and its report says what is wrong.
    """

    default_reason = "NOT_CERTIFIED"


class UncertifiedWarning(UserWarning):
    """A mesh is written to a file that is not certified."""


class NotConverged(StellateError, ArithmeticError):
    """Closest points that were not found for some of a batch.

    An oracle may raise it: the points that did converge are used, and the server learns that there
    is none for the others.

    Attributes:
      points: (n, d), meaningful where `converged`.
      converged: (n,) bool.
    """

    default_reason = "NOT_CONVERGED"

    def __init__(self, points: np.ndarray, converged: np.ndarray, message: str = "") -> None:
        converged = np.asarray(converged, dtype=bool)
        super().__init__(
            message
            or f"no convergence for {np.count_nonzero(~converged)} of {converged.size} points"
        )
        self.points = np.asarray(points, dtype=float)
        self.converged = converged


_DOMAIN = "stellate.v1"
_TABLE = _shared.table("errors.toml")


def error_class(reason: str, code: str = "") -> type[StellateError]:
    """The exception for one of the protocol's reasons, in a status of the gRPC code."""
    name = _TABLE["reasons"].get(reason)
    if name is None and reason.startswith("ORACLE_"):
        return OracleError
    kind = globals()[name or _TABLE["codes"].get(code, "StellateError")]
    assert issubclass(kind, StellateError)
    return kind


def exit_status(error: StellateError) -> int:
    """That a command line ends with."""
    faults = _TABLE["classes"]
    fault = next(faults[kind.__name__] for kind in type(error).__mro__ if kind.__name__ in faults)
    refused = fault in ("request", "file")
    return int(_TABLE["exit_refused" if refused else "exit_failed"])


def from_rpc(error: grpc.RpcError) -> StellateError:
    """Our exception for a failed rpc, with the reason and the fields that the server named."""
    code, message = error.code(), error.details() or ""
    reason, details = "", {"grpc_code": code.name}
    for key, value in error.trailing_metadata() or ():
        if key == "grpc-status-details-bin":
            try:
                reason, more = _named_in(details_pb.Status.FromString(value))
            except DecodeError:  # of whatever stands between us and the server
                continue
            details.update(more)
    kind_of_error = error_class(reason, code.name)
    advice = _advice(code, message)
    words = f"{message or code.name}; {advice}" if advice else message or code.name
    return kind_of_error(words, reason or None, details)


def protocol_error(what: str) -> StellateError:
    """What a server sent that makes no sense."""
    return StellateError(f"the server broke the protocol: {what}", "PROTOCOL")


def _named_in(status: details_pb.Status) -> tuple[str, dict[str, Any]]:
    """The reason, and what else the server says."""
    reason, details = "", dict[str, Any]()
    for part in status.details:
        kind = part.type_url.rpartition("/")[2]
        if kind == "google.rpc.ErrorInfo":
            info = details_pb.ErrorInfo.FromString(part.value)
            if info.domain == _DOMAIN:
                reason = info.reason
                details.update(info.metadata)
        elif kind == "google.rpc.BadRequest":
            violations = details_pb.BadRequest.FromString(part.value).field_violations
            details["fields"] = {v.field: v.description for v in violations}
    return reason, details


def _advice(code: grpc.StatusCode, message: str) -> str:
    """What is likely to help where the two sides do not agree how to connect.

    gRPC's own words and those of its TLS library are all there is to go by.
    """
    if code is grpc.StatusCode.UNAUTHENTICATED:
        return "give a token with Credentials(token=...), in the shell --token-file FILE"
    if code is not grpc.StatusCode.UNAVAILABLE:
        return ""
    said = message.lower().replace("_", " ")
    if "wrong version number" in said:
        return (
            "the server speaks plain text: leave tls, ca and certificate out of the Credentials, "
            "in the shell --tls, --tls-ca and --tls-cert"
        )
    if "certificate verify failed" in said:
        return (
            "the server's certificate is of no authority that is trusted here: "
            "Credentials(ca=...), in the shell --tls-ca FILE, names one"
        )
    if "failed to connect" in said and ("socket closed" in said or "connection reset" in said):
        return (
            "does the server want TLS? Credentials(tls=True) or Credentials(ca=...), in the shell "
            "--tls or --tls-ca FILE. Or a client certificate? certificate= and key=, in the shell "
            "--tls-cert and --tls-key"
        )
    if "failed to connect" in said and "connection refused" in said:
        return (
            "no server listens there: start a server with `stellated`, or name another, in the shell "
            "with --server"
        )
    return ""


def add_words(error: Exception, words: str) -> None:
    """To the message of somebody else's exception, once; its type stays."""
    if getattr(error, "_stellate_words", False):
        return
    error._stellate_words = True  # type: ignore[attr-defined]
    if len(error.args) == 1 and isinstance(error.args[0], str) and str(error) == error.args[0]:
        error.args = (f"{error.args[0]}; {words}",)
    elif hasattr(error, "add_note"):
        error.add_note(words)
