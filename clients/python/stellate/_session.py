"""One mesh from its declaration to its end: the server asks, the oracle answers, we watch."""

from __future__ import annotations

import dataclasses
import logging
import threading
import time
from types import TracebackType
from typing import Any, Callable, Iterator, TypeVar

from ._epsilon import choose
from ._growth import GrowingComplex
from ._mesh import Mesh
from ._server import Server
from ._spec import mesh_spec
from .client import Client, MeshInfo
from .errors import Cancelled, StellateError, error_class
from .oracle import CheckedOracle
from .report import Progress, Report

T = TypeVar("T")

_log = logging.getLogger("stellate")

OnProgress = Callable[[Progress], None]

_FAREWELL_SECONDS = 2.0  # that an oracle may take to come to an end when nobody waits for it


class _Workers:
    """Threads that serve one mesh with one oracle. The first exception of any is kept."""

    def __init__(self, client: Client, oracle: CheckedOracle, mesh: str, count: int) -> None:
        self.failure: BaseException | None = None
        self._workers = [
            client.worker(oracle, mesh, f"python-{i + 1}", self._note, quiet=True)
            for i in range(count)
        ]
        self._threads = [
            threading.Thread(target=self._run, args=(worker,), name=f"oracle-{i + 1}", daemon=True)
            for i, worker in enumerate(self._workers)
        ]
        for thread in self._threads:
            thread.start()

    def _run(self, worker: Any) -> None:
        try:
            worker.run()
        except BaseException:
            # What the oracle raised is noted; what the server refuses, or its absence, the watch
            # reports.
            return

    def _note(self, error: BaseException) -> None:
        if self.failure is None:
            self.failure = error

    def stop(self) -> None:
        for worker in self._workers:
            worker.stop()

    def finish(self) -> None:
        for worker in self._workers:
            worker.finish()

    def join(self, seconds: float | None) -> None:
        deadline = None if seconds is None else time.monotonic() + seconds
        for thread in self._threads:
            thread.join(None if deadline is None else max(0.0, deadline - time.monotonic()))


class Session:
    """A mesh that is created, served and watched, as a context manager.

    Leaving it early cancels the mesh; leaving it at all deletes the mesh from the server.
    """

    def __init__(
        self,
        oracle: Any,
        epsilon: float | str,
        server: str | Server | Client | None,
        on_progress: OnProgress | None,
        workers: int,
        criteria: dict[str, Any],
        every: bool = True,
    ) -> None:
        """`every`: iterating gives the mesh at every revision, and not only when it is finished."""
        if int(workers) != workers or workers < 1:
            raise ValueError(f"workers has to be a whole number from 1 on, and is {workers!r}")
        checked = CheckedOracle(oracle)
        mesh_spec(checked, 1.0, criteria)  # what is misspelt shows before the oracle is probed
        epsilon, self._epsilon_reason = choose(oracle, epsilon)
        if self._epsilon_reason:
            _note(on_progress, f"epsilon {epsilon:g}, {self._epsilon_reason}")
        self._on_progress, self._every = on_progress, every
        self._owns_client = not isinstance(server, Client)
        self._client = server if isinstance(server, Client) else Client(server)
        try:
            self.info = self._client.create(checked, epsilon, **criteria)
        except BaseException:
            self._close_client()
            raise
        self._ended = False
        self._workers = _Workers(self._client, checked, self.info.name, int(workers))

    def __iter__(self) -> Iterator[Mesh]:
        """The mesh as it grows, the last with its report. Raises how it failed."""
        try:
            for mesh in follow(self._client, self.info, self._on_progress, self._every):
                yield self._told(mesh)
        except StellateError as error:
            if error.mesh is not None:
                error.mesh = self._told(error.mesh)
            if self._workers.failure is None:
                raise
            # Our own exception says more than the server's account of it.
            if isinstance(self._workers.failure, StellateError):
                self._workers.failure.mesh = error.mesh
            raise self._workers.failure from None
        self._ended = True

    def _told(self, mesh: Mesh) -> Mesh:
        """With what the server does not know: why epsilon is what it is."""
        if mesh.report is None or not self._epsilon_reason:
            return mesh
        report = dataclasses.replace(mesh.report, epsilon_reason=self._epsilon_reason)
        return dataclasses.replace(mesh, report=report)

    def __enter__(self) -> Session:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if self._ended:
                self._workers.finish()
            else:
                self._workers.stop()
            self._workers.join(_FAREWELL_SECONDS)
            try:
                self._client.delete(self.info.name, wait=False)
            except StellateError:
                pass  # it ends with its server, or somebody else was first
        finally:
            self._close_client()
            close = getattr(self._on_progress, "close", None)
            if callable(close):
                close()

    def _close_client(self) -> None:
        if self._owns_client:
            self._client.close()


def _note(on_progress: OnProgress | None, text: str) -> None:
    """Tells the log, and an `on_progress` that shows text."""
    _log.info("%s", text)
    note = getattr(on_progress, "note", None)
    if callable(note):
        note(text)


def follow(
    client: Client, info: MeshInfo, on_progress: OnProgress | None, every: bool = True
) -> Iterator[Mesh]:
    """A mesh at every revision until its end, or at its end alone.

    Closing the iterator leaves the mesh alone.
    """
    growth = GrowingComplex(info.dimension, info.ambient_dimension)
    watch = client.watch(info.name)
    watch.on_resume = growth.forget_pending
    progress: Progress | None = None
    try:
        for event in watch:
            kind = event.WhichOneof("event")
            if kind == "delta":
                if _sound(growth.absorb, event.delta) and every:
                    simplices = _sound(growth.simplices)
                    yield Mesh(growth.points(), simplices, None, progress, growth.revision)
            elif kind == "reset_mesh":
                growth.reset()
            elif kind == "progress":
                progress = Progress.from_wire(event.progress)
                if on_progress is not None:
                    on_progress(progress)
                if progress.phase == "CERTIFYING":
                    _sound(growth.settle)  # while the server is busy
            elif kind == "final":
                final = MeshInfo.from_wire(event.final)
                if on_progress is not None and progress != final.progress:
                    on_progress(final.progress)
                yield _finished(growth, final)
    finally:
        watch.close()


def _sound(step: Callable[..., T], *arguments: Any) -> T:
    """A step of a GrowingComplex, whose complaints are about the server."""
    try:
        return step(*arguments)
    except ValueError as error:
        raise StellateError(f"the server broke the protocol: {error}", "PROTOCOL") from error


def _finished(growth: GrowingComplex, final: MeshInfo) -> Mesh:
    simplices = _sound(growth.simplices)
    mesh = Mesh(growth.points(), simplices, final.report, final.progress, growth.revision)
    if final.state == "CANCELLED":
        raise Cancelled("the mesh was cancelled", mesh=mesh)
    if final.state == "FAILED":
        failure = final.report.failure if isinstance(final.report, Report) else None
        reason = failure.reason if failure else "ORACLE_FAILED"
        message = failure.message if failure else "the mesh failed, and the server does not say why"
        raise error_class(reason)(message, reason, mesh=mesh)
    return mesh
