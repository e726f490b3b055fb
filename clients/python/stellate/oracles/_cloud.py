"""Manifolds through clouds of points, by moving least squares."""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import numpy as np

from .._point_sets import as_points, column_names, tree_of
from .._points import DIMENSION_IS_MISSING
from .._rows import Array, Flags, apply, norms, product, transposed
from ..errors import InvalidArgument
from ._bandwidth import Fits, by_density, insist_on_flatness, noise_aware
from ._common import Projection, box_around

_ITERATIONS = 100
_SHORTEST_MOVE = 1e-11  # a step, in bandwidths
_ROUNDINGS = 8 * float(np.finfo(float).eps)  # a step, in coordinates
_LOOKS = 400  # points at which fits are looked at, for how far neighbours should reach
_BLOCK = 2048  # queries at a time, which bounds what their neighbours take


class PointCloud(Projection):
    """An oracle for a smooth k-manifold near given points of R^d, which may be noisy.

    Args:
      points: (n, d). They have to lie on all of the manifold, at distances well below its reach.
      dimension: required, k.
      bandwidth: how far points are neighbours of a place. By default each point has one of its own:
        twice the distance within which it and those about it have 2 k + 3 others, or what it takes
        for noise to add no more than a tenth to the curvature. Smoother when larger; sheets have to
        be farther apart. repr() tells what it is.

    The manifold is where the least-squares quadric through a place's neighbours, weighted by how near
    they are, goes through the place itself. `residual` is how far the points are from the manifold, 95 in
    100 of them: the noise, and what the quadric does not follow. `bandwidths` (n,) are the points' own,
    `bandwidth` their median. Needs scipy.

    The manifold is a smoothed one. Where the points' noise is s, it lies within about s of the one
    that they were taken from, plus bandwidth^3 times the change of its curvature; an epsilon below
    the bandwidth meshes the smoothing.
    """

    thread_safe = True

    def __init__(
        self, points: Any, dimension: int | None = None, *, bandwidth: float | None = None
    ) -> None:
        self._points, self.coordinate_names = as_points(points, "points"), column_names(points)
        n, d = self._points.shape
        if dimension is None:
            raise TypeError(DIMENSION_IS_MISSING)
        if not isinstance(dimension, int) or not 1 <= dimension < d:
            raise InvalidArgument(
                f"dimension has to be a whole number from 1 to {d - 1}: {dimension!r}"
            )
        self.dimension, self.ambient_dimension = dimension, d
        terms = 1 + dimension + dimension * (dimension + 1) // 2
        distinct, which = np.unique(self._points, axis=0, return_inverse=True)
        if len(distinct) <= 2 * terms:
            raise InvalidArgument(
                f"{len(distinct)} different points are too few, at least {2 * terms + 1} are needed: a "
                f"quadric has {terms} coefficients in each direction"
                + (f". A row is a point: of {d} points as columns give points.T" if n < d else "")
            )
        self._tree = tree_of(self._points)
        if bandwidth is None:
            insist_on_flatness(distinct, dimension)
            some = self._points[:: max(1, n // _LOOKS)]
            self._reach(by_density(distinct, which.reshape(-1), dimension))
            self._reach(
                noise_aware(self.bandwidths, dimension, lambda w: self._reach(w)._fits(some))
            )
        elif not (np.isfinite(bandwidth) and bandwidth > 0):
            raise InvalidArgument(f"bandwidth has to be positive, and is {bandwidth!r}")
        else:
            self._reach(np.full(n, float(bandwidth)))
        self.bounding_box = box_around(self._points, 0.02)
        some = self._points[:: max(1, n // 500)]
        nearest, _, found = self._project(some)
        if not found.any():
            raise InvalidArgument(
                f"no point has enough neighbours within {self.bandwidth:g}: a larger bandwidth?"
            )
        self.residual = float(np.quantile(norms(nearest - some)[found], 0.95))

    @property
    def about(self) -> str:
        """What it was fitted with, for the mesh's verdict."""
        return repr(self)

    def __repr__(self) -> str:
        low, high = float(self.bandwidths.min()), float(self.bandwidths.max())
        local = f" ({low:.3g} to {high:.3g})" if low < high else ""
        return (
            f"{type(self).__name__}({len(self._points):,} points of R^{self.ambient_dimension}, dimension "
            f"{self.dimension}, bandwidth {self.bandwidth:.3g}{local}, residual {self.residual:.2g})"
        )

    def _reach(self, bandwidths: Array) -> PointCloud:
        """Gives the points bandwidths, and each octave of these a tree of its own, to search as far."""
        self.bandwidths, self.bandwidth = bandwidths, float(np.median(bandwidths))
        octave = np.floor(2 * np.log2(bandwidths / bandwidths.min()))
        self._octaves = []
        for one in np.unique(octave):
            members = np.flatnonzero(octave == one)
            reach = float(bandwidths[members].max())
            self._octaves.append((members, tree_of(self._points[members]), reach))
        return self

    def _project(self, x: Array) -> tuple[Array, Array, Flags]:
        parts = [self._project_block(x[i : i + _BLOCK]) for i in range(0, len(x), _BLOCK)]
        if not parts:
            parts = [self._project_block(x)]
        columns = list(zip(*parts))
        return np.concatenate(columns[0]), np.concatenate(columns[1]), np.concatenate(columns[2])

    def _project_block(self, x: Array) -> tuple[Array, Array, Flags]:
        """To where the quadric about a place goes through it, and the way to x is normal to it."""
        y, reach = np.empty_like(x), np.empty(len(x))
        if len(x):
            nearest = self._tree.query(x)[1]
            y, reach = self._points[nearest].copy(), self.bandwidths[nearest]
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
            longest = 0.5 * reach[rows]
            step *= (longest / np.maximum(norms(step), longest))[:, None]
            there = quadric.place + step
            # Far from the origin, as maps have them, coordinates are rounded more coarsely than that.
            rounded = _ROUNDINGS * np.abs(there).max(axis=1)
            arrived = np.maximum(_SHORTEST_MOVE * reach[rows], rounded)
            found[rows[norms(there - y[rows]) <= arrived]] = True
            y[rows], bases[rows] = there, quadric.tangents
        return y, bases, found

    def _neighbours(self, places: Array) -> tuple[Any, Any, Array]:
        """For all pairs: the place's number, the point's, and the weight; places ascend."""
        owners, points = [], []
        for members, tree, reach in self._octaves:
            lists = tree.query_ball_point(places, reach, return_sorted=True)
            counts = np.fromiter(map(len, lists), dtype=np.intp, count=len(lists))
            near = np.fromiter(itertools.chain.from_iterable(lists), np.intp, count=counts.sum())
            owners.append(np.repeat(np.arange(len(places)), counts))
            points.append(members[near])
        owner, point = np.concatenate(owners), np.concatenate(points)
        share = norms(self._points[point] - places[owner]) / self.bandwidths[point]
        order = np.lexsort((point, owner))
        order = order[share[order] < 1]
        u = 1 - share[order]
        u2 = u * u
        return owner[order], point[order], u2 * u2 * (5 - 4 * u)  # Wendland's, twice smooth

    def _fits(self, some: Array) -> Fits:
        """What the quadrics at some of the points are like."""
        fit = self._fit(some)
        k, terms = self.dimension, fit.terms
        off = fit.heights - apply(transposed(fit.solution)[fit.owners], terms)
        squares = _sums(fit.weights[:, None] * off * off, fit.owners, len(some)).sum(axis=1)
        twice = (fit.weights * fit.weights)[:, None, None] * terms[:, :, None] * terms[:, None, :]
        inverse = np.linalg.inv(fit.system)
        errors = product(product(inverse, _sums(twice, fit.owners, len(some))), inverse)
        total = np.maximum(_sums(fit.weights, fit.owners, len(some)), 1e-300)
        # As many neighbours as the weights are worth, less the quadric's own freedom.
        worth = total**2 / _sums(fit.weights * fit.weights, fit.owners, len(some))
        free = np.maximum(1 - terms.shape[1] / np.maximum(worth, 1.0), 0.1)
        noise = np.sqrt(squares / total / free / (self.ambient_dimension - k))
        bend = np.sqrt((fit.solution[:, 1 + k :] ** 2).sum(axis=(1, 2)))
        pure = np.diagonal(errors, axis1=1, axis2=2)[:, 1 + k :].sum(axis=1)
        pure = pure * (self.ambient_dimension - k)
        usable = fit.enough & np.isfinite(pure)
        return Fits(
            (2 * bend / fit.scale)[usable],
            (2 * noise * np.sqrt(np.maximum(pure, 0)) / fit.scale)[usable],
        )

    def _fit(self, places: Array) -> _Fit:
        """The least-squares quadric about each place, over the plane through its neighbours."""
        owners, points, weights = self._neighbours(places)
        count, k = len(places), self.dimension
        first, second = np.triu_indices(k)
        enough = _sums(np.ones_like(weights), owners, count) >= 1 + k + len(first)
        total = np.maximum(_sums(weights, owners, count), 1e-300)
        scale = _sums(weights * self.bandwidths[points], owners, count) / total
        scale = np.where(scale > 0, scale, self.bandwidth)  # where there are no neighbours
        away = (self._points[points] - places[owners]) / scale[owners][:, None]
        weighted = weights[:, None] * away
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
        return _Fit(owners, weights, terms, heights, system, solution, along, across, scale, enough)

    def _quadric(self, places: Array) -> tuple[_Quadric, Flags]:
        """The quadric about each place, and where there are neighbours enough for it."""
        fit, k = self._fit(places), self.dimension
        first, second = np.triu_indices(k)
        bend = np.empty((len(places), k, k, fit.across.shape[2]))
        bend[:, first, second] = bend[:, second, first] = fit.solution[:, 1 + k :]
        bend[:, np.arange(k), np.arange(k)] *= 2
        slopes = transposed(fit.solution[:, 1 : 1 + k])
        tangents, _ = np.linalg.qr(fit.along + product(fit.across, slopes))
        place = places + fit.scale[:, None] * apply(fit.across, fit.solution[:, 0])
        bend /= fit.scale[:, None, None, None]
        return _Quadric(place, tangents, fit.along, fit.across, bend), fit.enough


class _Fit(NamedTuple):
    """Least squares about places: of pairs with their neighbours (m,), and of the places (n,)."""

    owners: Any  # (m,), the place's number
    weights: Array  # (m,)
    terms: Array  # (m, t), of a quadric, in lengths of `scale`
    heights: Array  # (m, d - k), over the plane
    system: Array  # (n, t, t)
    solution: Array  # (n, t, d - k)
    along: Array  # (n, d, k), the plane
    across: Array  # (n, d, d - k)
    scale: Array  # (n,), the length of the neighbours' bandwidths
    enough: Flags  # (n,), where neighbours determine a quadric


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
