"""A worker: ServeOracle streams, on which the server asks and an oracle answers."""

from __future__ import annotations

import numbers
import queue
import threading
import time
import traceback
from collections.abc import Iterable, Iterator
from typing import Any, Callable

import grpc

from ._generated import oracle_pb2 as pb
from ._generated import stellate_pb2_grpc as rpc
from ._generated.stellate_pb2 import GetMeshRequest
from ._reconnect import WAITS, Reconnector, ReconnectPolicy
from ._trace import trace_headers
from ._wire import enums
from ._wire.arrays import fill, from_wire
from ._wire.calls import end
from .errors import (
    ExecutorError,
    FailedPrecondition,
    InvalidArgument,
    OracleError,
    StellateError,
    from_rpc,
    protocol_error,
)
from .oracle import CheckedOracle

_ANSWER_BYTES = 3_000_000  # an answer has to stay below the server's 4 MB
_MESSAGE_BYTES = 4000
_LOOK_AGAIN_SECONDS = 0.1
_KINDS = (pb.QUERY_KIND_CLOSEST_POINT, pb.QUERY_KIND_INTERSECT_FLAT)
# Of OracleFailure: what our own checks of an answer say; all others are about its shape.
_TOLD_APART = ("ORACLE_NOT_FINITE", "ORACLE_PRECISION", "ORACLE_TOUCHES_ZERO", "ORACLE_DERIVATIVE")
_SHAPE = "ORACLE_SHAPE"
_BUSY_SHARE = 0.25  # of the time that the server bears silence


def answer(oracle: CheckedOracle, chunk: pb.QueryChunk) -> pb.ServeOracleRequest:
    """The oracle's answers to one chunk, as they are sent. Raises whatever the oracle does."""
    d, k = oracle.ambient_dimension, oracle.dimension
    points = from_wire(chunk.points, -1, d)
    if chunk.kind == pb.QUERY_KIND_INTERSECT_FLAT:
        bases = from_wire(chunk.bases, len(points), d, k)
        radii = from_wire(chunk.radii, len(points))
        answers, found = oracle.intersections(points, bases, radii)
    elif chunk.face:
        answers, found = oracle.face_points(points, tuple(chunk.face))
    else:
        answers, found = oracle.closest_points(points)
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
    if chunk.want_clearances:
        fill(reply.clearances, oracle.clearances(answers, found))
        if chunk.face:
            fill(reply.conormals, oracle.conormals(answers, found, tuple(chunk.face)))
    return request


Ask = Callable[[CheckedOracle, pb.QueryChunk], pb.ServeOracleRequest]


def check_max_chunk(max_chunk: int | None) -> int | None:
    """As a whole number. Raises: InvalidArgument."""
    if max_chunk is None:
        return None
    if not isinstance(max_chunk, numbers.Integral) or max_chunk < 1:
        raise InvalidArgument(f"max_chunk has to be a whole number from 1 on, and is {max_chunk!r}")
    return int(max_chunk)


def join_all(threads: Iterable[threading.Thread], seconds: float | None) -> bool:
    """Waits so long at most for the end of all; None: for ever. Whether it has come."""
    deadline = None if seconds is None else time.monotonic() + seconds
    ended = True
    for thread in threads:
        thread.join(None if deadline is None else max(0.0, deadline - time.monotonic()))
        ended = ended and not thread.is_alive()
    return ended


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


class _Outbox:
    """What is sent to the server, until end().

    While the oracle is at a chunk another thread says so now and then, so that the server does
    not take a slow worker for a dead one.
    """

    def __init__(self) -> None:
        self._requests: queue.SimpleQueue[pb.ServeOracleRequest | None] = queue.SimpleQueue()
        self._busy_with: int | None = None
        self._ended = threading.Event()
        self._teller: threading.Thread | None = None

    def put(self, request: pb.ServeOracleRequest) -> None:
        self._busy_with = None
        self._requests.put(request)

    def begin(self, lease: int) -> None:
        """The oracle is at the chunk, until the next put()."""
        self._busy_with = lease

    def say_busy_every(self, seconds: float) -> None:
        if self._teller is None:
            self._teller = threading.Thread(
                target=self._tell, args=(seconds,), name="busy", daemon=True
            )
            self._teller.start()

    def _tell(self, seconds: float) -> None:
        while not self._ended.wait(seconds):
            lease = self._busy_with
            if lease is not None:
                self._requests.put(pb.ServeOracleRequest(busy=pb.Busy(lease=lease)))

    def end(self) -> None:
        self._ended.set()
        self._busy_with = None
        self._requests.put(None)

    def __iter__(self) -> Iterator[pb.ServeOracleRequest]:
        while True:
            request = self._requests.get()
            if request is None:
                return
            yield request


class Worker:
    """Serves one mesh until it is over, or stop() is called; a lost stream is opened again."""

    def __init__(
        self,
        stub: rpc.StellateStub,
        oracle: CheckedOracle,
        mesh: str,
        name: str,
        on_failure: Callable[[BaseException], None],
        policy: ReconnectPolicy,
        quiet: bool = False,
        ask: Ask = answer,
        max_chunk: int | None = None,
    ) -> None:
        """`on_failure` gets what the oracle raised before the server does. `quiet`: no log.

        `max_chunk`: the most queries in one call of the oracle; None: the server decides.
        `ask` has the oracle answer a chunk, somewhere. Its ExecutorError ends this worker alone.
        """
        self._ask = ask
        self._stub, self._oracle, self._on_failure = stub, oracle, on_failure
        d, k, walls = oracle.ambient_dimension, oracle.dimension, oracle.walls
        per_query = 8 * (d * (k + 1 + min(k, walls)) + walls) + 9
        most = max(1, _ANSWER_BYTES // per_query)
        self._hello = pb.Hello(
            mesh=mesh,
            worker=name,
            max_chunk_queries=min(most, check_max_chunk(max_chunk) or most),
        )
        self.at_work: tuple[float, str] | None = None  # see Waiting
        self.longest = 0.0
        self._call: Any = None
        self._attempts = Reconnector(policy, quiet)
        self._trace = trace_headers()  # of who has it serve, on whatever thread it does
        self._stopped = threading.Event()

    def run(self) -> str:
        """Serves; returns the state the mesh ended in, "" when stopped before.

        Raises: what the oracle raised, after the server has it, too, or a StellateError.
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
                    self._attempts.wait_or_raise(broken.error, ours)
                except StellateError:
                    if self._stopped.is_set():
                        return ""
                    raise

    def stop(self) -> None:
        """Ends the stream from another thread: what is unanswered goes to another worker."""
        self._stopped.set()
        self._attempts.stop()
        if self._call is not None:
            self._call.cancel()

    def finish(self) -> None:
        """The mesh is over: a lost stream is not opened again."""
        self._attempts.stop()

    def _serve(self) -> str:
        outbox = _Outbox()
        outbox.put(pb.ServeOracleRequest(hello=self._hello))
        call = self._call = self._stub.ServeOracle(iter(outbox), metadata=self._trace)
        if self._stopped.is_set():
            call.cancel()
        try:
            return self._answer_all(outbox, _Inbox(call))
        finally:
            outbox.end()
            end(call)

    def _answer_all(self, outbox: _Outbox, inbox: _Inbox) -> str:
        state = ""
        for response in inbox:
            self._attempts.heard()
            kind = response.WhichOneof("message")
            if kind == "queries":
                if response.queries.kind not in _KINDS:  # another worker may be newer
                    unknown = protocol_error(
                        f"it asks a question of kind {response.queries.kind}, which this version "
                        "does not know"
                    )
                    self._on_failure(unknown)
                    raise unknown
                outbox.begin(response.queries.lease)
                try:
                    reply = self._timed(response.queries)
                except ExecutorError:
                    raise  # no failure of the oracle: another worker may go on
                except BaseException as error:
                    if isinstance(error, KeyboardInterrupt) and self._may_be_told_to_leave():
                        raise
                    self._on_failure(error)
                    self._tell(outbox, inbox, response.queries.lease, error)
                    raise
                outbox.put(reply)
            elif kind == "welcome":
                self._compare(response.welcome)
                if response.welcome.answer_seconds > 0:
                    outbox.say_busy_every(_BUSY_SHARE * response.welcome.answer_seconds)
            elif kind == "over":
                state = enums.state_of(response.over.state)
                outbox.end()
        return state

    def _timed(self, chunk: pb.QueryChunk) -> pb.ServeOracleRequest:
        flats = chunk.kind == pb.QUERY_KIND_INTERSECT_FLAT
        count, began = chunk.points.shape[0], time.monotonic()
        self.at_work = (began, f"{count} {'flats' if flats else 'closest points'}")
        try:
            return self._ask(self._oracle, chunk)
        finally:
            self.at_work = None
            self.longest = max(self.longest, time.monotonic() - began)

    def _may_be_told_to_leave(self) -> bool:
        """Whether a KeyboardInterrupt may be Ctrl-C: that is for the main thread, or for processes of an
        executor, and takes this worker away alone. In another thread the oracle itself has raised it."""
        return threading.current_thread() is threading.main_thread() or self._ask is not answer

    def _how_it_ended(self) -> str:
        """Of a mesh that takes no more workers; "" if that cannot be found out."""
        request = GetMeshRequest(name=self._hello.mesh)
        give_up = time.monotonic() + WAITS["call"]
        while True:
            try:
                mesh = self._stub.GetMesh(request, timeout=WAITS["call"])
            except grpc.RpcError:
                return ""
            if mesh.HasField("end_time"):
                return enums.state(mesh.state)
            # It is just about to end.
            if time.monotonic() > give_up or self._stopped.wait(_LOOK_AGAIN_SECONDS):
                return ""

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
        elif welcome.walls != mine.walls:
            problem = f"the mesh has {welcome.walls} walls, and this oracle's manifold {mine.walls}"
        elif missing:
            problem = f"the mesh was declared with {' and '.join(missing)}, which this oracle lacks"
        if problem:
            raise InvalidArgument(f"{problem}: all workers of a mesh have to serve one manifold")

    def _tell(
        self,
        outbox: _Outbox,
        inbox: _Inbox,
        lease: int,
        error: BaseException,
    ) -> None:
        """Sends the failure and waits until the server has taken note."""
        said, reason = traceback.format_exception_only(type(error), error)[-1].strip(), ""
        if isinstance(error, OracleError):
            said, reason = str(error), error.reason if error.reason in _TOLD_APART else _SHAPE
        message = said.encode()[:_MESSAGE_BYTES].decode(errors="ignore")
        failure = pb.OracleFailure(lease=lease, message=message, reason=reason)
        outbox.put(pb.ServeOracleRequest(failure=failure))
        outbox.end()
        try:
            for _ in inbox:
                pass
        except _Broken:
            pass  # ABORTED, as announced
