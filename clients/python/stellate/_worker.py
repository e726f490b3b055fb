"""A worker: one ServeOracle stream, on which the server asks and an oracle answers."""

from __future__ import annotations

import queue
import threading
import traceback
from typing import Any, Callable, Iterator

import grpc

from ._arrays import from_wire, to_wire
from ._generated import oracle_pb2 as pb
from ._generated import stellate_pb2_grpc as rpc
from .errors import InvalidArgument, from_rpc
from .oracle import CheckedOracle

_ANSWER_BYTES = 3_000_000  # an answer has to stay below the server's 4 MB
_MESSAGE_BYTES = 4000


def answer(oracle: CheckedOracle, chunk: pb.QueryChunk) -> pb.AnswerChunk:
    """The oracle's answers to one chunk. Raises whatever the oracle does."""
    d, k = oracle.ambient_dimension, oracle.dimension
    points = from_wire(chunk.points, -1, d)
    if chunk.kind == pb.QUERY_KIND_INTERSECT_FLAT:
        bases = from_wire(chunk.bases, len(points), d, k)
        radii = from_wire(chunk.radii, len(points))
        answers, found = oracle.intersections(points, bases, radii)
    elif chunk.kind == pb.QUERY_KIND_CLOSEST_POINT:
        answers, found = oracle.closest_points(points)
    else:
        raise ValueError(f"the server asks a question of kind {chunk.kind}, unknown to this client")
    reply = pb.AnswerChunk(lease=chunk.lease, points=to_wire(answers))
    if not found.all():
        reply.found = found.astype("u1").tobytes()
    if chunk.want_tangents:
        reply.tangents.CopyFrom(to_wire(oracle.tangents(answers, found)))
    return reply


class Worker:
    """Serves one mesh until it is over, or stop() is called."""

    def __init__(
        self,
        stub: rpc.StellateStub,
        oracle: CheckedOracle,
        mesh: str,
        name: str,
        on_failure: Callable[[BaseException], None] = lambda error: None,
    ) -> None:
        """`on_failure` is told what the oracle raised before the server is."""
        self._stub, self._oracle, self._on_failure = stub, oracle, on_failure
        per_query = 8 * oracle.ambient_dimension * (oracle.dimension + 1) + 1
        self._hello = pb.Hello(
            mesh=mesh, worker=name, max_chunk_queries=max(1, _ANSWER_BYTES // per_query)
        )
        self._call: Any = None
        self._stopped = threading.Event()

    def run(self) -> str:
        """Serves; returns the state the mesh ended in, "" when stopped before.

        Raises: what the oracle raised, after the server was told, or a StellateError.
        """
        requests: queue.SimpleQueue[pb.ServeOracleRequest | None] = queue.SimpleQueue()
        requests.put(pb.ServeOracleRequest(hello=self._hello))
        self._call = self._stub.ServeOracle(_until_none(requests))
        if self._stopped.is_set():
            self._call.cancel()
        try:
            return self._serve(requests)
        except grpc.RpcError as error:
            if self._stopped.is_set():
                return ""
            raise from_rpc(error) from None
        finally:
            requests.put(None)

    def stop(self) -> None:
        """Ends the stream from another thread: what is unanswered goes to another worker."""
        self._stopped.set()
        if self._call is not None:
            self._call.cancel()

    def _serve(self, requests: queue.SimpleQueue[pb.ServeOracleRequest | None]) -> str:
        state = ""
        for response in self._call:
            kind = response.WhichOneof("message")
            if kind == "queries":
                try:
                    reply = answer(self._oracle, response.queries)
                except BaseException as error:
                    if isinstance(error, KeyboardInterrupt):
                        self._call.cancel()  # no failure of the oracle: another may go on
                        raise
                    self._on_failure(error)
                    self._tell(requests, response.queries.lease, error)
                    raise
                requests.put(pb.ServeOracleRequest(answers=reply))
            elif kind == "welcome":
                self._compare(response.welcome)
            elif kind == "over":
                state = response.over.state.removeprefix("MESH_STATE_")
                requests.put(None)
        return state

    def _compare(self, welcome: pb.Welcome) -> None:
        """Leaves the mesh alone if this oracle is not of its kind."""
        mine = self._oracle
        wanted = (welcome.dimension, welcome.ambient_dimension)
        have = (mine.dimension, mine.ambient_dimension)
        missing = [
            name
            for name, asked, able in (
                ("intersect_flat", welcome.oracle.intersect_flat, mine.has_intersect_flat),
                ("tangent_basis", welcome.oracle.tangent_basis, mine.has_tangent_basis),
            )
            if asked and not able
        ]
        problem = ""
        if wanted != have:
            problem = f"the mesh has dimension {wanted[0]} in R^{wanted[1]}, and this oracle's "
            problem += f"manifold has dimension {have[0]} in R^{have[1]}"
        elif missing:
            problem = f"the mesh was declared with {' and '.join(missing)}, which this oracle lacks"
        if problem:
            self._call.cancel()
            raise InvalidArgument(f"{problem}: all workers of a mesh have to serve one manifold")

    def _tell(
        self,
        requests: queue.SimpleQueue[pb.ServeOracleRequest | None],
        lease: int,
        error: BaseException,
    ) -> None:
        """Sends the failure and waits until the server has taken note."""
        said = traceback.format_exception_only(type(error), error)[-1].strip()
        message = said.encode()[:_MESSAGE_BYTES].decode(errors="ignore")
        failure = pb.OracleFailure(lease=lease, message=message)
        requests.put(pb.ServeOracleRequest(failure=failure))
        requests.put(None)
        try:
            for _ in self._call:
                pass
        except grpc.RpcError:
            pass  # ABORTED, as announced


def _until_none(
    requests: queue.SimpleQueue[pb.ServeOracleRequest | None],
) -> Iterator[pb.ServeOracleRequest]:
    while True:
        request = requests.get()
        if request is None:
            return
        yield request
