"""A mesh with boundary on its way into files, where it is until it is known what groups it has."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from typing import IO

import numpy as np

from .groups import Group, cell_groups
from .writing import PointWalls

_BLOCK = 1 << 16  # rows that are read back at a time


class Spool:
    """Points and cells as they come, in files without names; in memory are only the cells that have a
    vertex on a wall, which alone say what faces there are. A context manager."""

    def __init__(self, folder: str, k: int, d: int, names: tuple[str, ...]) -> None:
        """Files in that folder. `names`: of the regions."""
        self._k, self._d, self._names = k, d, names
        self._points = tempfile.TemporaryFile(dir=folder)
        self._cells = tempfile.TemporaryFile(dir=folder)
        self._vertices = 0
        self._on = [np.empty(0, dtype=np.int64)]
        self._bits = [np.empty(0, dtype=np.uint64)]
        self._near = [np.empty((0, k + 2), dtype=np.uint32)]
        self._counts: dict[int, int] = {}  # of the cells of each label
        self._has_labels = False

    def __enter__(self) -> Spool:
        return self

    def __exit__(self, *raised: object) -> None:
        self._points.close()
        self._cells.close()

    @property
    def walls(self) -> PointWalls | None:
        """Of all points; None where none is on one."""
        on, bits = np.concatenate(self._on), np.concatenate(self._bits)
        self._on, self._bits = [on], [bits]
        return PointWalls(on, bits) if len(on) else None

    @property
    def has_labels(self) -> bool:
        return self._has_labels

    def count(self, label: int) -> int:
        """How many cells have it; 0: all, where there are no labels."""
        return self._counts.get(label, 0)

    def add_points(self, points: np.ndarray) -> None:
        self._points.write(np.ascontiguousarray(points, dtype=np.float64).tobytes())
        self._vertices += len(points)

    def add_walls(self, on: np.ndarray, bits: np.ndarray) -> None:
        """Of vertices beyond those before; wall i is bit i. Raises: ValueError if they are not."""
        order = np.argsort(on)
        on, bits = on[order], bits[order]
        last = self._on[-1]
        if (np.diff(on) == 0).any() or (len(on) and len(last) and on[0] <= last[-1]):
            raise ValueError("the walls of a vertex came twice")
        self._on.append(on[bits != 0])
        self._bits.append(bits[bits != 0])

    def add_cells(self, turned: np.ndarray, labels: np.ndarray | None) -> None:
        """(m, k+1), turned to agree, after all points; labels: (m,)."""
        of = np.zeros(len(turned), np.uint8) if labels is None else labels.astype(np.uint8)
        self._has_labels = self._has_labels or labels is not None
        for label, count in zip(*np.unique(of, return_counts=True)):
            self._counts[int(label)] = self.count(int(label)) + int(count)
        rows = np.column_stack([turned, of]).astype(np.uint32)
        self._cells.write(rows.tobytes())
        walls = self.walls
        if walls is not None:
            place = np.searchsorted(walls.on, turned).clip(max=len(walls.on) - 1)
            self._near.append(rows[(walls.on[place] == turned).any(axis=1)])

    def groups(self) -> list[Group]:
        """As those of the mesh; those of the regions have only the cells that are in memory."""
        near = np.concatenate(self._near)
        cells, labels = near[:, :-1].astype(np.int64), near[:, -1].astype(np.int64)
        walls = self.walls
        used = np.unique(cells)  # in whose numbers order stays what it is
        own = np.searchsorted(used, cells)
        bits = None
        if walls is not None:
            bits = np.zeros(len(used), dtype=np.uint64)
            there = np.searchsorted(walls.on, used).clip(max=len(walls.on) - 1)
            on = walls.on[there] == used
            bits[on] = walls.bits[there[on]]
        known = sorted(label for label, count in self._counts.items() if count)
        every = cell_groups(
            np.sort(own, axis=1), own, bits, labels if self.has_labels else None, self._names, known
        )
        return [
            Group(it.tag, it.name, it.walls, used[it.simplices], it.label, it.sides) for it in every
        ]

    def points(self) -> Iterator[np.ndarray]:
        """All of them, (n, d), some at a time."""
        yield from self._rows(self._points, np.dtype(np.float64), self._d)

    def cells(self, label: int) -> Iterator[np.ndarray]:
        """All that have it, (m, k+1) int64, some at a time."""
        for rows in self._rows(self._cells, np.dtype(np.uint32), self._k + 2):
            some = rows[rows[:, -1] == label, :-1].astype(np.int64)
            if len(some):
                yield some

    @staticmethod
    def _rows(file: IO[bytes], kind: np.dtype, width: int) -> Iterator[np.ndarray]:
        file.seek(0)
        while data := file.read(_BLOCK * width * kind.itemsize):
            yield np.frombuffer(data, kind).reshape(-1, width)
