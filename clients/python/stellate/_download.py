"""Fetching a mesh that is on a server."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Callable, Literal, get_args

import numpy as np

from ._files.formats import check_save
from ._info import MeshInfo, unless_failed
from ._mesh import Mesh, with_report
from ._part_files import OnPart, check_size, stream
from ._saved import SavedMesh
from ._wire import enums
from ._wire.arrays import from_wire, indices_from_wire, places_from_wire
from ._wire.delta_mesh import (
    labels_from_wire,
    lexicographic,
    spread_labels,
    spread_walls,
    walls_from_wire,
)
from ._wire.orientation import Orientation
from .client import Client
from .errors import FailedPrecondition, protocol_error
from .report import Progress

OnProgress = Callable[[Progress], None]

Unfinished = Literal["refuse", "wait", "take"]
UNFINISHED = get_args(Unfinished)


def fetch(
    client: Client,
    name: str,
    revision: int,
    unfinished: Unfinished,
    on_progress: OnProgress | None,
    on_part: OnPart | None,
    path: str | os.PathLike[str] | None = None,
) -> Mesh:
    """See stellate.download. The file is not written here."""
    paths = [] if path is None else [path]
    info = _settled(client, name, revision, unfinished, on_progress, paths)
    mesh = assemble(client, info, revision, on_part)
    if revision == 0 and unfinished != "take":
        unless_failed(mesh, info)
    return mesh


def fetch_to(
    client: Client,
    name: str,
    paths: Sequence[str | os.PathLike[str]],
    revision: int,
    unfinished: Unfinished,
    on_progress: OnProgress | None,
    on_part: OnPart | None,
) -> SavedMesh:
    """See stellate.download."""
    files = tuple(os.fspath(path) for path in paths)
    info = _settled(client, name, revision, unfinished, on_progress, files)
    if info.state in ("SUCCEEDED", "STOPPED") and revision in (0, info.revision):
        saved = stream(client, info, files, on_part)
        if saved is not None:
            saved.warn_if_uncertified(stacklevel=4)
            return saved
    mesh = assemble(client, info, revision, on_part)
    if revision == 0 and unfinished != "take":
        unless_failed(mesh, info)
    for file in files:
        mesh.save(file)
    return SavedMesh.of(mesh, files)


def _settled(
    client: Client,
    name: str,
    revision: int,
    unfinished: Unfinished,
    on_progress: OnProgress | None,
    paths: Sequence[str | os.PathLike[str]],
) -> MeshInfo:
    """The mesh, as it is to be fetched, into files that can be written."""
    if unfinished not in UNFINISHED:
        raise ValueError(f"unfinished has to be one of {UNFINISHED}, and is {unfinished!r}")
    info = client.get(name)
    for path in paths:
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
    return info


def _await_end(client: Client, name: str, on_progress: OnProgress | None) -> MeshInfo:
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
    raise protocol_error("it ended the watch too early")


def assemble(client: Client, info: MeshInfo, revision: int, on_part: OnPart | None) -> Mesh:
    d, width = info.ambient_dimension, info.dimension + 1
    points, rows = [np.empty((0, d))], [np.empty((0, width), dtype=np.uint32)]
    boundary: list[tuple[np.ndarray, np.ndarray]] = []
    turned: list[np.ndarray] = []  # (m,) bool, of the rows
    orientable: bool | None = True  # None: not known of all
    labels: list[tuple[np.ndarray, np.ndarray]] = []
    codes: list[np.ndarray] = []  # of the points
    smoothed: list[np.ndarray] = []
    vertices = simplices = 0
    parts = client.parts(info.name, revision)
    try:
        for part in parts:
            revision = part.revision
            try:
                block = from_wire(part.points, -1, d)
                cells = indices_from_wire(part.cells, -1, width)
                boundary += walls_from_wire(part, vertices + len(block))
                if len(cells) and not part.HasField("orientation"):
                    orientable = None
                elif len(cells) and orientable is not None:
                    bits = part.orientation
                    orientable = bits.orientable
                    told = Orientation.from_bits(bits.orientable, bits.turned, len(cells))
                    turned.append(told.flags(len(cells) if orientable else 0))
                labels += labels_from_wire(part.cell_labels, cells, info.boundary_only)
                if part.HasField("places"):
                    told_codes, positions = places_from_wire(part.places, len(block), d)
                    codes.append(told_codes)
                    smoothed += [] if positions is None else [positions]
            except ValueError as error:
                raise protocol_error(str(error)) from error
            if len(block) and part.first_vertex != vertices:
                raise protocol_error(
                    f"a part begins at vertex {part.first_vertex}, not at {vertices}"
                )
            points.append(block)
            rows.append(cells)
            vertices += len(block)
            simplices += len(cells)
            if on_part is not None:
                on_part(vertices + simplices, part.vertices + part.simplices)
    finally:
        parts.close()
    check_size(part, vertices, simplices)
    cells = np.concatenate(rows)
    if cells.size and int(cells.max()) >= vertices:
        raise protocol_error(f"a simplex has vertex {int(cells.max())} of {vertices} vertices")
    order = lexicographic(cells)
    orientation = None
    if orientable is not None:
        orientation = (
            Orientation.of(np.concatenate([np.empty(0, bool), *turned])[order])
            if orientable
            else Orientation(False)
        )
    last = info.end_time is not None and revision == info.revision
    cells = cells[order].astype(np.int64)
    mesh = Mesh(
        np.concatenate(points),
        cells,
        None,
        info.progress if last else None,
        revision,
        spread_walls(boundary, vertices),
        orientation,
        spread_labels(labels, cells),
        _places(codes, vertices),
        np.concatenate(smoothed) if sum(map(len, smoothed)) == vertices > 0 else None,
        info.region_names,
        scale=info.scale,
    )
    return with_report(mesh, info.report if last else None)


def _places(codes: list[np.ndarray], vertices: int) -> np.ndarray | None:
    """Their names; None where they are not known of all."""
    if not codes or sum(map(len, codes)) != vertices:
        return None
    found, which = np.unique(np.concatenate(codes), return_inverse=True)
    return np.array([enums.place(int(code)) for code in found])[which]
