"""Fetching a mesh that is on a server."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, Callable

import grpc
import numpy as np

from ._arrays import from_wire, indices_from_wire
from ._formats import check_save
from ._generated import stellate_pb2 as pb
from ._generated import stellate_pb2_grpc as rpc
from ._growth import in_order
from ._mesh import Mesh
from ._retry import Outage
from .errors import Cancelled, FailedPrecondition, StellateError, error_class, from_rpc
from .report import Progress

if TYPE_CHECKING:
    from .client import Client, MeshInfo

OnProgress = Callable[[Progress], None]
OnPart = Callable[[int, int], None]

UNFINISHED = ("refuse", "wait", "take")


class Parts:
    """An iterator over DownloadMeshResponse messages that survives a lost connection.

    After a break it goes on where it was: no part comes twice.
    """

    def __init__(self, stub: rpc.StellateStub, outage: Outage, name: str, revision: int) -> None:
        self._stub, self._outage = stub, outage
        self._request = pb.DownloadMeshRequest(name=name, revision=revision)
        self._stream: Any = None
        self._over = False

    def __iter__(self) -> Parts:
        return self

    def __next__(self) -> pb.DownloadMeshResponse:
        while not self._over:
            try:
                if self._stream is None:
                    self._stream = self._stub.DownloadMesh(self._request)
                part = next(self._stream)
            except StopIteration:
                raise _broken("it ended the download too early") from None
            except grpc.RpcError as error:
                self._stream = None
                self._outage.wait_or_raise(error, self._outage.explain(from_rpc(error)))
                continue
            self._outage.heard()
            self._request.revision = part.revision
            self._request.position = part.next_position
            self._over = part.complete
            return part
        raise StopIteration

    def close(self) -> None:
        """Reads no more."""
        self._over = True
        self._outage.stop()
        if self._stream is not None:
            self._stream.cancel()


def fetch(
    client: Client,
    name: str,
    revision: int,
    unfinished: str,
    on_progress: OnProgress | None,
    on_part: OnPart | None,
    path: str | os.PathLike[str] | None = None,
) -> Mesh:
    """See stellate.download. The file is not written here."""
    if unfinished not in UNFINISHED:
        raise ValueError(f"unfinished has to be one of {UNFINISHED}, and is {unfinished!r}")
    info = client.get(name)
    if path is not None:
        check_save(path, info.dimension, info.ambient_dimension)
    as_it_is = revision > 0 or unfinished == "take"
    # A mesh that was just cancelled is over, but its last round may be being computed still.
    if info.end_time is None and not as_it_is:
        if unfinished == "refuse" and not info.over:
            raise FailedPrecondition(
                f"{name} is not over: {info.state}, round {info.progress.round}, "
                f"{info.progress.vertices} vertices; wait for its end, or take it as it is"
            )
        info = _await_end(client, name, on_progress)
    mesh = _assemble(client, info, revision, on_part)
    return mesh if as_it_is else _judged(mesh, info)


def _await_end(client: Client, name: str, on_progress: OnProgress | None) -> MeshInfo:
    from .client import MeshInfo

    watch = client.watch(name, progress_only=True)
    try:
        for event in watch:
            kind = event.WhichOneof("event")
            if kind == "progress" and on_progress is not None:
                on_progress(Progress.from_wire(event.progress))
            elif kind == "final":
                return MeshInfo.from_wire(event.final)
    finally:
        watch.close()
    raise _broken("it ended the watch too early")


def _assemble(client: Client, info: MeshInfo, revision: int, on_part: OnPart | None) -> Mesh:
    d, width = info.ambient_dimension, info.dimension + 1
    points, rows = [np.empty((0, d))], [np.empty((0, width), dtype=np.uint32)]
    vertices = simplices = 0
    parts = client.parts(info.name, revision)
    try:
        for part in parts:
            revision = part.revision
            try:
                block = from_wire(part.points, -1, d)
                cells = indices_from_wire(part.cells, -1, width)
            except ValueError as error:
                raise _broken(str(error)) from error
            if len(block) and part.first_vertex != vertices:
                raise _broken(f"a part begins at vertex {part.first_vertex}, not at {vertices}")
            points.append(block)
            rows.append(cells)
            vertices += len(block)
            simplices += len(cells)
            if on_part is not None:
                on_part(vertices + simplices, part.vertices + part.simplices)
    finally:
        parts.close()
    if (vertices, simplices) != (part.vertices, part.simplices):
        raise _broken(
            f"{part.vertices} vertices and {part.simplices} simplices were announced, and "
            f"{vertices} and {simplices} came"
        )
    cells = np.concatenate(rows)
    if cells.size and int(cells.max()) >= vertices:
        raise _broken(f"a simplex has vertex {int(cells.max())} of {vertices} vertices")
    last = info.end_time is not None and revision == info.revision
    return Mesh(
        np.concatenate(points),
        in_order(cells),
        info.report if last else None,
        info.progress if last else None,
        revision,
    )


def _judged(mesh: Mesh, info: MeshInfo) -> Mesh:
    if info.state == "CANCELLED":
        raise Cancelled("the mesh was cancelled", mesh=mesh)
    if info.state == "FAILED":
        failure = info.report.failure if info.report is not None else None
        reason = failure.reason if failure else "ORACLE_FAILED"
        message = failure.message if failure else "the mesh failed, and the server does not say why"
        raise error_class(reason)(message, reason, mesh=mesh)
    return mesh


def _broken(what: str) -> StellateError:
    return StellateError(f"the server broke the protocol: {what}", "PROTOCOL")
