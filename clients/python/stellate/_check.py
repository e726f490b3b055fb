"""Is an oracle what it should be? The server asks it; here is what only the client can see."""

from __future__ import annotations

import dataclasses
import numbers
from typing import TYPE_CHECKING, Any

import grpc

from ._findings import CheckReport, Finding
from ._generated import stellate_pb2 as pb
from ._generated import stellate_pb2_grpc as rpc
from ._generated.mesh_pb2 import MeshSpec
from ._places import Places
from ._rank import find_singular
from ._trace import trace_headers
from ._wire.calls import end
from ._wire.spec import mesh_spec
from .errors import ExecutorError, InvalidArgument, OracleError, from_rpc, protocol_error
from .oracle import CheckedOracle

if TYPE_CHECKING:
    from .client import Client

# Without a repeatable answer there is no M to follow equations along.
_NO_MANIFOLD = {"NOT_DETERMINISTIC", "NOT_IDEMPOTENT"}


def examine(
    client: Client, stub: rpc.StellateStub, oracle: Any, epsilon: float | None, seed: int
) -> CheckReport:
    """See Client.check."""
    if epsilon is not None and not isinstance(epsilon, numbers.Real):
        raise InvalidArgument(f"epsilon has to be a length, and is {epsilon!r}")
    try:
        checked = oracle if isinstance(oracle, CheckedOracle) else CheckedOracle(oracle)
        spec = mesh_spec(checked, float(epsilon or 0), {"random_seed": seed})
    except (InvalidArgument, OracleError) as error:
        return CheckReport(()).adding(Finding("error", "WRONG_SHAPE", str(error), ""))
    report = _ask_server(client, stub, checked, spec)
    return _in_own_coordinates(_with_rank(report, checked, seed), oracle)


def _in_own_coordinates(report: CheckReport, oracle: Any) -> CheckReport:
    """Of an oracle in units, or on a periodic cell, the places by which people know them."""
    places = Places(oracle, asked=True)
    if not places.known:
        return report
    d = CheckedOracle(oracle).ambient_dimension
    findings = tuple(places.in_finding(finding, d) for finding in report.findings)
    return dataclasses.replace(report, findings=findings)


def _with_rank(report: CheckReport, checked: CheckedOracle, seed: int) -> CheckReport:
    """And where equations lose rank, if they do."""
    if not checked.has_jacobian or not report.samples or _NO_MANIFOLD & set(report.codes):
        return report
    try:
        singular = find_singular(checked, seed)
    except Exception:
        return report  # the server has met it, too, or walls are in the way of a look
    return report if singular is None else report.adding(singular)


def _ask_server(
    client: Client, stub: rpc.StellateStub, oracle: CheckedOracle, spec: MeshSpec
) -> CheckReport:
    call = stub.Examine(pb.ExamineRequest(spec=spec), metadata=trace_headers())
    failure: Exception | None = None
    try:
        for response in call:
            event = response.WhichOneof("event")
            if event == "mesh":
                failure = _serve(client, oracle, response.mesh.name)
            elif event == "report":
                return CheckReport.from_wire(response.report)
    except grpc.RpcError as error:
        raise failure or from_rpc(error) from None  # there was no examination
    finally:
        end(call)
    raise protocol_error("the examination ended without a report")


def _serve(client: Client, oracle: CheckedOracle, name: str) -> Exception | None:
    """Answers until the examination is over. Returns what ended it early, which the server knows."""
    try:
        client.worker(oracle, name, "check", quiet=True).run()
    except ExecutorError:
        raise
    except Exception as error:
        return error
    return None
