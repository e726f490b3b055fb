"""A worker: ServeOracle streams, on which the server asks and an oracle answers."""

from __future__ import annotations

import queue
import threading
import traceback
from typing import Any, Callable, Iterator

import grpc

from ._arrays import fill, from_wire
from ._generated import oracle_pb2 as pb
from ._generated import stellate_pb2_grpc as rpc
from ._generated.mesh_pb2 import MeshState
from ._generated.stellate_pb2 import GetMeshRequest
from ._retry import Outage, Patience
from .errors import ExecutorError, FailedPrecondition, InvalidArgument, StellateError, from_rpc
from .oracle import CheckedOracle

_ANSWER_BYTES = 3_000_000  # an answer has to stay below the server's 4 MB
_MESSAGE_BYTES = 4000
_CALL_SECONDS = 30.0


def answer(oracle: CheckedOracle, chunk: pb.QueryChunk) -> pb.ServeOracleRequest:
    """The oracle's answers to one chunk, as they are sent. Raises whatever the oracle does."""
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
    request = pb.ServeOracleRequest()
    reply = request.answers
    reply.lease = chunk.lease
    fill(reply.points, answers)
    if not found.all():
        reply.found = found.astype("u1").tobytes()
    if chunk.want_tangents:
        fill(reply.tangents, oracle.tangents(answers, found))
    if chunk.want_sizes:
        fill(reply.sizes, oracle.sizes(answers, found))
    return request


Ask = Callable[[CheckedOracle, pb.QueryChunk], pb.ServeOracleRequest]


class _Broken(Exception):
    """The stream ended with an error; kept apart from what an oracle may raise."""

    def __init__(self, error: grpc.RpcError) -> None:
        super().__init__(str(error))
        self.error = error


class _Inbox:
    """What the server sends, read ahead: the next chunk is on its way while one is answered.

    The server bounds how many there can be. Iterating raises _Broken.
    """

    def __init__(self, call: Any) -> None:
        self._unread: queue.SimpleQueue[Any] = queue.SimpleQueue()
        threading.Thread(target=self._read, args=(call,), name="inbox", daemon=True).start()

    def _read(self, call: Any) -> None:
        try:
            for response in call:
                self._unread.put(response)
            self._unread.put(None)
        except grpc.RpcError as error:
            self._unread.put(error)

    def __iter__(self) -> Iterator[pb.ServeOracleResponse]:
        while True:
            response = self._unread.get()
            if isinstance(response, grpc.RpcError):
                raise _Broken(response)
            if response is None:
                return
            yield response


class Worker:
    """Serves one mesh until it is over, or stop() is called; a lost stream is opened again."""

    def __init__(
        self,
        stub: rpc.StellateStub,
        oracle: CheckedOracle,
        mesh: str,
        name: str,
        on_failure: Callable[[BaseException], None],
        patience: Patience,
        quiet: bool = False,
        ask: Ask = answer,
    ) -> None:
        """`on_failure` is told what the oracle raised before the server is. `quiet`: no log.

        `ask` has the oracle answer a chunk, somewhere. Its ExecutorError ends this worker alone.
        """
        self._ask = ask
        self._stub, self._oracle, self._on_failure = stub, oracle, on_failure
        per_query = 8 * oracle.ambient_dimension * (oracle.dimension + 1) + 9
        self._hello = pb.Hello(
            mesh=mesh, worker=name, max_chunk_queries=max(1, _ANSWER_BYTES // per_query)
        )
        self._call: Any = None
        self._outage = Outage(patience, quiet)
        self._stopped = threading.Event()

    def run(self) -> str:
        """Serves; returns the state the mesh ended in, "" when stopped before.

        Raises: what the oracle raised, after the server was told, or a StellateError.
        """
        while True:
            try:
                return self._serve()
            except _Broken as broken:
                if self._stopped.is_set():
                    return ""
                ours = from_rpc(broken.error)
                if isinstance(ours, FailedPrecondition):
                    state = self._how_it_ended()  # before this worker came, or while it was away
                    if state:
                        return state
                try:
                    self._outage.wait_or_raise(broken.error, ours)
                except StellateError:
                    if self._stopped.is_set():
                        return ""
                    raise

    def stop(self) -> None:
        """Ends the stream from another thread: what is unanswered goes to another worker."""
        self._stopped.set()
        self._outage.stop()
        if self._call is not None:
            self._call.cancel()

    def finish(self) -> None:
        """The mesh is over: a lost stream is not opened again."""
        self._outage.stop()

    def _serve(self) -> str:
        requests: queue.SimpleQueue[pb.ServeOracleRequest | None] = queue.SimpleQueue()
        requests.put(pb.ServeOracleRequest(hello=self._hello))
        call = self._call = self._stub.ServeOracle(_until_none(requests))
        if self._stopped.is_set():
            call.cancel()
        try:
            return self._answer_all(requests, _Inbox(call))
        finally:
            requests.put(None)
            call.cancel()  # unless it has ended

    def _answer_all(
        self, requests: queue.SimpleQueue[pb.ServeOracleRequest | None], inbox: _Inbox
    ) -> str:
        state = ""
        for response in inbox:
            self._outage.heard()
            kind = response.WhichOneof("message")
            if kind == "queries":
                try:
                    reply = self._ask(self._oracle, response.queries)
                except (KeyboardInterrupt, ExecutorError):
                    raise  # no failure of the oracle: another worker may go on
                except BaseException as error:
                    self._on_failure(error)
                    self._tell(requests, inbox, response.queries.lease, error)
                    raise
                requests.put(reply)
            elif kind == "welcome":
                self._compare(response.welcome)
            elif kind == "over":
                state = response.over.state.removeprefix("MESH_STATE_")
                requests.put(None)
        return state

    def _how_it_ended(self) -> str:
        try:
            mesh = self._stub.GetMesh(GetMeshRequest(name=self._hello.mesh), timeout=_CALL_SECONDS)
        except grpc.RpcError:
            return ""
        return MeshState.Name(mesh.state).removeprefix("MESH_STATE_")

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
                ("local_size", welcome.oracle.local_size, mine.has_local_size),
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
            raise InvalidArgument(f"{problem}: all workers of a mesh have to serve one manifold")

    def _tell(
        self,
        requests: queue.SimpleQueue[pb.ServeOracleRequest | None],
        inbox: _Inbox,
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
            for _ in inbox:
                pass
        except _Broken:
            pass  # ABORTED, as announced


def _until_none(
    requests: queue.SimpleQueue[pb.ServeOracleRequest | None],
) -> Iterator[pb.ServeOracleRequest]:
    while True:
        request = requests.get()
        if request is None:
            return
        yield request
