"""One mesh from its declaration to its end: the server asks, the oracle answers, we watch."""

from __future__ import annotations

import dataclasses
import logging
import numbers
import threading
from collections.abc import Generator, Iterator, Mapping, Sequence
from types import TracebackType
from typing import Any, Callable, TypeVar

import numpy as np

from ._checkpoint import Checkpoint
from ._command_oracle import CommandOracle
from ._download import assemble
from ._epsilon import Epsilon, choose
from ._extent import insist_on_an_end, warn_of_count
from ._files.formats import save
from ._findings import CheckReport
from ._follow import Arrival, Following, OnProgress
from ._mesh import FinishedMesh, Mesh, with_report
from ._part_files import stream
from ._places import Places
from ._saved import SavedMesh
from ._shared import table
from ._waiting import Waiting
from ._wire.spec import mesh_spec
from ._worker import Ask, answer, check_max_chunk, join_all
from .client import Client, MeshInfo
from .errors import Interrupted, InvalidArgument, SaveError, StellateError
from .oracle import CheckedOracle, points_of
from .oracles import in_units
from .oracles import kept as part_of
from .oracles._kept import Keep
from .oracles._units import units_of
from .progress import progress_bar
from .report import Progress, Report
from .server import Server

_log = logging.getLogger("stellate")

M = TypeVar("M", bound=Mesh)
Choice = Callable[
    [Any, Epsilon, Callable[[Any], CheckReport], Callable[[str], None]], "tuple[float, str]"
]

_FAREWELL_SECONDS = 2.0  # that an oracle may take to come to an end when no call waits for it


class _Workers:
    """Threads that serve one mesh with one oracle. The first exception of any is kept."""

    def __init__(
        self,
        client: Client,
        oracle: CheckedOracle,
        mesh: str,
        count: int,
        max_chunk: int | None,
        on_failure: Callable[[BaseException], None],
        ask: Ask,
    ) -> None:
        """`on_failure` is called with each; what it raises in turn stays here."""
        self.failure: BaseException | None = None
        self._on_failure, self._waiting = on_failure, Waiting()
        self._workers = [
            client.worker(
                oracle,
                mesh,
                f"python-{i + 1}",
                self._note,
                quiet=True,
                ask=ask,
                max_chunk=max_chunk,
            )  # fmt: skip
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
        self._on_failure(error)

    def remark(self) -> str:
        """What is to be said of an answer that takes long; else ""."""
        return self._waiting.remark(self._workers)

    def stop(self) -> None:
        for worker in self._workers:
            worker.stop()

    def finish(self) -> None:
        for worker in self._workers:
            worker.finish()

    def join(self, seconds: float) -> None:
        join_all(self._threads, seconds)


class _Shown:
    """An `on_progress` that also tells the given one, at each progress, what there is to remark."""

    def __init__(self, on_progress: OnProgress | None, remark: Callable[[], str]) -> None:
        self._on_progress, self._remark = on_progress, remark
        self.look = getattr(on_progress, "look", None)

    def __call__(self, progress: Progress) -> None:
        if self._on_progress is not None:
            self._on_progress(progress)
        text = self._remark()
        if text:
            _note(self._on_progress, text)


@dataclasses.dataclass
class _Live:
    """A mesh at work, and what works at it."""

    client: Client
    info: MeshInfo
    following: Following | Arrival
    workers: _Workers | None = None


class Run:
    """A mesh that is created, served and watched, as a context manager.

    Leaving it early cancels the mesh; leaving it at all deletes the mesh from the server, unless it is
    finished and stays. With a checkpoint it stays there until it is finished.
    """

    def __init__(
        self,
        oracle: Any,
        epsilon: Epsilon,
        server: str | Server | Client | None,
        on_progress: OnProgress | None,
        options: Mapping[str, Any],
        *,
        keep: Keep | None = None,
        scale: Any = None,
        every: bool = True,
        checkpoint: Checkpoint | None = None,
        ask: Ask = answer,
        stays: bool = False,
        to: Sequence[str] = (),
    ) -> None:
        """`keep`: see oracles.kept. `scale`: see oracles.in_units; what comes out is in the oracle's own
        coordinates.

        `stays`: a finished mesh is not deleted from its server, and says by what name it is there.

        `to`: files that the finished mesh goes into as it comes; iterating gives a SavedMesh, alone. With no
        checkpoint.

        `every`: iterating gives the mesh at every revision, and not only when it is finished.

        `ask`: see Client.worker.
        """
        options = {name: value for name, value in options.items() if value is not None}
        workers = options.pop("workers", 1)
        if not isinstance(workers, numbers.Integral) or workers < 1:
            raise InvalidArgument(f"workers has to be a whole number from 1 on, and is {workers!r}")
        given: Any = on_progress
        if given is progress_bar or not (given is None or callable(given)):
            raise InvalidArgument(
                "on_progress has to be a function of a Progress, such as stellate.progress_bar(), "
                f"and is {on_progress!r}"
            )
        max_chunk = check_max_chunk(options.pop("max_chunk", None))
        self._coordinate_names = CheckedOracle(oracle).coordinate_names
        self._d = CheckedOracle(oracle).ambient_dimension
        if scale is not None:
            if "seeds" in options:
                units = units_of(scale, self._d)
                options["seeds"] = points_of(options["seeds"], self._d) / units
            oracle = in_units(oracle, scale)
        self._places, self._asked_places = Places(oracle), Places(oracle, asked=True)
        self._units = np.array(CheckedOracle(oracle).coordinate_scale or 1.0)
        if keep is not None:
            oracle = part_of(oracle, keep, options.get("seeds"))
        checked = CheckedOracle(oracle)
        mesh_spec(checked, 1.0, options)  # what is misspelt shows before the oracle is probed
        if not isinstance(oracle, CommandOracle):
            insist_on_an_end(checked)
        choice: Choice = choose
        if checkpoint is not None:
            choice = checkpoint.choose_epsilon
        self._on_progress, self._checkpoint, self._stays = on_progress, checkpoint, stays
        self._to, self._is_command = tuple(to), isinstance(oracle, CommandOracle)
        self._epsilon_reason = ""
        self._where_it_ends: Callable[[], str] | None = getattr(oracle, "where_it_ends", None)
        try:
            choice_made = choice(
                oracle,
                epsilon,
                lambda it: _check(it, server),
                lambda text: _note(on_progress, text),
            )
        except StellateError as error:
            raise self._in_own_words(error)  # noqa: B904, it is the same one
        chosen = self._say(choice_made)
        kept = checkpoint.retries if checkpoint is not None else None
        most = table("auto.toml")["retries"] if kept is None else kept
        self._retries = most if self._epsilon_reason else 0
        self._interrupted = self._ended = False
        self._next: tuple[float, str] | None = None  # what epsilon is to be tried after this one
        self._server: Server | None = None
        self._own_client: Client | None = None
        self._live: _Live | None = None
        self._kept: FinishedMesh | None = None
        if checkpoint is not None:
            spec = mesh_spec(checked, chosen, options)
            checkpoint.require(spec)
            self._kept = checkpoint.finished(spec)
            if self._kept is not None:
                return
        try:
            if server is None:
                server = self._server = Server(*(checkpoint.server_flags() if checkpoint else ()))
            if not isinstance(server, Client):
                server = self._own_client = Client(server)
            client = server

            def begin(size: float) -> _Live:
                self._warn_of_count(client, checked, size, options)
                info = self._declare(client, checked, size, options)
                live = _Live(client, info, self._follow(client, info, every))
                live.workers = _Workers(
                    client, checked, info.name, int(workers), max_chunk, self._on_failure, ask
                )
                return live

            self._begin, self._every = begin, every
            self._live = begin(chosen)
        except BaseException:
            self._close_connection()
            raise

    def _follow(self, client: Client, info: MeshInfo, every: bool) -> Following | Arrival:
        shown = _Shown(self._on_progress, self._remark)
        if self._to:
            return Arrival(client, info, shown)
        return Following(client, info, shown, every)

    def _remark(self) -> str:
        """What is to be said of an oracle that takes long; a command says that itself."""
        workers = None if self._live is None else self._live.workers
        return "" if workers is None or self._is_command else workers.remark()

    def _say(self, choice: tuple[float, str]) -> float:
        """Reports an epsilon that was chosen, with a reason, and returns it."""
        epsilon, self._epsilon_reason = choice
        if self._epsilon_reason:
            _note(self._on_progress, f"epsilon {epsilon:g}, {self._epsilon_reason}")
        return epsilon

    @property
    def _at_work(self) -> _Live:
        """Where the mesh was not finished before."""
        assert self._live is not None
        return self._live

    @property
    def _failure(self) -> BaseException | None:
        """What our own oracle raised."""
        workers = self._at_work.workers
        return None if workers is None else workers.failure

    def _warn_of_count(
        self, client: Client, oracle: CheckedOracle, epsilon: float, options: Mapping[str, Any]
    ) -> None:
        if self._is_command:
            return
        given = options.get("max_vertices")
        is_graded = "size_rate" in options or "max_deviation" in options
        warn_of_count(oracle, epsilon, is_graded, lambda: int(given or client.info().max_vertices))

    def _declare(
        self, client: Client, oracle: CheckedOracle, epsilon: float, options: Mapping[str, Any]
    ) -> MeshInfo:
        """A new mesh, or the one that the checkpoint has."""
        if self._checkpoint is None:
            return client.create(oracle, epsilon, **options)
        kept = None
        for info in client.list():
            if info.name == self._checkpoint.name:
                kept = info
            else:  # was forgotten, or never put down
                client.delete(info.name)
        if kept is not None:
            return kept
        info = client.create(oracle, epsilon, **options)
        spec = mesh_spec(oracle, epsilon, options)
        self._checkpoint.note(spec, info.name, self._epsilon_reason, self._retries)
        return info

    def _on_failure(self, error: BaseException) -> None:
        """Without a checkpoint it fails the mesh; with one the mesh waits for a better oracle."""
        if self._checkpoint is not None:
            self._at_work.following.stop()
            raise error

    def __iter__(self) -> Iterator[Mesh | SavedMesh]:
        """The mesh as it grows, the last with its report. Raises how it failed.

        Where epsilon was to be chosen and was too coarse, a finer mesh begins from the start.
        """
        if self._kept is not None:
            yield self._kept
            return
        coarse = None
        while True:
            try:
                last = yield from self._one_mesh()
            except StellateError as error:
                if error.mesh is None:
                    error.mesh = coarse
                raise
            if self._next is None:
                return
            coarse = last
            self._begin_anew(self._next)

    def _finer(self, report: Report | None) -> tuple[float, str] | None:
        """What is to follow a mesh that is over."""
        if self._retries == 0 or self._interrupted or report is None:
            return None
        finer = report.finer
        return None if finer is None else (finer.epsilon, finer.reason)

    def _begin_anew(self, choice: tuple[float, str]) -> None:
        self._retries -= 1
        self._leave(self._at_work)
        if self._checkpoint is not None:
            self._checkpoint.forget()
        self._ended = False
        self._live = self._begin(self._say(choice))
        if self._interrupted:  # meanwhile
            self.interrupt()

    def _one_mesh(self) -> Generator[Mesh | SavedMesh, None, Mesh | None]:
        mesh: Mesh | None = None
        saved: SavedMesh | None = None
        self._next = None
        try:
            for event in self._at_work.following:
                if isinstance(event, MeshInfo):
                    self._next = self._finer(event.report)
                    if self._next is None:
                        saved = self._arrived(event)
                        yield saved
                    continue
                mesh = self._told(event)
                self._next = self._finer(mesh.report)
                if isinstance(mesh, FinishedMesh) and self._next is None:
                    self._finish(mesh)
                if self._every or self._next is None:
                    yield mesh
        except StellateError as error:
            self._places.in_error(error, self._d)  # by the mesh as the server has it
            if isinstance(error.mesh, Mesh):  # the server says that it is over
                error.mesh = mesh = self._told(error.mesh)
                full = error.reason.startswith("JOURNAL_")  # with more room it goes on
                if self._checkpoint is not None and not full:
                    self._checkpoint.forget()  # it would fail again
            if not self._interrupted:
                raise self._best_reason(error) from None
        if self._interrupted and saved is not None:
            raise Interrupted(f"the mesh was finished, and is in {', '.join(saved.paths)}")
        if self._interrupted:
            raise self._interruption(mesh)
        if self._failure is not None and not self._ended:
            raise self._in_own_words(self._failure) from None
        return mesh

    def _finish(self, mesh: FinishedMesh) -> None:
        self._ended = True
        if self._checkpoint is not None:
            self._checkpoint.keep(mesh)

    def _arrived(self, info: MeshInfo) -> SavedMesh:
        """Puts the finished mesh into its files. Raises: SaveError, with the mesh or where it is."""
        client, report = self._at_work.client, info.report
        assert report is not None
        self._ended = True
        # Where places in words have to be found among the points, the mesh is taken whole.
        try:
            if report.certified or not self._places.known:
                nowhere = Mesh(np.empty((0, self._d)), np.empty((0, info.dimension + 1), np.int64))
                told = self._told(with_report(nowhere, report))
                final = dataclasses.replace(info, report=told.report)
                saved = stream(client, final, self._to)
                if saved is not None:
                    return dataclasses.replace(saved, name=told.name)
            mesh = self._told(assemble(client, info, 0, None))
            for file in self._to:
                save(mesh, file)
            return SavedMesh.of(mesh, self._to)
        except (OSError, SaveError) as error:
            if self._server is None:  # it is its user's, and keeps the mesh for a while
                self._stays = True
                raise SaveError(f"{error}; the mesh is on its server as {info.name}") from error
            mesh = assemble(client, info, 0, None)
            raise SaveError(f"{error}; the mesh is the exception's", mesh=mesh) from error

    def _best_reason(self, error: StellateError) -> BaseException:
        """Our own exception says more than the server's account of it."""
        ours = self._failure
        if ours is None:
            return error
        self._in_own_words(ours)
        if isinstance(ours, StellateError):
            ours.mesh = error.mesh
        return ours

    def _in_own_words(self, error: BaseException) -> BaseException:
        """What the oracle raised, with places in the coordinates that people know them by."""
        if isinstance(error, StellateError):
            return self._asked_places.in_error(error, self._d)
        return error

    def interrupt(self) -> None:
        """From another thread: iterating ends as soon as it can, with Interrupted."""
        self._interrupted = True
        if self._checkpoint is not None:
            self._at_work.following.stop()
            if self._at_work.workers is not None:
                self._at_work.workers.stop()
            return
        try:
            self._at_work.client.cancel(self._at_work.info.name, wait=False)
        except StellateError:
            self._at_work.following.stop()  # a server that is away cannot say how the mesh ends

    def _interruption(self, mesh: Mesh | None) -> Interrupted:
        mesh = mesh or self._told(self._at_work.following.so_far())
        size = f"{len(mesh.points):,} vertices"
        if self._ended:
            return Interrupted(f"the mesh was finished: {size}, the exception's mesh", mesh)
        if self._checkpoint is None:
            return Interrupted(
                f"the mesh is cancelled; what there was of it, {size}, is the exception's mesh. "
                "With checkpoint='directory' the same call would go on from there",
                mesh,
            )
        return Interrupted(
            f"the mesh, {size} so far, is kept in {self._checkpoint.directory}: the same call goes "
            "on from there",
            mesh,
        )

    def _told(self, mesh: M) -> M:
        """With what the server does not know: why epsilon is what it is, where the oracle's manifold
        ends, and the coordinates that people know places by."""
        mesh = self._places.in_mesh(mesh)
        mesh = dataclasses.replace(mesh, coordinate_names=self._coordinate_names)
        report = mesh.report
        if report is None:
            return mesh
        if self._where_it_ends is not None and report.termination == "NO_PROGRESS":
            asked = mesh.points / self._units
            end = self._asked_places.in_words(self._where_it_ends(), asked)
            if end:
                report = report.refused(f"{end}. The run ended as NO_PROGRESS")
        if self._epsilon_reason:
            report = dataclasses.replace(report, epsilon_reason=self._epsilon_reason)
        name = self._at_work.info.name if self._stays else ""
        return dataclasses.replace(mesh, report=report, name=name)

    def __enter__(self) -> Run:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        second = self._interrupted and isinstance(error, KeyboardInterrupt)
        kill = second and not isinstance(error, Interrupted)
        try:
            if self._live is not None and not kill:
                self._leave(self._live)
        finally:
            self._close_connection(kill)
            if self._checkpoint is not None and (self._ended or self._kept is not None):
                self._checkpoint.forget_server()
            close = getattr(self._on_progress, "close", None)
            if callable(close):
                close()

    def _leave(self, live: _Live) -> None:
        if live.workers is not None:
            if self._ended:
                live.workers.finish()
            else:
                live.workers.stop()
            live.workers.join(_FAREWELL_SECONDS)
        if self._checkpoint is None and not (self._stays and self._ended):
            try:
                live.client.delete(live.info.name, wait=False)
            except StellateError:
                pass  # it ends with its server, or somebody else was first

    def _close_connection(self, kill: bool = False) -> None:
        if self._own_client is not None:
            self._own_client.close()
        if self._server is not None:
            self._server.close(kill=kill)


def _check(oracle: Any, server: str | Server | Client | None) -> CheckReport:
    """With a server of its own, where there is none yet."""
    if isinstance(server, Client):
        return server.check(oracle)
    with Client(server) as client:
        return client.check(oracle)


def _note(on_progress: OnProgress | None, text: str) -> None:
    """Tells the log, and an `on_progress` that shows text."""
    _log.info("%s", text)
    note = getattr(on_progress, "note", None)
    if callable(note):
        note(text)
