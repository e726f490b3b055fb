"""Manifolds given by charts: M is the union of the images of maps X: U in R^k -> R^d."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .._point_sets import as_points, tree_of
from .._rows import Array, Flags, apply, norms, product, transposed
from ..errors import InvalidArgument
from ._chart import Chart, Map
from ._common import Projection, box_around

_SAMPLES = 20_000  # of all charts together, to begin from
_NEAREST = 8  # of them looked at for each query
_BASINS = 3  # the most of these that begin a search
_ITERATIONS = 100
_SEAM = 1e-4  # of M's size: a gap between a period's ends that no solver's error explains
_ENDS = 16  # samples of each end of a parameter's interval that are looked beyond


class Parametrized(Projection):
    """An oracle for a closed manifold that is covered by charts.

    Where a parameter is not periodic, the images of other charts have to go on beyond the end of
    its interval, by some margin: a nearest point at the end of an interval is none. A sphere in
    angles has no derivative of full rank at its poles and takes two charts.

    Args:
      x, derivative, lower, upper, periodic: of one chart, as in Chart; or
      charts: of several.
      thread_safe: the maps may be called by several threads at once.

    A closest point is sought by Newton's method from the nearest of some 20,000 points of the
    charts, which is the right one where M does not fold more finely than they lie; needs scipy.
    """

    def __init__(
        self,
        x: Map | None = None,
        derivative: Map | None = None,
        lower: Any = None,
        upper: Any = None,
        periodic: bool | Sequence[bool] = False,
        *,
        charts: Sequence[Chart] | None = None,
        thread_safe: bool = False,
    ) -> None:
        if (x is None) == (charts is None):
            raise InvalidArgument("Parametrized takes either a map with its box, or charts=[...]")
        if charts is None:
            assert x is not None
            charts = [Chart(x, derivative, lower, upper, periodic)]
        if not charts:
            raise InvalidArgument("Parametrized needs one chart at least")
        self._charts = list(charts)
        self.dimension = len(self._charts[0].lower)
        self.thread_safe = thread_safe
        self._sample()
        self.ambient_dimension = self._points.shape[1]
        if not 1 <= self.dimension < self.ambient_dimension:
            raise InvalidArgument(
                f"charts of R^{self.dimension} into R^{self.ambient_dimension}: the first has to "
                "be the smaller"
            )
        self._scale = float(norms(np.ptp(self._points, axis=0)))
        self.bounding_box = box_around(self._points, 0.05)

    def where_it_ends(self) -> str:
        """Of what end of an interval M goes on nowhere, and what to do; "" if of none.

        Places a thousandth of a cell beyond the samples there should be on M. Where the map has no
        derivative of full rank, as at poles, it is not asked. Takes up to thousands of calls.
        """
        ends = [end for number in range(len(self._charts)) for end in self._beyond(number)]
        if not ends:
            return ""
        beyond = np.concatenate([points + step for _, _, points, step in ends])
        nearest, _, found = self._project(beyond)  # of all at once: maps may be slow
        away, first = norms(nearest - beyond), 0
        for chart, name, points, step in ends:
            rows = slice(first, first + len(points))
            first += len(points)
            if (found[rows] & (away[rows] < 0.5 * norms(step))).any():
                continue
            which = "the map" if len(self._charts) == 1 else f"chart {chart}"
            return (
                f"the manifold ends where {which} does, at {name}, as near "
                f"{points[len(points) // 2].round(6).tolist()}: no chart goes on there. If the parameter "
                "comes round, say periodic; if the manifold has a boundary, let the map go on beyond "
                "it and cut it by a wall: oracles.Clipped(parametrized, [wall])"
            )
        return ""

    def in_units(self, scale: Array) -> Parametrized:
        """The oracle of {x / scale : x in M}; see oracles.in_units."""
        charts = [chart.in_units(scale) for chart in self._charts]
        return Parametrized(charts=charts, thread_safe=self.thread_safe)

    def _beyond(self, number: int) -> list[tuple[int, str, Array, Array]]:
        """Of each end of a chart's intervals: its name, samples there, and a step beyond each."""
        chart, found = self._charts[number], []
        for axis in np.flatnonzero(~chart.wraps):
            cell = float(chart.extent[axis]) / (self._cells - 1)
            for side, end, way in (("lower", chart.lower, -1), ("upper", chart.upper, 1)):
                at = (self._owner == number) & (self._grid[:, axis] == end[axis])
                there = np.flatnonzero(at)
                there = there[:: max(1, len(there) // _ENDS)]
                slopes = chart.jacobian(self._grid[there])
                sizes = np.linalg.svd(slopes, compute_uv=False)
                if (sizes[:, -1] > 1e-6 * sizes[:, 0]).all():
                    name = f"the {side} end {end[axis]:g} of its parameter {axis}"
                    step = 1e-3 * cell * way * slopes[:, :, axis]
                    found.append((number, name, self._points[there], step))
        return found

    def intersect_flat(self, centers: Array, bases: Array, radii: Array) -> tuple[Array, Flags]:
        """Where M meets the flats {c + v : basis^T v = 0}: (points (n, d), found (n,))."""
        centers, bases = np.asarray(centers, dtype=float), np.asarray(bases, dtype=float)
        y, found = centers.copy(), np.zeros(len(centers), dtype=bool)
        for rows, chart, u in self._beginnings(centers):
            there, met = _meet(chart, u, centers[rows], bases[rows], self._scale)
            away = norms(there - centers[rows])
            met &= away <= radii[rows]
            better = met & (~found[rows] | (away < norms(y[rows] - centers[rows])))
            y[rows[better]], found[rows[better]] = there[better], True
        return y, found

    def _sample(self) -> None:
        """A grid of parameters on each chart, and where it lies in R^d."""
        grids, points, owners = [], [], []
        per_side = max(4, int((_SAMPLES / len(self._charts)) ** (1 / self.dimension)))
        for number, chart in enumerate(self._charts):
            if len(chart.lower) != self.dimension:
                raise InvalidArgument(
                    f"chart {number} has {len(chart.lower)} parameters, chart 0 {self.dimension}"
                )
            sides = [
                np.linspace(low, high, per_side, endpoint=not wraps)
                for low, high, wraps in zip(chart.lower, chart.upper, chart.wraps)
            ]
            u = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, self.dimension)
            grids.append(u)
            points.append(as_points(chart.points(u), f"the points of chart {number}"))
            size = float(norms(np.ptp(points[-1], axis=0)))
            self._insist_on_coming_round(number, chart, u, size)
            chart.insist_on_exactness()  # after that: what turns many times looks inexact
            owners.append(np.full(len(u), number))
        if len({p.shape[1] for p in points}) > 1:
            raise InvalidArgument(f"charts lead to R^d of d = {[p.shape[1] for p in points]}")
        self._grid, self._points = np.concatenate(grids), np.concatenate(points)
        self._owner, self._cells = np.concatenate(owners), per_side
        self._tree = tree_of(self._points)

    def _insist_on_coming_round(self, number: int, chart: Chart, u: Array, size: float) -> None:
        """Raises: InvalidArgument, of a periodic parameter at whose ends the map is at two places."""
        for axis in np.flatnonzero(chart.wraps):
            face = u[u[:, axis] == chart.lower[axis]]
            starts = face[:: max(1, len(face) // _ENDS)]
            ends = starts.copy()
            ends[:, axis] = chart.upper[axis]
            at, after = chart.points(starts), chart.points(ends)
            gaps = norms(after - at)
            worst = int(np.argmax(gaps))
            if gaps[worst] <= _SEAM * size or _lies_along(chart.points(face), after):
                continue
            which = "the map" if len(self._charts) == 1 else f"chart {number}"
            raise InvalidArgument(
                f"{which} does not come round as periodic says: from the lower end {chart.lower[axis]:g} of "
                f"parameter {axis} to the upper {chart.upper[axis]:g} it goes from "
                f"{at[worst].round(6).tolist()} to {after[worst].round(6).tolist()}. Give a whole period, in "
                "the unit that the map takes (numpy's cos takes radians: 2 * np.pi, not 360), or leave "
                "periodic out"
            )

    def _beginnings(self, x: Array) -> list[tuple[Any, Chart, Array]]:
        """(rows of x, their chart, parameters) to begin from: the nearest sample, and others near
        that belong to another chart or lie more than three cells of the grid away."""
        if not len(x):
            return []
        _, near = self._tree.query(x, k=min(_NEAREST, len(self._points)))
        near = np.asarray(near).reshape(len(x), -1)
        taken = [near[:, 0]]
        for column in near.T[1:]:
            new = np.ones(len(x), dtype=bool)
            for earlier in taken:
                new &= (earlier < 0) | self._apart(column, np.maximum(earlier, 0))
            taken.append(np.where(new, column, -1))
        order = np.stack(taken, axis=1)
        rank = np.cumsum(order >= 0, axis=1)
        begins = (order >= 0) & (rank <= _BASINS)
        found = []
        for number, chart in enumerate(self._charts):
            rows, column = np.nonzero(begins & (self._owner[np.maximum(order, 0)] == number))
            for turn in range(_BASINS):  # one row at a time in each, so that a row is there once
                mine = rank[rows, column] == turn + 1
                if mine.any():
                    here = rows[mine]
                    found.append((here, chart, self._grid[order[here, column[mine]]]))
        return found

    def _apart(self, a: Any, b: Any) -> Flags:
        same = self._owner[a] == self._owner[b]
        far = np.zeros(len(a), dtype=bool)
        for number, chart in enumerate(self._charts):
            mine = same & (self._owner[a] == number)
            gap = np.abs(self._grid[a[mine]] - self._grid[b[mine]]) / chart.extent
            gap = np.where(chart.wraps, np.minimum(gap, 1 - gap), gap)
            far[mine] = gap.max(axis=1) > 3.5 / self._cells
        return np.asarray(~same | far)

    def _project(self, x: Array) -> tuple[Array, Array, Flags]:
        """The nearest points, tangent bases there, and where both were found."""
        y, found = x.copy(), np.zeros(len(x), dtype=bool)
        bases = np.zeros((len(x), self.ambient_dimension, self.dimension))
        for rows, chart, u in self._beginnings(x):
            there, basis, met = _descend(chart, u, x[rows], self._scale)
            better = met & (~found[rows] | (norms(there - x[rows]) < norms(y[rows] - x[rows])))
            y[rows[better]], bases[rows[better]] = there[better], basis[better]
            found[rows[better]] = True
        return y, bases, found


def _descend(chart: Chart, u: Array, x: Array, scale: float) -> tuple[Array, Array, Flags]:
    """Newton's method on the distance to x as a function on M, from parameters u.

    In an orthonormal frame of the tangent space, so that it does not matter how fast a parameter
    goes; steps are halved until they lead nearer. Where the distance bends the wrong way the step
    goes downhill all the same.
    """
    u = chart.inside(u)
    y, k = chart.points(u), u.shape[1]
    bases = np.zeros((len(u), x.shape[1], k))
    found = np.zeros(len(u), dtype=bool)
    alive = np.ones(len(u), dtype=bool)
    for _ in range(_ITERATIONS):
        rows = np.flatnonzero(alive & ~found)
        if not rows.size:
            break
        r = y[rows] - x[rows]
        q, triangle = np.linalg.qr(chart.jacobian(u[rows]))
        pivots = np.abs(np.diagonal(triangle, axis1=1, axis2=2))
        regular = pivots.min(axis=1) > 1e-9 * np.maximum(pivots.max(axis=1), 1e-300)
        alive[rows[~regular]] = False
        rows, r, q, triangle = rows[regular], r[regular], q[regular], triangle[regular]
        bases[rows] = q
        gradient = apply(transposed(q), r)
        inverse = _inverse(triangle)
        hessian = np.eye(k) + product(product(transposed(inverse), chart.bend(u[rows], r)), inverse)
        bends, vectors = np.linalg.eigh((hessian + transposed(hessian)) / 2)
        bends = np.maximum(np.abs(bends), 0.05)
        v = -apply(vectors, apply(transposed(vectors), gradient) / bends)
        length = norms(v)
        v *= np.minimum(1.0, 0.1 * scale / np.maximum(length, 1e-300))[:, None]
        step = apply(inverse, v)
        done = length <= 1e-11 * scale
        found[rows[done]] = True
        moved = _halve_until_nearer(chart, u, y, x, rows[~done], step[~done], length[~done], scale)
        alive[rows[~done][~moved]] = False
    return y, bases, found


def _inverse(triangles: Array) -> Array:
    """Of upper triangular matrices (n, k, k), by substitution: one k x k system after the other in
    LAPACK takes longer than all of them at once here."""
    inverse = np.zeros_like(triangles)
    for row in reversed(range(triangles.shape[1])):
        inverse[:, row, row] = 1.0
        for later in range(row + 1, triangles.shape[1]):
            inverse[:, row] -= triangles[:, row, later, None] * inverse[:, later]
        inverse[:, row] /= triangles[:, row, row, None]
    return inverse


def _halve_until_nearer(
    chart: Chart, u: Array, y: Array, x: Array, rows: Any, step: Array, length: Array, scale: float
) -> Flags:
    """Moves u and y, in place, by the longest of step, step/2, ... that leads nearer; where."""
    moved = np.zeros(len(rows), dtype=bool)
    left = np.arange(len(rows))
    fraction = 1.0
    for _ in range(30):
        if not left.size:
            break
        mine = rows[left]
        there = chart.inside(u[mine] + fraction * step[left])
        points = chart.points(there)
        before, after = norms(y[mine] - x[mine]), norms(points - x[mine])
        # So near the minimum distances cannot tell better from worse.
        slack = np.where(length[left] <= 1e-5 * scale, 1e-12 * scale, 0.0)
        better = (after < before) | ((slack > 0) & (after <= before + slack))
        better &= (there != u[mine]).any(axis=1)
        u[mine[better]], y[mine[better]] = there[better], points[better]
        moved[left[better]] = True
        left = left[~better]
        fraction /= 2
    return moved


def _lies_along(face: Array, points: Array) -> bool:
    """Whether points are as near to samples of a face as these to each other: it comes round turned over, as
    a Klein bottle's parameter does."""
    if len(face) < 3:
        return False
    tree = tree_of(face)
    apart = np.asarray(tree.query(face, k=2)[0])[:, 1].max()
    return bool((np.asarray(tree.query(points, k=1)[0]).reshape(-1) <= 2 * apart).all())


def _meet(chart: Chart, u: Array, c: Array, bases: Array, scale: float) -> tuple[Array, Flags]:
    """Newton's method for basis^T (X(u) - c) = 0, with steps halved until that falls."""
    u = chart.inside(u)
    y = chart.points(u)
    found, alive = np.zeros(len(u), dtype=bool), np.ones(len(u), dtype=bool)
    for _ in range(_ITERATIONS):
        rows = np.flatnonzero(alive & ~found)
        if not rows.size:
            break
        across = transposed(bases[rows])
        off = apply(across, y[rows] - c[rows])
        found[rows[norms(off) <= 1e-13 * scale]] = True
        system = product(across, chart.jacobian(u[rows]))
        regular = np.abs(np.linalg.det(system)) > 0
        alive[rows[~regular]] = False
        rows, off, system = rows[regular], off[regular], system[regular]
        if not rows.size:
            break
        step = -np.linalg.solve(system, off[..., None])[..., 0]
        left, fraction = np.arange(len(rows)), 1.0
        for _ in range(20):
            mine = rows[left]
            there = chart.inside(u[mine] + fraction * step[left])
            points = chart.points(there)
            size = norms(apply(transposed(bases[mine]), points - c[mine]))
            better = size < norms(off[left])
            u[mine[better]], y[mine[better]] = there[better], points[better]
            left = left[~better]
            fraction /= 2
            if not left.size:
                break
        # What no step lowers is where rounding has the last word, or a local minimum.
        stopped = rows[left]
        found[stopped] = norms(off[left]) <= 1e-11 * scale
        alive[stopped] = False
    return y, found
