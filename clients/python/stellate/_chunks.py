"""Chunks of questions that the caller pulls and answers, on the caller's own thread."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator
from typing import Any, Callable

import numpy as np

from ._findings import CheckReport
from ._generated import oracle_pb2 as pb
from ._generated.mesh_pb2 import MeshSpec
from ._mesh import FinishedMesh
from ._wire.arrays import from_wire, to_wire
from ._worker import Worker, answer
from .errors import FailedPrecondition, NotConverged, OracleError
from .oracle import CheckedOracle
from .report import Progress

_METHODS = ("intersect_flat", "tangent_basis", "local_size")
_OF_WALLS = ("face_point", "clearances", "conormals")

AskChunk = Callable[[pb.QueryChunk], pb.ServeOracleRequest]


class Declared:
    """An oracle by what it can do. Where its methods are called they ask in turn."""

    thread_safe = True

    def __init__(
        self,
        dimension: Any,
        ambient_dimension: Any,
        ask: AskChunk | None = None,
        *,
        bounding_box: Any = None,
        seeds: Any = None,
        walls: Any = 0,
        about: Any = "",
        **can: bool,
    ) -> None:
        """`ask` answers chunks; None: no method is called."""
        self.dimension, self.ambient_dimension = dimension, ambient_dimension
        self.bounding_box, self.seeds, self.walls = bounding_box, seeds, walls
        self.about = about
        self._ask = ask
        able = [method for method in _METHODS if can.get(method)]
        for method in (*able, *(_OF_WALLS if walls else ())):
            setattr(self, method, getattr(self, f"_{method}"))

    @classmethod
    def of(cls, spec: MeshSpec, **can: Any) -> Declared:
        """A worker of a mesh: by default with all that this was declared with."""
        if not can:
            can = {method: getattr(spec.oracle, method) for method in _METHODS}
            can["walls"] = spec.walls
        return cls(spec.dimension, spec.ambient_dimension, **can)

    def closest_point(self, points: np.ndarray) -> np.ndarray:
        return self._nearest(self._asked(points))

    def _face_point(self, points: np.ndarray, face: tuple[int, ...]) -> np.ndarray:
        return self._nearest(self._asked(points, face=face))

    def _intersect_flat(self, centers: np.ndarray, bases: np.ndarray, radii: np.ndarray) -> Any:
        flats = {"bases": to_wire(bases), "radii": to_wire(radii)}
        reply = self._asked(centers, kind=pb.QUERY_KIND_INTERSECT_FLAT, **flats)
        return self._points(reply)

    def _tangent_basis(self, points: np.ndarray) -> np.ndarray:
        reply = self._asked(points, want_tangents=True)
        return from_wire(reply.tangents, len(points), self.ambient_dimension, self.dimension)

    def _local_size(self, points: np.ndarray) -> np.ndarray:
        return from_wire(self._asked(points, want_sizes=True).sizes, len(points))

    def _clearances(self, points: np.ndarray) -> np.ndarray:
        reply = self._asked(points, want_clearances=True)
        return from_wire(reply.clearances, len(points), self.walls)

    def _conormals(self, points: np.ndarray, face: tuple[int, ...]) -> np.ndarray:
        reply = self._asked(points, face=face, want_clearances=True)
        return from_wire(reply.conormals, len(points), len(face), self.ambient_dimension)

    def _asked(self, points: np.ndarray, **question: Any) -> pb.AnswerChunk:
        assert self._ask is not None, "answers of a puller are its caller's"
        question.setdefault("kind", pb.QUERY_KIND_CLOSEST_POINT)
        return self._ask(pb.QueryChunk(points=to_wire(points), **question)).answers

    def _points(self, reply: pb.AnswerChunk) -> tuple[np.ndarray, np.ndarray]:
        points = from_wire(reply.points, -1, self.ambient_dimension)
        if not reply.found:
            return points, np.ones(len(points), dtype=bool)
        return points, np.frombuffer(reply.found, "u1").astype(bool)

    def _nearest(self, reply: pb.AnswerChunk) -> np.ndarray:
        points, found = self._points(reply)
        if not found.all():
            raise NotConverged(points, found)
        return points


class _Given:
    """An oracle that answers one chunk with arrays that are there already."""

    thread_safe = True

    def __init__(self, like: CheckedOracle, points: Any, found: np.ndarray, **more: Any) -> None:
        self.dimension, self.ambient_dimension = like.dimension, like.ambient_dimension
        self.walls = like.walls
        self._points, self._found, self._more = points, found, more

    def closest_point(self, query: np.ndarray) -> Any:
        if not self._found.all():
            raise NotConverged(self._points, self._found)
        return self._points

    def face_point(self, query: np.ndarray, face: tuple[int, ...]) -> Any:
        return self.closest_point(query)

    def intersect_flat(self, *query: np.ndarray) -> Any:
        return self._points, self._found

    def tangent_basis(self, points: np.ndarray) -> Any:
        return self._rows("tangents")

    def local_size(self, points: np.ndarray) -> Any:
        return self._rows("sizes")

    def clearances(self, points: np.ndarray) -> Any:
        return self._rows("clearances")

    def conormals(self, points: np.ndarray, face: tuple[int, ...]) -> Any:
        return self._rows("conormals")

    def _rows(self, name: str) -> Any:
        values = self._more[name]
        if values is None:
            raise OracleError(
                f"this chunk wants {name}: answer(points, {name}=...)", "ORACLE_SHAPE"
            )
        values = np.asarray(values)
        if values.ndim == 0 and len(self._found) == 1:
            values = values.reshape(1)
        return values[self._found] if values.shape[:1] == self._found.shape else values


class Chunk:
    """A batch of questions, to be answered once, before the next is asked for.

    Attributes:
      kind: "closest_point": for each point x the nearest point of M. "intersect_flat": for each
        point c the point of M nearest to it in the flat {c + v : basis^T v = 0}, within the radius.
      points: (n, d), read-only: x, or c.
      face: the walls, ascending, that the answers have to lie on, whatever the others say; () as a rule.
      bases, radii: (n, d, k) and (n,) of "intersect_flat", else None.
      wants_tangents, wants_sizes: what answer() has to be given as well; and wants_clearances, with
        which points of a face want conormals, too.
    """

    def __init__(self, oracle: CheckedOracle, wire: pb.QueryChunk, examined: bool = False) -> None:
        """What is wrong with the answers of an oracle that is `examined` is a finding."""
        d, k = oracle.ambient_dimension, oracle.dimension
        self._oracle, self._wire, self._examined = oracle, wire, examined
        self._reply: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self.answered = False
        self.points = from_wire(wire.points, -1, d)
        flat = wire.kind == pb.QUERY_KIND_INTERSECT_FLAT
        self.kind = "intersect_flat" if flat else "closest_point"
        self.bases = from_wire(wire.bases, len(self.points), d, k) if flat else None
        self.radii = from_wire(wire.radii, len(self.points)) if flat else None
        self.face = tuple(wire.face)
        self.wants_tangents, self.wants_sizes = wire.want_tangents, wire.want_sizes
        self.wants_clearances = wire.want_clearances

    def __len__(self) -> int:
        return len(self.points)

    def answer(
        self,
        points: Any,
        tangents: Any = None,
        sizes: Any = None,
        found: Any = None,
        clearances: Any = None,
        conormals: Any = None,
    ) -> None:
        """Answers the batch: `points` (n, d), `tangents` (n, d, k), `sizes` (n,), `clearances`
        (n, walls), `conormals` (n, walls of the face, d).

        `found` (n,) is False where there is no answer; the other arrays hold anything there. What
        was not asked for is ignored.

        Raises: OracleError for an array that cannot be an answer; another may be given then. To a
        doctor that is a finding.
        """
        if self.answered:
            raise FailedPrecondition("this chunk was answered already")
        more = {"tangents": tangents, "sizes": sizes}
        more |= {"clearances": clearances, "conormals": conormals}
        try:
            self._settle(self._answered(points, found, more))
        except OracleError as error:
            if not self._examined:
                raise
            self._settle(error)

    def _answered(self, points: Any, found: Any, more: dict[str, Any]) -> pb.ServeOracleRequest:
        count = len(self)
        flags = np.ones(count, dtype=bool) if found is None else np.asarray(found)
        if flags.shape != (count,) and flags.size != 1 or flags.size != count:
            raise OracleError(f"found has the shape {flags.shape}, not ({count},)", "ORACLE_SHAPE")
        given = _Given(self._oracle, points, flags.reshape(count).astype(bool), **more)
        return answer(CheckedOracle(given), self._wire)

    def fail(self, message: str) -> None:
        """There are no answers, now or later: the mesh fails, with this message."""
        self._settle(RuntimeError(message) if self._examined else OracleError(str(message)))

    def _settle(self, reply: pb.ServeOracleRequest | BaseException) -> None:
        self.answered = True
        self._reply.put(reply)

    def wait(self) -> pb.ServeOracleRequest:
        """On the worker's thread. Raises what the caller gave for an answer."""
        reply = self._reply.get()
        if isinstance(reply, BaseException):
            raise reply
        return reply


class Puller:
    """Chunks of questions, as an iterator and a context manager: see pull() and Client.pull.

    Attributes:
      progress: of pull(), how the mesh stands, as far as is known.
      mesh: of pull(), the finished mesh, once the loop is over.
      report: of pull_check(), what it found, once the loop is over.
      state: of Client.pull, how the mesh ended, e.g. "SUCCEEDED", once the loop is over.
    """

    def __init__(self) -> None:
        self.progress: Progress | None = None
        self.mesh: FinishedMesh | None = None
        self.report: CheckReport | None = None
        self.state = ""
        self._chunks: queue.SimpleQueue[Chunk | None] = queue.SimpleQueue()
        self._open: Chunk | None = None
        self._ahead: Chunk | None = None  # that begun() took
        self._over = self._left = False
        self._failure: BaseException | None = None
        self.stop: Callable[[], None] = lambda: None

    @property
    def left(self) -> bool:
        """Whether the loop was left early."""
        return self._left

    def start(self, work: Callable[[], None]) -> Puller:
        def run() -> None:
            try:
                work()
            except BaseException as error:
                self._failure = error
            self._chunks.put(None)

        self._thread = threading.Thread(target=run, name="puller", daemon=True)
        self._thread.start()
        return self

    def serve(self, worker: Worker) -> Puller:
        """Begins with the chunks of a worker that asks this."""

        def work() -> None:
            self.state = worker.run()

        self.stop = worker.stop
        return self.start(work)

    def begun(self) -> Puller:
        """Waits for the first chunk. Raises what went wrong before."""
        self._ahead = self._chunks.get()
        if self._ahead is None:
            if self._failure is not None:
                self._over = True
                raise self._failure
            self._chunks.put(None)
        return self

    def ask(
        self, oracle: CheckedOracle, wire: pb.QueryChunk, examined: bool = False
    ) -> pb.ServeOracleRequest:
        """Has the loop answer a chunk, from another thread."""
        chunk = Chunk(oracle, wire, examined)
        self._chunks.put(chunk)
        if self._left:
            chunk.fail("the loop that answers was left")
        return chunk.wait()

    def __iter__(self) -> Iterator[Chunk]:
        return self

    def __next__(self) -> Chunk:
        """Waits for the next chunk. Raises how the mesh failed, or what refused it."""
        if self._open is not None and not self._open.answered:
            raise FailedPrecondition("answer() or fail() a chunk before the next is asked for")
        self._open, self._ahead = self._ahead, None
        if self._open is None and not self._over:
            self._open = self._chunks.get()
        if self._open is None:
            self._over = True
            if self._failure is not None:
                failure, self._failure = self._failure, None
                raise failure
            raise StopIteration
        return self._open

    def close(self) -> None:
        """Leaves the loop early: a mesh of pull() is cancelled, another goes on without us."""
        if self._over:
            return
        self._left = self._over = True
        self.stop()
        while self._thread.is_alive():
            for chunk in (self._open, self._ahead):
                if chunk is not None and not chunk.answered:
                    chunk.fail("the loop that answers was left")
            try:
                self._open = self._chunks.get(timeout=0.05)
            except queue.Empty:
                continue

    def __enter__(self) -> Puller:
        return self

    def __exit__(self, *raised: object) -> None:
        self.close()
