"""A download that goes into files part by part."""

from __future__ import annotations

import contextlib
import itertools
import os
from collections.abc import Iterable, Sequence
from typing import Any, Callable

import numpy as np

from ._files.formats import can_stream, needs_groups, save_spooled, streamed_file
from ._files.spool import Spool
from ._files.writing import Cells, Shape
from ._info import MeshInfo
from ._saved import SavedMesh
from ._wire.arrays import from_wire, indices_from_wire
from ._wire.delta_mesh import labels_from_wire, walls_from_wire
from ._wire.orientation import Orientation
from .client import Client
from .errors import protocol_error

OnPart = Callable[[int, int], None]


class _NotSo(Exception):
    """The mesh does not come as it has to, with its orientation and in order: take it whole."""


def stream(
    client: Client,
    info: MeshInfo,
    files: Sequence[str],
    on_part: OnPart | None = None,
) -> SavedMesh | None:
    """The last revision of a mesh that is over, straight into files, with `info`'s report.

    Returns: None, and no files, where the mesh has to be fetched whole.
    """
    k, d = info.dimension, info.ambient_dimension
    has_walls = client.get_spec(info.name).walls > 0
    if not all(can_stream(file, k, d, has_walls, info.boundary_only) for file in files):
        return None
    parts = client.parts(info.name, info.revision)
    try:
        with contextlib.ExitStack() as stack:
            first = next(parts)
            own = (Cells(k, first.simplices),)
            shape = Shape(k, d, first.vertices, own, info.report)
            spooled = [file for file in files if needs_groups(file, k, d, has_walls)]
            sink = _Sink(
                stack, info, shape, [file for file in files if file not in spooled], spooled
            )
            for part in itertools.chain([first], parts):
                try:
                    sink.take(part)
                except ValueError as error:
                    raise protocol_error(str(error)) from error
                if on_part is not None:
                    on_part(sink.vertices + sink.simplices, shape.vertices + shape.simplices)
            check_size(shape, sink.vertices, sink.simplices)
            sink.write_spooled()
    except _NotSo:
        return None
    finally:
        parts.close()
    size = k, d, sink.vertices, sink.simplices
    return SavedMesh(tuple(files), *size, part.revision, info.report)


class _Sink:
    """The files, and what has come of the mesh."""

    def __init__(
        self,
        stack: contextlib.ExitStack,
        info: MeshInfo,
        shape: Shape,
        direct: Iterable[str],
        spooled: Sequence[str],
    ) -> None:
        self._shape, self._spooled = shape, spooled
        self._boundary_only = info.boundary_only
        self._files = [stack.enter_context(streamed_file(file, shape)) for file in direct]
        self._spool: Spool | None = None
        if spooled:
            folder = os.path.dirname(os.path.realpath(spooled[0]))
            size = shape.dimension, shape.ambient_dimension
            self._spool = stack.enter_context(Spool(folder, *size, info.region_names))
        self._last = np.empty((0, shape.dimension + 1), dtype=np.int64)  # the simplex before
        self.vertices = self.simplices = 0

    def take(self, part: Any) -> None:
        """Raises: ValueError for what makes no sense; _NotSo."""
        block = from_wire(part.points, -1, self._shape.ambient_dimension)
        rows = indices_from_wire(part.cells, -1, self._shape.dimension + 1).astype(np.int64)
        turned = _turned(part, rows)
        if len(block) and (part.first_vertex != self.vertices or self.simplices):
            raise ValueError(f"a part begins at vertex {part.first_vertex}, not at {self.vertices}")
        before = self.vertices
        self.vertices, self.simplices = self.vertices + len(block), self.simplices + len(rows)
        if len(block):
            self._add_points(block)
        if self._spool is not None:
            for on, bits in walls_from_wire(part, self.vertices):
                if int(on.min()) < before:
                    raise ValueError("walls of vertices came apart from these")
                self._spool.add_walls(on, bits)
        if not len(rows):
            return
        self._last = _next_in_order(self._last, rows, self.vertices)
        for file in self._files:
            file.writer.add_cells(0, turned if file.is_turned else rows)
        if self._spool is not None:
            labels = labels_from_wire(part.cell_labels, rows, self._boundary_only)
            if bool(labels) != self._spool.has_labels and self.simplices > len(rows):
                raise ValueError("a simplex has no label, and others have one")
            self._spool.add_cells(turned, labels[0][1] if labels else None)

    def _add_points(self, block: np.ndarray) -> None:
        for file in self._files:
            file.writer.add_points(block)
        if self._spool is not None:
            self._spool.add_points(block)

    def write_spooled(self) -> None:
        """Once all has come. Raises: _NotSo."""
        for file in self._spooled:
            assert self._spool is not None
            if not save_spooled(file, self._spool, self._shape):
                raise _NotSo


def _turned(part: Any, rows: np.ndarray) -> np.ndarray:
    """The part's rows, turned to agree. Raises: ValueError, _NotSo."""
    if len(rows) and not part.HasField("orientation"):
        raise _NotSo
    if not part.orientation.orientable:
        return rows
    bits = Orientation.from_bits(True, part.orientation.turned, len(rows))
    on = np.flatnonzero(bits.flags(len(rows)))
    turned = rows.copy()
    turned[on, -2:] = rows[on][:, [-1, -2]]
    return turned


def _next_in_order(last: np.ndarray, rows: np.ndarray, vertices: int) -> np.ndarray:
    """The last of the rows, which ascend, in themselves and one after the other."""
    if not (rows[:, :-1] < rows[:, 1:]).all():
        raise ValueError("it sent a simplex whose ids do not ascend")
    if int(rows[:, -1].max()) >= vertices:
        raise ValueError("it sent a simplex with a vertex that it never sent")
    steps = np.diff(np.concatenate([last, rows]), axis=0)
    first = (steps != 0).argmax(axis=1)
    if not (steps[np.arange(len(steps)), first] > 0).all():
        raise _NotSo
    return rows[-1:]


def check_size(announced: Any, vertices: int, simplices: int) -> None:
    """Raises: StellateError where other numbers came than were announced."""
    if (vertices, simplices) != (announced.vertices, announced.simplices):
        raise protocol_error(
            f"{announced.vertices} vertices and {announced.simplices} simplices were announced, and "
            f"{vertices} and {simplices} came"
        )
