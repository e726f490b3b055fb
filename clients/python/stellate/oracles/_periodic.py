"""Periodic cells: space modulo a lattice, as a manifold, and what is periodic on it."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any, Callable

import numpy as np

from .._functions import UserFunction
from .._rows import Array, Flags, norms, product, transposed
from ..errors import InvalidArgument
from ._combined import LevelSet
from ._common import all_or_raise
from ._walls import Clipped

_ROUNDING = 1e-12  # of products of vectors, beside the longest's square
_REDUCTIONS = 1000  # Selling's steps, of which bases of people take a few
_ITERATIONS = 60
_LEAST_PIVOT = 1e-3  # of elimination; the bend of a nearest point is that of the torus, near 1
_STEP = 6e-6  # of differences, in shares of the cell
_NEAR = (
    0.3  # of the smallest radius: so near the torus the angles of any circles are a good beginning
)
_PERIODS = 64  # places where a function is tried for its period
_AGREE = 1e-7  # of what its values are, to which it has one
_MOST_IN_TABLES = 16  # walls with labels, which servers take

Function = Callable[[Array], Any]


class PeriodicCell:
    """R^d modulo a lattice: the flat torus, embedded without any stretching in R^(2 N).

        cell = PeriodicCell(2 * np.pi * np.eye(3))
        mesh = stellate.mesh(cell.solid(gyroid), epsilon=0.45)
        plain = mesh.unwrap(cell).plain()

    Functions on it take plain coordinates (n, d), and are periodic. Vectors v[0] + ... + v[d] = 0 that
    generate the lattice, no two of them at an acute angle, are an obtuse superbase of it. Selling's
    formula,

        length(sum_i n[i] v[i])^2 = sum_{i < j} -(v[i] . v[j]) (n[i] - n[j])^2,

    says that circles of radii sqrt(-v[i] . v[j]) / 2 pi, with angles 2 pi (n[i] - n[j]), embed it
    isometrically: at most 6 for d = 3.

    Args:
      lattice: (d, d), a vector that space repeats by in each row; any Bravais lattice of R^2 and R^3,
        and of other R^d where it has an obtuse superbase.

    Attributes:
      lattice: (d, d), as given.
      radii: (N,), of the circles.
      dual: (d, d), the gradient of each lattice coordinate in a row.
    """

    thread_safe = True

    def __init__(self, lattice: Any) -> None:
        self.lattice = _lattice(lattice)
        d = self.dimension = len(self.lattice)
        vectors = _superbase(self.lattice)
        pairs = [
            (i, j) for i, j in itertools.combinations(range(d + 1), 2)
            if -vectors[i] @ vectors[j] > _ROUNDING * np.abs(vectors @ vectors.T).max()
        ]  # fmt: skip
        self.radii = np.sqrt([-vectors[i] @ vectors[j] for i, j in pairs]) / (2 * np.pi)
        self.ambient_dimension = 2 * len(pairs)
        # x = sum n_i v_i over i >= 1, n_0 = 0: the angles are 2 pi of whole forms of the n_i.
        ends = np.vstack([np.zeros(d), np.eye(d)])
        forms = np.array([ends[i] - ends[j] for i, j in pairs])
        turns = 2 * np.pi * np.linalg.inv(vectors[1:]) @ forms.T
        self._turns = np.ascontiguousarray(turns)  # (d, N): plain coordinates to angles
        self._inverse = np.linalg.inv(self.lattice)
        self.dual = self._inverse.T  # (d, d): the gradients of the lattice coordinates
        # What takes the angles of some circles that tell where a point is to plain coordinates.
        self._trees = {t: np.linalg.inv(self._turns[:, list(t)]) for t in _trees(pairs, d)}
        self._best = max(self._trees, key=lambda tree: float(self.radii[list(tree)].prod()))
        corner = 1.1 * np.repeat(self.radii, 2)
        self.bounding_box = -corner, corner

    def embed(self, points: Any) -> Array:
        """(n, d) -> (n, 2 N): plain coordinates onto the torus."""
        x = np.asarray(points, dtype=np.float64)
        angles = (x[:, :, None] * self._turns).sum(axis=1)
        circles = self.radii[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=2)
        return np.ascontiguousarray(circles.reshape(len(x), self.ambient_dimension))

    def coordinates(self, points: Any) -> Array:
        """(n, 2 N) -> (n, d): plain coordinates, in the cell, of points of the torus."""
        return self._in_cell(self._read(np.asarray(points, dtype=np.float64), self._best))

    def fractional(self, points: Any) -> Array:
        """(n, d) -> (n, d): plain coordinates in vectors of the lattice, x = fractional @ lattice.

        A row's value depends on that row alone to the last bit, which x @ inverse does not promise.
        """
        x = np.asarray(points, dtype=np.float64)
        return np.asarray((x[:, :, None] * self._inverse).sum(axis=1))

    # The oracle.

    def closest_point(self, points: Array) -> Array:
        """(n, 2 N) -> (n, 2 N): Newton's method in plain coordinates, from the best of some beginnings.

        Raises: NotConverged, with what was found.
        """
        x, found = self._nearest(np.asarray(points, dtype=np.float64))
        return all_or_raise(self.embed(x), found)

    def tangent_basis(self, points: Array) -> Array:
        """(n, 2 N) -> (n, 2 N, d): the directions of plain coordinates, which are orthonormal."""
        circles = np.asarray(points, dtype=np.float64).reshape(len(points), -1, 2)
        away = circles / np.sqrt((circles * circles).sum(axis=2, keepdims=True))
        along = np.stack([-away[:, :, 1], away[:, :, 0]], axis=2)
        bases = along[:, :, :, None] * (self.radii * self._turns).T[None, :, None, :]
        return np.ascontiguousarray(bases.reshape(len(points), self.ambient_dimension, -1))

    # What is on it.

    def level_set(self, f: Function, gradient: Function | None = None) -> LevelSet:
        """{f = 0}, of a periodic f.

        Args:
          f: (n, d) -> (n,), or (n, m) for m equations, of plain coordinates.
          gradient: (n, d) -> (n, d), or (n, m, d); None: differences of f.

        Raises: InvalidArgument, also where f does not repeat by the lattice.
        """
        lifted = Lifted(self, f, gradient, "f")
        return LevelSet(self, lifted, lifted.gradient)

    def solid(self, walls: Function | Sequence[Function], gradients: Any = None) -> Clipped:
        """{g >= 0}, or where all of several periodic walls are.

        Args:
          walls: a function (n, d) -> (n,) of plain coordinates, or several.
          gradients: (n, d) -> (n, d), one for each wall; None: differences.

        Raises: InvalidArgument, also where a wall does not repeat by the lattice.
        """
        several = [walls] if callable(walls) else list(walls)
        slopes = [gradients] if callable(gradients) else gradients
        slopes = [None] * len(several) if slopes is None else list(slopes)
        if len(slopes) != len(several):
            raise InvalidArgument("gradients have to be one for each wall, or None")
        names = [f"wall {i}" for i in range(len(several))]
        lifted = [Lifted(self, *three) for three in zip(several, slopes, names)]
        return Clipped(self, lifted)

    def cut(
        self,
        walls: Function | Sequence[Function] = (),
        gradients: Any = None,
        *,
        labels: Any = None,
        origin: Any = None,
        names: Sequence[str] = (),
    ) -> CutCell:
        """{g >= 0}, or the regions of several periodic walls, cut along the cell's faces: no simplex goes
        through one, so that mesh.unwrap(cut) is a cell with plane faces, and opposite ones have the same
        nodes.

            cut = cell.cut(g, gradient, labels=[1, 2])  # a matrix, and what is where g >= 0
            period = stellate.mesh(cut, epsilon=0.3).unwrap(cut)
            mesh, (pairs, periods) = period.plain(), period.node_pairs()

        Args:
          walls, gradients: as of `solid`; none of them: all of the cell.
          labels: (2^walls,), of the vectors of the walls' signs, as in Oracle.labels; None: 1 where all
            are positive.
          origin: (d,), plain coordinates of a corner of the cell, by default 0. Walls have to cross the
            faces, and those planes halfway between them, at an angle.
          names: of the labels 1, 2, ...

        Raises: InvalidArgument, also for more than 16 walls with the d that cut.
        """
        several = [walls] if callable(walls) else list(walls)
        slopes = [gradients] if callable(gradients) else gradients
        slopes = [None] * len(several) if slopes is None else list(slopes)
        if len(slopes) != len(several):
            raise InvalidArgument("gradients have to be one for each wall, or None")
        return CutCell(self, several, slopes, labels, origin, names)

    # Pieces.

    def _read(self, points: Array, tree: tuple[int, ...]) -> Array:
        """Plain coordinates whose angles on some circles are those of the points."""
        circles = points.reshape(len(points), -1, 2)[:, list(tree)]
        angles = np.arctan2(circles[:, :, 1], circles[:, :, 0])
        return np.asarray((angles[:, :, None] * self._trees[tree]).sum(axis=1))

    def _in_cell(self, x: Array) -> Array:
        """The same modulo the lattice, with lattice coordinates from 0 to 1."""
        shares = self.fractional(x)
        shares -= np.floor(shares)
        shares[shares >= 1] = 0.0  # of what rounding has taken there
        return np.asarray((shares[:, :, None] * self.lattice).sum(axis=1))

    def _nearest(self, points: Array) -> tuple[Array, Flags]:
        """Where the distance to the points is least: plain coordinates, and where they were found."""
        circles = points.reshape(len(points), -1, 2)
        pull = self.radii * np.sqrt((circles * circles).sum(axis=2))  # (n, N)
        wanted = np.arctan2(circles[:, :, 1], circles[:, :, 0])

        def height(x: Array, rows: Any) -> Array:
            """Half the square of the distance, but for what does not depend on x."""
            off = (x[:, :, None] * self._turns).sum(axis=1) - wanted[rows]
            return np.asarray((pull[rows] * (1 - np.cos(off))).sum(axis=1))

        x = self._read(points, self._best)
        best = height(x, np.arange(len(points)))
        # Near the torus any circles tell; farther away those that tell best.
        off = 2 * best + ((np.sqrt((circles * circles).sum(axis=2)) - self.radii) ** 2).sum(axis=1)
        far = np.flatnonzero(off > (_NEAR * self.radii.min()) ** 2)
        for tree in self._trees if far.size else ():
            begun = self._read(points[far], tree)
            there = height(begun, far)
            better = there < best[far]
            x[far[better]], best[far[better]] = begun[better], there[better]
        found, alive = np.zeros(len(points), dtype=bool), np.ones(len(points), dtype=bool)
        size = float(norms(self.radii))
        squares = self._turns[:, None, :] * self._turns[None, :, :]
        for _ in range(_ITERATIONS):
            rows = np.flatnonzero(alive & ~found)
            if not rows.size:
                break
            off = (x[rows][:, :, None] * self._turns).sum(axis=1) - wanted[rows]
            slope = (pull[rows] * np.sin(off))[:, None, :] * self._turns
            bend = (pull[rows] * np.cos(off))[:, None, None, :] * squares
            step = -_down(bend.sum(axis=3), slope.sum(axis=2))
            length = norms(step)
            step *= np.minimum(1.0, size / np.maximum(length, 1e-300))[:, None]
            found[rows[length <= 1e-12 * size]] = True
            left, fraction = np.flatnonzero(length > 1e-12 * size), 1.0
            while left.size and fraction > 1e-6:
                mine = rows[left]
                there = x[mine] + fraction * step[left]
                # So near the minimum heights cannot tell better from worse.
                slack = np.where(length[left] <= 1e-5 * size, 1e-14 * size**2, 0.0)
                better = height(there, mine) <= height(x[mine], mine) + slack
                x[mine[better]] = there[better]
                left, fraction = left[~better], fraction / 2
            alive[rows[left]] = False
        return x, found


def _down(bends: Array, slopes: Array) -> Array:
    """Solutions (n, d) of symmetric systems (n, d, d), by elimination, with pivots kept above 0: a
    function of such a bend and slope falls along their negatives. LAPACK rounds as memory lies."""
    bends, x, d = bends.copy(), slopes.copy(), slopes.shape[1]
    pivots = np.empty_like(x)
    for i in range(d):
        pivots[:, i] = np.maximum(np.abs(bends[:, i, i]), _LEAST_PIVOT)
        for j in range(i + 1, d):
            factor = bends[:, j, i] / pivots[:, i]
            bends[:, j, i:] -= factor[:, None] * bends[:, i, i:]
            bends[:, j, i] = factor
            x[:, j] -= factor * x[:, i]
    x /= pivots
    for i in reversed(range(d)):
        for j in range(i + 1, d):
            x[:, i] -= bends[:, j, i] * x[:, j]
    return x


class CutCell(Clipped):
    """What PeriodicCell.cut makes: an oracle of walls, of which the last d cut along the faces.

    Each of those is a sine that is zero on two opposite faces, which are one, and on the plane halfway
    between them. What is on its sides has a label of its own, so that it is kept: the labels that the
    server sees are those of the parts, `parts` of which says what label of `labels` each belongs to.

    Attributes:
      cell, origin: as given.
      parts: (number of the server's labels,), the label of each, 0 of 0.
    """

    def __init__(
        self,
        cell: PeriodicCell,
        walls: list[Function],
        gradients: list[Function | None],
        labels: Any,
        origin: Any,
        names: Sequence[str],
    ) -> None:
        d, m = cell.dimension, len(walls)
        self.cell = cell
        self.origin = np.zeros(d) if origin is None else np.array(origin, dtype=np.float64)
        if self.origin.shape != (d,) or not np.isfinite(self.origin).all():
            raise InvalidArgument(f"origin has to be a point of R^{d}, and is {origin!r}")
        if m + d > _MOST_IN_TABLES:
            raise InvalidArgument(
                f"there are {m} walls, and {d} that cut; there may be {_MOST_IN_TABLES} together"
            )
        given = np.zeros(1 << m, dtype=np.int8) if labels is None else np.array(labels)
        if labels is None:
            given[-1] = 1
        if given.shape != (1 << m,) or given.dtype.kind not in "iu":
            raise InvalidArgument(f"labels have to be {1 << m} whole numbers, for {m} walls")
        inside = np.unique(given[given > 0])
        if not inside.size or inside.size << d > 127:
            raise InvalidArgument(
                f"there are {inside.size} labels above 0, each in {1 << d} parts; there may be 1 to "
                f"{127 >> d}"
            )
        self.parts = np.concatenate([[0], np.repeat(inside, 1 << d)]).astype(np.int8)
        codes = np.arange(1 << (m + d))
        own = given[codes % (1 << m)]
        table = np.searchsorted(inside, np.maximum(own, 0)) * (1 << d) + (codes >> m) + 1
        table = np.where(own > 0, table, own)
        lifted = [
            Lifted(cell, *three) for three in zip(walls, gradients, (f"wall {i}" for i in range(m)))
        ]
        seams = [_Seam(cell, axis, self.origin) for axis in range(d)]
        lifted += [Lifted(cell, seam, seam.gradient, f"face {i}") for i, seam in enumerate(seams)]
        super().__init__(cell, lifted, labels=table)
        self.names = tuple(names)


class _Seam:
    """sin(2 pi u) of one of the lattice coordinates, from an origin on."""

    def __init__(self, cell: PeriodicCell, axis: int, origin: Array) -> None:
        self._cell, self._axis, self._origin = cell, axis, origin

    def __call__(self, points: Array) -> Array:
        return np.asarray(np.sin(self._angle(points)))

    def gradient(self, points: Array) -> Array:
        slope = 2 * np.pi * np.cos(self._angle(points))
        return np.asarray(slope[:, None] * self._cell.dual[self._axis])

    def _angle(self, points: Array) -> Array:
        return np.asarray(2 * np.pi * self._cell.fractional(points - self._origin)[:, self._axis])


class Lifted:
    """A periodic function of plain coordinates, as a function near the torus."""

    def __init__(
        self, cell: PeriodicCell, f: Function, gradient: Function | None, name: str
    ) -> None:
        if not callable(f) or not (gradient is None or callable(gradient)):
            raise InvalidArgument(f"{name} has to be a function, and its gradient one, or None")
        self._cell, d = cell, cell.dimension
        self._values = UserFunction(f, name, ("m",), str(d))
        self._slopes = None
        if gradient is not None:
            self._slopes = UserFunction(gradient, f"the gradient of {name}", ("m", d), str(d))
        self._insist_on_period(name)

    def __call__(self, points: Array) -> Array:
        """(n, 2 N) -> (n, m)"""
        return self._values(self._cell.coordinates(points))

    def gradient(self, points: Array) -> Array:
        """(n, 2 N) -> (n, m, 2 N)"""
        x = self._cell.coordinates(points)
        if self._slopes is not None:
            slopes = self._slopes(x)
        else:
            h = _STEP * float(norms(self._cell.lattice).min()) * np.eye(len(self._cell.lattice))
            columns = [(self._values(x + v) - self._values(x - v)) / (2 * v.sum()) for v in h]
            slopes = np.stack(columns, axis=2)
        return product(slopes, transposed(self._cell.tangent_basis(points)))

    def _insist_on_period(self, name: str) -> None:
        """Raises: InvalidArgument, where the function does not repeat by the lattice's vectors."""
        lattice = self._cell.lattice
        shares = np.random.default_rng(1).random((_PERIODS, len(lattice)))
        x = (shares[:, :, None] * lattice).sum(axis=1)
        here = self._values(x)
        size = np.abs(here).max() or 1.0
        for vector in lattice:
            off = np.abs(self._values(x + vector) - here).max(axis=1)
            if not off.max() <= _AGREE * size:
                row = int(np.argmax(off))
                raise InvalidArgument(
                    f"{name} does not repeat by the lattice's vector {vector.tolist()}: at "
                    f"{x[row].tolist()} it is {here[row].tolist()}, and one vector on "
                    f"{self._values(x[row : row + 1] + vector)[0].tolist()}. It takes plain coordinates"
                )


def _lattice(given: Any) -> Array:
    """Raises: InvalidArgument."""
    try:
        lattice = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        lattice = np.empty(0)
    if lattice.ndim != 2 or lattice.shape[0] != lattice.shape[1] or not np.isfinite(lattice).all():
        raise InvalidArgument(
            f"a lattice has to be d vectors of R^d, a matrix (d, d) with one in each row: {given!r}"
        )
    sides = norms(lattice)
    if len(lattice) < 2 or not abs(np.linalg.det(lattice)) > 1e-9 * sides.prod():
        raise InvalidArgument(
            f"a lattice needs d >= 2 independent vectors, and these lie in one plane: {given!r}"
        )
    return lattice


def _superbase(lattice: Array) -> Array:
    """(d + 1, d): vectors that generate the lattice, of the sum 0, no two at an acute angle.

    By Selling's steps: of two at an acute angle one is turned round, and what that takes from the sum
    others are given. In R^2 and R^3 these end, since each shortens the vectors together.

    Raises: InvalidArgument.
    """
    d = len(lattice)
    vectors = np.vstack([-lattice.sum(axis=0), lattice])
    for _ in range(_REDUCTIONS):
        angles = vectors @ vectors.T
        np.fill_diagonal(angles, -np.inf)
        i, j = np.unravel_index(int(np.argmax(angles)), angles.shape)
        if angles[i, j] <= _ROUNDING * (vectors**2).sum(axis=1).max():
            return vectors
        others = [k for k in range(d + 1) if k not in (i, j)]
        best = None
        for a, b in itertools.combinations_with_replacement(others, 2):
            turned = vectors.copy()
            turned[i] = -vectors[i]
            turned[a] += vectors[i]
            turned[b] += vectors[i]
            if best is None or (turned**2).sum() < (best**2).sum():
                best = turned
        if best is None or not (best**2).sum() < (vectors**2).sum():
            break
        vectors = best
    raise InvalidArgument(
        f"no obtuse superbase was found for this lattice of R^{d}: every lattice of R^2 and R^3 has one, "
        "others only if their vectors can be chosen at no acute angles, as of cubes"
    )


def _trees(pairs: list[tuple[int, int]], d: int) -> list[tuple[int, ...]]:
    """Choices of d circles whose angles tell where a point is: spanning trees of the pairs."""
    found = []
    for tree in itertools.combinations(range(len(pairs)), d):
        group = list(range(d + 1))
        for i, j in (pairs[t] for t in tree):
            group = [group[i] if g == group[j] else g for g in group]
        if len(set(group)) == 1:
            found.append(tree)
    return found
