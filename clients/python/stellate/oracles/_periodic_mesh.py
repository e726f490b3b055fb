"""Meshes that repeat by a lattice, in plain coordinates."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from .._mesh import Mesh
from .._rows import norms
from ..errors import InvalidArgument
from ._periodic import CutCell

_OFF = 1e-6  # of the torus's size: so near to it points of a mesh of it lie


@dataclasses.dataclass(frozen=True, eq=False)
class PeriodicMesh:
    """A simplicial complex of R^d that repeats by a lattice, one period of it: mesh.unwrap(cell).

    Corner j of simplex i is at points[simplices[i, j]] + shifts[i, j] @ lattice.

    Attributes:
      points: (n, d), plain coordinates in the cell: lattice coordinates from 0 to 1.
      simplices: (m, k+1) int64, ids of points; each simplex has its barycentre in the cell, but
        for a few at walls.
      shifts: (m, k+1, d) int64, in vectors of the lattice.
      lattice: (d, d), a vector in each row.
      walls: (n,) uint64, as of a Mesh, or None.
      labels: (m,) int8, as of a Mesh, or None.
      region_names: of the labels 1, 2, ...
      origin: (d,), a corner of the cell that the points are in.
    """

    points: np.ndarray
    simplices: np.ndarray
    shifts: np.ndarray
    lattice: np.ndarray
    walls: np.ndarray | None = None
    labels: np.ndarray | None = None
    region_names: tuple[str, ...] = ()
    origin: np.ndarray | None = None

    def corners(self) -> np.ndarray:
        """(m, k+1, d): where the corners of the simplices are."""
        return np.asarray(self.points[self.simplices] + self.shifts @ self.lattice)

    def plain(self, copies: int | Sequence[int] = 1) -> Mesh:
        """One period, or several side by side, as a mesh of R^d: whole simplices, none cut.

        Its border is jagged, or, of a PeriodicCell.cut, plane, and goes over into itself by the period:
        points there are repeated, and `node_pairs` says which belong together. As points it has those of
        all copies that some simplex needs.

        Args:
          copies: along each vector of the lattice, or along all.
        """
        return self._built(copies)[0]

    def node_pairs(self, copies: int | Sequence[int] = 1) -> tuple[np.ndarray, np.ndarray]:
        """Points of plain(copies) that are the same modulo its period, for periodic conditions.

        Returns: pairs (p, 2) int64 of its ids, the first of them one and the same for all that belong
          together; and periods (p, d) int64: points[pair[1]] is points[pair[0]] + period @ lattice,
          where multiples of `copies` alone occur.
        """
        _, ids, at, counts = self._built(copies)
        # Which of all points of the period a point is, and how many periods away.
        periods = np.floor_divide(at, counts)
        inner = at - periods * counts
        keys = np.column_stack([ids, inner])
        # The first of each kind: the one in the period itself, where there is one.
        order = np.lexsort((*periods.T[::-1], np.abs(periods).sum(axis=1), *keys.T[::-1]))
        _, first, kind = np.unique(keys[order], axis=0, return_index=True, return_inverse=True)
        masters = np.empty(len(keys), dtype=np.int64)
        masters[order] = order[first[np.ravel(kind)]]
        others = np.flatnonzero(masters != np.arange(len(keys)))
        pairs = np.column_stack([masters[others], others]).astype(np.int64)
        return pairs, (periods[others] - periods[masters[others]]) * counts

    def _built(
        self, copies: int | Sequence[int]
    ) -> tuple[Mesh, np.ndarray, np.ndarray, np.ndarray]:
        """The mesh, which of the points its points are, how far away (n, d), and the copies (d,)."""
        d = len(self.lattice)
        counts = np.broadcast_to(np.array(copies), (d,))
        if counts.dtype.kind not in "iu" or not (counts >= 1).all():
            raise InvalidArgument(f"copies have to be a number above 0, or {d} of them: {copies!r}")
        cells = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), -1).reshape(-1, d)
        shifts = (self.shifts[None] + cells[:, None, None, :]).reshape(-1, d)
        ids = np.broadcast_to(self.simplices, (len(cells), *self.simplices.shape)).reshape(-1)
        keys, where = np.unique(np.column_stack([ids, shifts]), axis=0, return_inverse=True)
        rows = np.sort(np.ravel(where).reshape(-1, self.simplices.shape[1]), axis=1)
        order = np.lexsort(rows.T[::-1])
        rows = rows[order].astype(np.int64)
        which, at = keys[:, 0], keys[:, 1:]
        points = self.points[which] + at @ self.lattice
        walls = None if self.walls is None else self.walls[which]
        labels = None if self.labels is None else np.tile(self.labels, len(cells))[order]
        mesh = Mesh(points, rows, walls=walls, labels=labels, region_names=self.region_names)
        return mesh, which, at, counts

    def __repr__(self) -> str:
        return (
            f"<stellate.oracles.PeriodicMesh k={self.simplices.shape[1] - 1} d={len(self.lattice)} "
            f"{len(self.points)} points, {len(self.simplices)} simplices a cell>"
        )


def unwrapped(mesh: Mesh, cell: Any) -> PeriodicMesh:
    """A mesh of something on a cell's torus, whose simplices go on by the shortest ways: Mesh.unwrap."""
    cut = cell if isinstance(cell, CutCell) else None
    if cut is not None:
        cell = cut.cell
    if getattr(cell, "ambient_dimension", None) != mesh.ambient_dimension:
        raise InvalidArgument(
            f"unwrap takes the oracles.PeriodicCell that the mesh is on, whose points are in "
            f"R^{mesh.ambient_dimension}, and has {cell!r}"
        )
    points = cell.coordinates(mesh.points)
    away = norms(cell.embed(points) - mesh.points)
    if len(away) and away.max() > _OFF * norms(cell.radii):
        raise InvalidArgument(
            f"the mesh is not in this cell: a point of it is {away.max():.3g} away from the torus"
        )
    shares = points @ np.linalg.inv(cell.lattice)
    if cut is not None:
        shares, points = _in_cut(mesh, cut, shares)
    corners = shares[mesh.simplices]
    shifts = -np.round(corners - corners[:, :1])
    corners = corners + shifts
    if len(corners) and np.ptp(corners, axis=1).max() > 0.5 - _OFF:
        raise InvalidArgument(
            "a simplex is longer than half of the cell, so that it is not known how it goes on: take a "
            "smaller epsilon"
        )
    back = np.floor(corners.mean(axis=1, keepdims=True))
    whole = (shifts - back).astype(np.int64)
    if mesh.walls is not None and cut is None:
        _join(mesh.simplices, whole, mesh.walls)
    labels, names, origin = mesh.labels, mesh.region_names, None
    if cut is not None:
        labels, names, origin = cut.parts[mesh.labels], cut.names, cut.origin
    return PeriodicMesh(
        points, mesh.simplices, whole, cell.lattice, mesh.walls, labels, names, origin
    )


def _in_cut(mesh: Mesh, cut: CutCell, shares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lattice coordinates from the cell's own corner on, and plain ones: exactly 0 on its faces, and
    one half between them, for the points that are on the walls that cut. Raises: InvalidArgument."""
    d = len(cut.origin)
    if mesh.walls is None or mesh.labels is None or mesh.labels.ndim != 1:
        raise InvalidArgument(
            "the mesh is not of this cell that is cut: it has no walls and labels"
        )
    shares = shares - cut.origin @ np.linalg.inv(cut.cell.lattice)
    shares -= np.floor(shares)
    on = (mesh.walls[:, None] >> np.arange(cut.walls - d, cut.walls).astype(np.uint64)) & np.uint64(
        1
    )
    shares = np.where(on == 1, np.round(2 * shares) / 2 % 1, shares)
    return shares, cut.origin + shares @ cut.cell.lattice


def _join(simplices: np.ndarray, shifts: np.ndarray, walls: np.ndarray) -> None:
    """Moves simplices, in place, to their neighbours behind facets whose corners all lie on a wall.

    Such a facet inside of the solid would be taken for a part of the wall, if the border went there.
    """
    width = simplices.shape[1]
    sides: dict[tuple[int, ...], list[tuple[int, int]]] = {}
    for left_out in range(width):
        kept = [c for c in range(width) if c != left_out]  # ids ascend in each row, and so in these
        on_one = np.bitwise_and.reduce(walls[simplices[:, kept]], axis=1) != 0
        for i in np.flatnonzero(on_one).tolist():
            turns = shifts[i, kept] - shifts[i, kept[0]]
            key = (*simplices[i, kept].tolist(), *turns.reshape(-1).tolist())
            sides.setdefault(key, []).append((i, kept[0]))
    beside: dict[int, list[tuple[int, int, int]]] = {}
    for both in sides.values():
        if len(both) == 2:
            (i, a), (j, b) = both
            beside.setdefault(i, []).append((j, a, b))
            beside.setdefault(j, []).append((i, b, a))
    placed: set[int] = set()
    for first in beside:
        stack = [] if first in placed else [first]
        placed.add(first)
        while stack:
            i = stack.pop()
            for j, a, b in beside[i]:
                if j not in placed:
                    shifts[j] += shifts[i, a] - shifts[j, b]
                    placed.add(j)
                    stack.append(j)
