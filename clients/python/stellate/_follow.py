"""Watching a mesh to its end."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Callable, TypeVar

import numpy as np

from ._download import assemble
from ._info import MeshInfo, unless_failed
from ._mesh import FinishedMesh, Mesh, with_report
from ._wire.delta_mesh import DeltaMesh
from .client import Client
from .errors import StellateError, protocol_error
from .report import Progress

T = TypeVar("T")

OnProgress = Callable[[Progress], None]


class Following:
    """A mesh at every revision until its end, or at its end alone, as an iterator.

    Closing the iterator leaves the mesh alone.
    """

    def __init__(
        self, client: Client, info: MeshInfo, on_progress: OnProgress | None, every: bool = True
    ) -> None:
        self._on_progress, self._every = on_progress, every
        self._growth = DeltaMesh(info.dimension, info.ambient_dimension, info.boundary_only)
        self._region_names, self._scale = info.region_names, info.scale
        self._watch = client.watch(info.name)
        self._watch.on_resume = self._growth.forget_pending
        self._progress: Progress | None = None

    def __iter__(self) -> Iterator[Mesh]:
        growth = self._growth
        try:
            for event in self._watch:
                kind = event.WhichOneof("event")
                if kind == "delta":
                    if _sound(growth.absorb, event.delta) and self._every:
                        yield self.so_far()
                elif kind == "reset_mesh":
                    growth.reset()
                elif kind == "orientation":
                    _sound(growth.orient, event.orientation)
                elif kind == "progress":
                    progress = Progress.from_wire(event.progress)
                    self._note(progress)
                    if progress.phase == "CERTIFYING":
                        _sound(growth.settle)  # while the server is busy
                elif kind == "final":
                    final = MeshInfo.from_wire(event.final)
                    if self._progress != final.progress:
                        self._note(final.progress)
                    yield _finished(growth, final)
        finally:
            self._watch.close()

    def so_far(self) -> Mesh:
        """The mesh at its last complete revision."""
        simplices = _sound(self._growth.simplices)
        growth = self._growth
        return Mesh(
            growth.points(),
            simplices,
            None,
            self._progress,
            growth.revision,
            growth.walls(),
            labels=growth.labels(),
            region_names=self._region_names,
            scale=self._scale,
        )

    def stop(self) -> None:
        """From another thread: the iterator ends soon, with or without an exception."""
        self._watch.close()

    def _note(self, progress: Progress) -> None:
        self._progress = progress
        if self._on_progress is None:
            return
        self._on_progress(progress)
        look = getattr(self._on_progress, "look", None)  # a NotebookBar has
        if callable(look):
            look(self.so_far)


class Arrival:
    """A mesh whose end is waited for, and whose geometry stays on the server, as an iterator over the one
    MeshInfo of that end. Closing it leaves the mesh alone.
    """

    def __init__(self, client: Client, info: MeshInfo, on_progress: OnProgress | None) -> None:
        self._client, self._info, self._on_progress = client, info, on_progress
        self._watch = client.watch(info.name, progress_only=True)

    def __iter__(self) -> Iterator[MeshInfo]:
        """Raises: how the mesh failed, or Cancelled, with the mesh, which is fetched."""
        told: Progress | None = None
        try:
            for event in self._watch:
                kind = event.WhichOneof("event")
                if kind == "progress":
                    told = Progress.from_wire(event.progress)
                    self._note(told)
                elif kind == "final":
                    final = MeshInfo.from_wire(event.final)
                    if told != final.progress:
                        self._note(final.progress)
                    if final.state in ("CANCELLED", "FAILED"):
                        unless_failed(assemble(self._client, final, 0, None), final)
                    if final.report is None:
                        raise protocol_error("it ended the mesh without a report")
                    yield final
        finally:
            self._watch.close()

    def so_far(self) -> Mesh:
        """The mesh as the server has it; an empty one if it does not answer."""
        try:
            return assemble(self._client, self._info, 0, None)
        except StellateError:
            k, d = self._info.dimension, self._info.ambient_dimension
            return Mesh(np.empty((0, d)), np.empty((0, k + 1), dtype=np.int64))

    def stop(self) -> None:
        """From another thread: the iterator ends soon, with or without an exception."""
        self._watch.close()

    def _note(self, progress: Progress) -> None:
        if self._on_progress is not None:
            self._on_progress(progress)


def _sound(step: Callable[..., T], *arguments: Any) -> T:
    """A step of a DeltaMesh, whose complaints are about the server."""
    try:
        return step(*arguments)
    except ValueError as error:
        raise protocol_error(str(error)) from error


def _finished(growth: DeltaMesh, final: MeshInfo) -> FinishedMesh:
    simplices = _sound(growth.simplices)
    orientation = _sound(growth.orientation)
    mesh = with_report(
        Mesh(
            growth.points(),
            simplices,
            None,
            final.progress,
            growth.revision,
            growth.walls(),
            orientation,
            growth.labels(),
            region_names=final.region_names,
            scale=final.scale,
        ),
        final.report,
    )
    unless_failed(mesh, final)
    if not isinstance(mesh, FinishedMesh):
        raise protocol_error("it ended the mesh without a report")
    return mesh
