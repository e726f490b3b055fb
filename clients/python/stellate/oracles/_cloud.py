"""Manifolds through clouds of points, by moving least squares."""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import numpy as np

from .._rows import Array, Flags, apply, norms, product, transposed
from ..errors import InvalidArgument
from ._common import Projection, as_points, box_around, tree_of

_ITERATIONS = 100
_BLOCK = 2048  # queries at a time, which bounds what their neighbours take


class PointCloud(Projection):
    """An oracle for a smooth k-manifold near given points of R^d, which may be noisy.

    Args:
      points: (n, d). They have to lie on all of the manifold, at distances well below its reach.
      dimension: k.
      bandwidth: how far the neighbours of a place reach; by default twice the distance within
        which nearly all points have 2 k + 3 others. Smoother when larger; sheets have to be farther apart.

    The manifold is where the least-squares quadric through a place's neighbours, weighted by how near
    they are, goes through the place itself. `residual` is how far the points are from the manifold, 95 in
    100 of them: the noise, and what the quadric does not follow. Needs scipy.

    The manifold is a smoothed one. Where the points' noise is s, it lies within about s of the one
    that they were taken from, plus bandwidth^3 times the change of its curvature; an epsilon below
    the bandwidth meshes the smoothing.
    """

    thread_safe = True

    def __init__(self, points: Any, dimension: int, *, bandwidth: float | None = None) -> None:
        self._points = as_points(points, "points")
        n, d = self._points.shape
        if not isinstance(dimension, int) or not 1 <= dimension < d:
            raise InvalidArgument(
                f"dimension has to be a whole number from 1 to {d - 1}: {dimension!r}"
            )
        self.dimension, self.ambient_dimension = dimension, d
        terms = 1 + dimension + dimension * (dimension + 1) // 2
        if n <= 2 * terms:
            raise InvalidArgument(
                f"{n} points are too few: a quadric has {terms} coefficients in each direction"
            )
        self._tree = tree_of(self._points)
        if bandwidth is None:
            some = self._points[:: max(1, n // 2000)]
            away, _ = self._tree.query(some, k=min(n, 2 * dimension + 4))
            bandwidth = 2.0 * float(np.quantile(away[:, -1], 0.95))
        if not (np.isfinite(bandwidth) and bandwidth > 0):
            raise InvalidArgument(f"bandwidth has to be positive, and is {bandwidth!r}")
        self.bandwidth = float(bandwidth)
        self.bounding_box = box_around(self._points, 0.02)
        some = self._points[:: max(1, n // 500)]
        nearest, _, found = self._project(some)
        if not found.any():
            raise InvalidArgument(
                f"no point has enough neighbours within {self.bandwidth:g}: a larger bandwidth?"
            )
        self.residual = float(np.quantile(norms(nearest - some)[found], 0.95))

    def _project(self, x: Array) -> tuple[Array, Array, Flags]:
        parts = [self._project_block(x[i : i + _BLOCK]) for i in range(0, len(x), _BLOCK)]
        if not parts:
            parts = [self._project_block(x)]
        columns = list(zip(*parts))
        return np.concatenate(columns[0]), np.concatenate(columns[1]), np.concatenate(columns[2])

    def _project_block(self, x: Array) -> tuple[Array, Array, Flags]:
        """To where the quadric about a place goes through it, and the way to x is normal to it."""
        y = np.empty_like(x)
        if len(x):
            y = self._points[self._tree.query(x)[1]].copy()
        bases = np.zeros((len(x), self.ambient_dimension, self.dimension))
        alive, found = np.ones(len(x), dtype=bool), np.zeros(len(x), dtype=bool)
        for _ in range(_ITERATIONS):
            rows = np.flatnonzero(alive & ~found)
            if not rows.size:
                break
            quadric, enough = self._quadric(y[rows])
            alive[rows[~enough]] = False
            rows, quadric = rows[enough], quadric.of(enough)
            step = quadric.towards(x[rows])
            longest = 0.5 * self.bandwidth
            step *= (longest / np.maximum(norms(step), longest))[:, None]
            there = quadric.place + step
            found[rows[norms(there - y[rows]) <= 1e-11 * self.bandwidth]] = True
            y[rows], bases[rows] = there, quadric.tangents
        return y, bases, found

    def _neighbours(self, places: Array) -> tuple[Any, Any, Array]:
        """For all pairs: the place's number, the point's, and the weight; places ascend."""
        lists = self._tree.query_ball_point(places, self.bandwidth, return_sorted=True)
        counts = np.fromiter(map(len, lists), dtype=np.intp, count=len(lists))
        points = np.fromiter(itertools.chain.from_iterable(lists), np.intp, count=counts.sum())
        owners = np.repeat(np.arange(len(places)), counts)
        share = norms(self._points[points] - places[owners]) / self.bandwidth
        return owners, points, (1 - share) ** 4 * (4 * share + 1)  # Wendland's, twice smooth

    def _quadric(self, places: Array) -> tuple[_Quadric, Flags]:
        """The least-squares quadric about each place, over the plane through its neighbours, and
        where there are neighbours enough."""
        owners, points, weights = self._neighbours(places)
        count, k = len(places), self.dimension
        first, second = np.triu_indices(k)
        enough = _sums(np.ones_like(weights), owners, count) >= 1 + k + len(first)
        away = (self._points[points] - places[owners]) / self.bandwidth
        weighted = weights[:, None] * away
        total = np.maximum(_sums(weights, owners, count), 1e-300)
        middle = _sums(weighted, owners, count) / total[:, None]
        spread = _sums(weighted[:, :, None] * away[:, None, :], owners, count)
        spread -= total[:, None, None] * middle[:, :, None] * middle[:, None, :]
        _, vectors = np.linalg.eigh(spread)
        along, across = vectors[:, :, -k:], vectors[:, :, :-k]
        s = apply(transposed(along)[owners], away)
        heights = apply(transposed(across)[owners], away)
        terms = np.concatenate([np.ones((len(s), 1)), s, s[:, first] * s[:, second]], axis=1)
        weighted = weights[:, None] * terms
        system = _sums(weighted[:, :, None] * terms[:, None, :], owners, count)
        right = _sums(weighted[:, :, None] * heights[:, None, :], owners, count)
        # Neighbours that all but determine no quadric: a flat one is preferred, by a share of the
        # weights that is far below what noise does.
        system += (1e-10 * total[:, None, None] + 1e-300) * np.eye(terms.shape[1])
        solution = np.linalg.solve(system, right)
        bend = np.empty((count, k, k, across.shape[2]))
        bend[:, first, second] = bend[:, second, first] = solution[:, 1 + k :]
        bend[:, np.arange(k), np.arange(k)] *= 2
        tangents, _ = np.linalg.qr(along + product(across, transposed(solution[:, 1 : 1 + k])))
        place = places + self.bandwidth * apply(across, solution[:, 0])
        return _Quadric(place, tangents, along, across, bend / self.bandwidth), enough


class _Quadric(NamedTuple):
    """Surfaces of second order over planes, each at one place of its own."""

    place: Array  # (n, d), on it
    tangents: Array  # (n, d, k), there
    along: Array  # (n, d, k), the plane
    across: Array  # (n, d, d - k)
    bend: Array  # (n, k, k, d - k), second derivatives of the heights across, over the plane

    def of(self, rows: Flags) -> _Quadric:
        return _Quadric(*(column[rows] for column in self))

    def towards(self, x: Array) -> Array:
        """The tangent step towards the point nearest to x: Newton's, downhill in any case."""
        gap = x - self.place
        turn = product(transposed(self.along), self.tangents)
        wish = apply(turn, apply(transposed(self.tangents), gap))
        above = apply(transposed(self.across), gap)
        k = self.along.shape[2]
        hessian = np.eye(k) - (self.bend * above[:, None, None, :]).sum(axis=3)
        bends, vectors = np.linalg.eigh(hessian)
        wish = apply(vectors, apply(transposed(vectors), wish) / np.maximum(np.abs(bends), 0.2))
        return apply(self.tangents, apply(transposed(turn), wish))


def _sums(values: Array, owners: Any, count: int) -> Array:
    """Of each owner's rows, in their order, so that a row's neighbours in the batch do not matter."""
    result = np.zeros((count, *values.shape[1:]))
    starts = np.flatnonzero(np.diff(owners, prepend=-1))
    if len(owners):
        result[owners[starts]] = np.add.reduceat(values, starts, axis=0)
    return result
