"""Chunks of questions that the caller pulls and answers, on the caller's own thread."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator
from typing import Any, Callable

import numpy as np

from ._generated import oracle_pb2 as pb
from ._generated.mesh_pb2 import MeshSpec
from ._mesh import Mesh
from ._wire.arrays import from_wire
from ._worker import Worker, answer
from .errors import FailedPrecondition, NotConverged, OracleError
from .oracle import CheckedOracle
from .report import Progress


class Declared:
    """An oracle by what it can do; its answers come from elsewhere."""

    def __init__(self, dimension: Any, ambient_dimension: Any, **can: bool) -> None:
        self.dimension, self.ambient_dimension = dimension, ambient_dimension
        self.bounding_box = self.seeds = None
        self.thread_safe = True
        for method in ("intersect_flat", "tangent_basis", "local_size"):
            if can.get(method):
                setattr(self, method, self.closest_point)

    @classmethod
    def of(cls, spec: MeshSpec) -> Declared:
        """What the workers of a mesh have to be."""
        can = {
            method: getattr(spec.oracle, method)
            for method in ("intersect_flat", "tangent_basis", "local_size")
        }
        return cls(spec.dimension, spec.ambient_dimension, **can)

    def closest_point(self, *query: Any) -> Any:
        raise AssertionError("answers of a puller are its caller's")


class _Given:
    """An oracle that answers one chunk with arrays that are there already."""

    thread_safe = True

    def __init__(self, like: CheckedOracle, points: Any, found: np.ndarray, **more: Any) -> None:
        self.dimension, self.ambient_dimension = like.dimension, like.ambient_dimension
        self._points, self._found, self._more = points, found, more

    def closest_point(self, query: np.ndarray) -> Any:
        if not self._found.all():
            raise NotConverged(self._points, self._found)
        return self._points

    def intersect_flat(self, *query: np.ndarray) -> Any:
        return self._points, self._found

    def tangent_basis(self, points: np.ndarray) -> Any:
        return self._rows("tangents")

    def local_size(self, points: np.ndarray) -> Any:
        return self._rows("sizes")

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
      bases, radii: (n, d, k) and (n,) of "intersect_flat", else None.
      wants_tangents, wants_sizes: what answer() has to be given as well.
    """

    def __init__(self, oracle: CheckedOracle, wire: pb.QueryChunk) -> None:
        d, k = oracle.ambient_dimension, oracle.dimension
        self._oracle, self._wire = oracle, wire
        self._reply: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self.answered = False
        self.points = from_wire(wire.points, -1, d)
        flat = wire.kind == pb.QUERY_KIND_INTERSECT_FLAT
        self.kind = "intersect_flat" if flat else "closest_point"
        self.bases = from_wire(wire.bases, len(self.points), d, k) if flat else None
        self.radii = from_wire(wire.radii, len(self.points)) if flat else None
        self.wants_tangents, self.wants_sizes = wire.want_tangents, wire.want_sizes

    def __len__(self) -> int:
        return len(self.points)

    def answer(
        self, points: Any, tangents: Any = None, sizes: Any = None, found: Any = None
    ) -> None:
        """Answers the batch: `points` (n, d), `tangents` (n, d, k), `sizes` (n,).

        `found` (n,) is False where there is no answer; the other arrays hold anything there. What
        was not asked for is ignored.

        Raises: OracleError for an array that cannot be an answer; another may be given then.
        """
        if self.answered:
            raise FailedPrecondition("this chunk was answered already")
        count = len(self)
        flags = np.ones(count, dtype=bool) if found is None else np.asarray(found)
        if flags.shape != (count,) and flags.size != 1 or flags.size != count:
            raise OracleError(f"found has the shape {flags.shape}, not ({count},)", "ORACLE_SHAPE")
        given = _Given(
            self._oracle, points, flags.reshape(count).astype(bool), tangents=tangents, sizes=sizes
        )
        self._settle(answer(CheckedOracle(given), self._wire))

    def fail(self, message: str) -> None:
        """There are no answers, now or later: the mesh fails, with this message."""
        self._settle(OracleError(str(message)))

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
    """The chunks of a mesh, as an iterator and a context manager: see stellate.pull, Client.pull.

    Attributes:
      progress: how the mesh stands, as far as is known; of Client.pull always None.
      mesh: the finished mesh, once the loop is over; of Client.pull always None.
      state: of Client.pull, how the mesh ended, e.g. "SUCCEEDED", once the loop is over.
    """

    def __init__(self) -> None:
        self.progress: Progress | None = None
        self.mesh: Mesh | None = None
        self.state = ""
        self._chunks: queue.SimpleQueue[Chunk | None] = queue.SimpleQueue()
        self._open: Chunk | None = None
        self._over = self._left = False
        self._failure: BaseException | None = None
        self.stop: Callable[[], None] = lambda: None

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

    def ask(self, oracle: CheckedOracle, wire: pb.QueryChunk) -> pb.ServeOracleRequest:
        chunk = Chunk(oracle, wire)
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
        self._open = None if self._over else self._chunks.get()
        if self._open is None:
            self._over = True
            if self._failure is not None:
                failure, self._failure = self._failure, None
                raise failure
            raise StopIteration
        return self._open

    def close(self) -> None:
        """Leaves the loop early: a mesh of stellate.pull is cancelled, another goes on without us."""
        if self._over:
            return
        self._left = self._over = True
        self.stop()
        while self._thread.is_alive():
            if self._open is not None and not self._open.answered:
                self._open.fail("the loop that answers was left")
            try:
                self._open = self._chunks.get(timeout=0.05)
            except queue.Empty:
                continue

    def __enter__(self) -> Puller:
        return self

    def __exit__(self, *raised: object) -> None:
        self.close()
