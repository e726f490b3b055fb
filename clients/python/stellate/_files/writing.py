"""Files that are written a block at a time, so that no more of a mesh than that is in memory."""

from __future__ import annotations

import contextlib
import dataclasses
import errno
import os
import secrets
import stat
from collections.abc import Iterator
from typing import BinaryIO, Protocol

import numpy as np

from .._complex import in_space
from ..report import Report

_ROWS = 1 << 14  # that are text at a time
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)  # what a write raises, without a name


@dataclasses.dataclass(frozen=True, eq=False)
class Cells:
    """A group of cells of a file: their dimension and number, and of one of several groups what Group
    says of it."""

    dimension: int
    count: int
    tag: int = 1
    name: str = ""
    bits: int = 0
    label: int = 0
    sides: np.ndarray | None = None


@dataclasses.dataclass(frozen=True, eq=False)
class PointWalls:
    """The walls of points, wall i as bit i.

    Attributes:
      on: the ids of those that are on some, ascending.
      bits: (len(on),) uint64.
    """

    on: np.ndarray
    bits: np.ndarray

    @classmethod
    def of(cls, walls: np.ndarray) -> PointWalls:
        """walls: (n,) uint64."""
        on = np.flatnonzero(walls)
        return cls(on, walls[on])

    def rows(self, first: int, last: int) -> np.ndarray:
        """(last - first,) uint64: those of the points from `first` to before `last`."""
        some = slice(*np.searchsorted(self.on, (first, last)))
        walls = np.zeros(last - first, dtype=np.uint64)
        walls[self.on[some] - first] = self.bits[some]
        return walls


@dataclasses.dataclass(frozen=True, eq=False)
class Shape:
    """What a file is to hold, before any of it is there."""

    dimension: int
    ambient_dimension: int
    vertices: int
    groups: tuple[Cells, ...]
    report: Report | None = None
    walls: PointWalls | None = None
    has_labels: bool = False

    @property
    def simplices(self) -> int:
        return sum(group.count for group in self.groups)


class MeshWriter(Protocol):
    """A file on its way: all points, then the cells, group after group, as they are turned."""

    def add_points(self, points: np.ndarray) -> None: ...

    def add_cells(self, group: int, cells: np.ndarray) -> None: ...

    def finish(self) -> None: ...


@dataclasses.dataclass(frozen=True)
class TextLayout:
    """How a format of text is laid out around the numbers.

    Attributes:
      head, middle, end: before, between and after points and cells.
      groups: of each what is before it, and the prefix of its lines.
      in_space: of points the first three coordinates, zeros added.
      numbered: lines begin with their number.
    """

    head: str
    groups: tuple[tuple[str, str], ...]
    middle: str = ""
    end: str = ""
    point_prefix: str = ""
    in_space: bool = False
    numbered: bool = False
    first_id: int = 0


class TextWriter:
    """A MeshWriter by a layout."""

    def __init__(self, file: BinaryIO, layout: TextLayout) -> None:
        self._file, self._layout = file, layout
        self._in_cells, self._begun, self._line = False, 0, 0
        self._say(layout.head)

    def _say(self, text: str) -> None:
        self._file.write(text.encode())

    def add_points(self, points: np.ndarray) -> None:
        coordinates = in_space(points) if self._layout.in_space else points
        self._add(coordinates, "%.17g", self._layout.point_prefix)

    def add_cells(self, group: int, cells: np.ndarray) -> None:
        self._begin_cells()
        for before, _ in self._layout.groups[self._begun : group + 1]:
            self._say(before)
        self._begun = max(self._begun, group + 1)
        prefix = self._layout.groups[group][1]
        for first in range(0, len(cells), _ROWS):
            ids = cells[first : first + _ROWS].astype(np.int64) + self._layout.first_id
            self._add(ids, "%d", prefix)

    def finish(self) -> None:
        self._begin_cells()
        self._say(self._layout.end)

    def _begin_cells(self) -> None:
        if not self._in_cells:
            self._in_cells, self._line = True, 0
            self._say(self._layout.middle)

    def _add(self, rows: np.ndarray, number: str, prefix: str) -> None:
        line = prefix + " ".join([number] * rows.shape[1]) + "\n"
        for first in range(0, len(rows), _ROWS):
            some = rows[first : first + _ROWS]
            if self._layout.numbered:
                lines = enumerate(some.tolist(), self._line + 1)
                self._say("".join([f"{i}{line % tuple(row)}" for i, row in lines]))
                self._line += len(some)
            else:
                self._say(line * len(some) % tuple(some.ravel().tolist()))


def is_special(path: str) -> bool:
    """A pipe or a device: written as it is, since nothing may take its place."""
    return os.path.exists(path) and not stat.S_ISREG(os.stat(path).st_mode)


@contextlib.contextmanager
def replaced(path: str) -> Iterator[str]:
    """A file to write that takes the path's place when it is whole, and goes if it is not."""
    if is_special(path):
        yield path
        return
    target = os.path.realpath(path)
    root, ending = os.path.splitext(target)  # which meshio goes by
    draft = f"{root}.part-{secrets.token_hex(4)}{ending}"
    try:
        yield draft
        if os.path.exists(target):
            os.chmod(draft, stat.S_IMODE(os.stat(target).st_mode))
        with open(draft, "rb") as written:
            os.fsync(written.fileno())
        os.replace(draft, target)
    except BaseException as error:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(draft)
        if isinstance(error, OSError) and (
            error.filename == draft or (error.filename is None and error.errno in _FULL)
        ):
            error.filename = path  # the one that the caller knows
        raise
