"""Quotients of manifolds, by functions that embed them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .._functions import Exactness, UserFunction
from .._lowest import descend
from .._point_sets import tree_of
from .._rows import Array, Flags, apply, norms, product, transposed
from ..errors import InvalidArgument
from ..oracle import CheckedOracle
from ._common import about_of, all_or_raise, box_around, refuse_walls

_SAMPLES = 20_000  # of the manifold, to begin from
_NEAREST = 8  # of them looked at for each query
_BASINS = 3  # the most of these that begin a search
_FIRST_STEP = 6e-6  # of first differences, in shares of N's size: about the cube root of rounding
_STEP = 1e-4  # of second differences: about its fourth root
_ITERATIONS = 100
_LOOKS, _DESCENTS = 2000, 24  # samples looked at for where f is no immersion, and gone on from
_FLAT = 1e-4  # of what f stretches by usually, which leaves nothing of it

Map = Callable[[Array], Any]


class Quotient:
    """The image f(N) of a manifold N under a smooth map that takes two points to one exactly where they
    are the same in the quotient, and is an immersion: N / ~, embedded.

    Args:
      oracle: of N in R^m, with tangent bases and a bounding box.
      f: (n, m) -> (n, d): invariants of the group or the relation, enough to tell all orbits apart.
      derivative: (n, m) -> (n, d, m), or None: differences of f.

    RP^n is the sphere under x -> (x_i x_j); a lens space the sphere of C^2 under the monomials that a
    rotation of it leaves alone; a Klein bottle a torus. A closest point is sought by Newton's method on
    N from the nearest of some 20,000 of its points. Needs scipy.
    """

    def __init__(self, oracle: Any, f: Map, derivative: Map | None = None) -> None:
        self._base = CheckedOracle(oracle)
        refuse_walls(self._base, "a quotient")
        if not self._base.has_tangent_basis:
            raise InvalidArgument(f"a quotient of {type(oracle).__name__} needs its tangent_basis")
        if self._base.bounding_box is None:
            raise InvalidArgument(f"a quotient of {type(oracle).__name__} needs its bounding_box")
        if not callable(f) or not (derivative is None or callable(derivative)):
            raise InvalidArgument("a quotient needs a function f, and one or None as derivative")
        m = len(self._base.bounding_box[0])
        self._values = UserFunction(f, "a quotient's f", ("d",), str(m))
        self.dimension = self._base.dimension
        self.about = about_of(self._base)
        self.thread_safe = False
        lower, upper = self._base.bounding_box
        self._length = float(norms(upper - lower))  # of N
        shares = np.random.default_rng(1).random((_SAMPLES, len(lower)))
        near, found = self._base.closest_points(lower + shares * (upper - lower))
        if not found.any():
            raise InvalidArgument("no point of the manifold was found in its bounding_box")
        self._samples = near[found]
        self._images = self._values(self._samples)
        self.ambient_dimension = d = self._images.shape[1]
        self._derivative = None
        if derivative is not None:
            self._derivative = UserFunction(derivative, "a quotient's derivative", (d, m), str(m))
        Exactness(self._samples, lower, upper).insist(self._values)
        if self.dimension >= self.ambient_dimension:
            raise InvalidArgument(
                f"a manifold of dimension {self.dimension} does not embed in "
                f"R^{self.ambient_dimension}"
            )
        self._scale = float(norms(np.ptp(self._images, axis=0)))
        self._insist_on_immersion()
        self._tree = tree_of(self._images)
        gaps, _ = self._tree.query(self._images[:: max(1, len(near) // 1000)], k=_NEAREST)
        self._apart = 2 * float(np.max(gaps[:, -1]))  # farther samples are of other places
        self.bounding_box = box_around(self._images, 0.05)

    def closest_point(self, points: Array) -> Array:
        """(n, d) -> (n, d). Raises: NotConverged, with what was found."""
        y, _, found = self._closest(np.asarray(points, dtype=np.float64))
        return all_or_raise(y, found)

    def tangent_basis(self, points: Array) -> Array:
        """(n, d) -> (n, d, k), at points of the quotient."""
        _, bases, found = self._closest(np.asarray(points, dtype=np.float64))
        bases[~found] = np.eye(self.ambient_dimension, self.dimension)
        return bases

    def _closest(self, x: Array) -> tuple[Array, Array, Flags]:
        y, found = x.copy(), np.zeros(len(x), dtype=bool)
        bases = np.zeros((len(x), self.ambient_dimension, self.dimension))
        for rows, u in self._beginnings(x):
            there, basis, met = self._descend(u, x[rows])
            better = met & (~found[rows] | (norms(there - x[rows]) < norms(y[rows] - x[rows])))
            y[rows[better]], bases[rows[better]] = there[better], basis[better]
            found[rows[better]] = True
        return y, bases, found

    def _beginnings(self, x: Array) -> list[tuple[Any, Array]]:
        """(rows of x, points of N) to begin from: the nearest sample, and others near that lie apart."""
        if not len(x):
            return []
        _, near = self._tree.query(x, k=min(_NEAREST, len(self._images)))
        near = np.asarray(near).reshape(len(x), -1)
        taken = [near[:, 0]]
        for column in near.T[1:]:
            new = np.ones(len(x), dtype=bool)
            for earlier in taken:
                gap = norms(self._images[column] - self._images[np.maximum(earlier, 0)])
                new &= (earlier < 0) | (gap > self._apart)
            taken.append(np.where(new, column, -1))
        order = np.stack(taken, axis=1)
        rank = np.cumsum(order >= 0, axis=1)
        turns = []
        for turn in range(1, _BASINS + 1):
            rows, column = np.nonzero((order >= 0) & (rank == turn))
            if rows.size:
                turns.append((rows, self._samples[order[rows, column]]))
        return turns

    def _descend(self, u: Array, x: Array) -> tuple[Array, Array, Flags]:
        """Newton's method on the distance to x as a function on the image, from f(u): in an
        orthonormal frame of its tangent space, with steps halved until they lead nearer."""
        k, count = self.dimension, len(u)
        u, y = u.copy(), self._values(u)
        bases = np.zeros((count, self.ambient_dimension, k))
        found, alive = np.zeros(count, dtype=bool), np.ones(count, dtype=bool)
        for _ in range(_ITERATIONS):
            rows = np.flatnonzero(alive & ~found)
            if not rows.size:
                break
            frames = self._frames(u[rows])
            slopes = self._slopes(u[rows], frames)
            q, triangle = np.linalg.qr(slopes)
            pivots = np.abs(np.diagonal(triangle, axis1=1, axis2=2))
            regular = pivots.min(axis=1) > 1e-9 * np.maximum(pivots.max(axis=1), 1e-300)
            alive[rows[~regular]] = False
            rows, frames, q, triangle = (
                rows[regular],
                frames[regular],
                q[regular],
                triangle[regular],
            )
            bases[rows] = q
            r = y[rows] - x[rows]
            inverse = np.linalg.inv(triangle)
            bend = product(product(transposed(inverse), self._bend(u[rows], frames, r)), inverse)
            bends, vectors = np.linalg.eigh(np.eye(k) + (bend + transposed(bend)) / 2)
            wish = apply(transposed(vectors), apply(transposed(q), r))
            v = -apply(vectors, wish / np.maximum(np.abs(bends), 0.05))
            length = norms(v)
            done = length <= 1e-10 * self._scale
            found[rows[done]] = True
            v *= np.minimum(1.0, 0.1 * self._scale / np.maximum(length, 1e-300))[:, None]
            step = apply(frames, apply(inverse, v))
            moved = self._halve_until_nearer(u, y, x, rows[~done], step[~done], length[~done])
            alive[rows[~done][~moved]] = False
        return y, bases, found

    def _halve_until_nearer(
        self, u: Array, y: Array, x: Array, rows: Any, step: Array, length: Array
    ) -> Flags:
        """Moves u and y, in place, by the longest of step, step/2, ... that leads nearer; where."""
        moved = np.zeros(len(rows), dtype=bool)
        left, fraction = np.arange(len(rows)), 1.0
        for _ in range(30):
            if not left.size:
                break
            mine = rows[left]
            there, landed = self._base.closest_points(u[mine] + fraction * step[left])
            points = self._values(there)
            before, after = norms(y[mine] - x[mine]), norms(points - x[mine])
            # So near the minimum distances cannot tell better from worse.
            slack = np.where(length[left] <= 1e-5 * self._scale, 1e-12 * self._scale, 0.0)
            better = landed & ((after < before) | ((slack > 0) & (after <= before + slack)))
            u[mine[better]], y[mine[better]] = there[better], points[better]
            moved[left[better]] = True
            left = left[~better]
            fraction /= 2
        return moved

    def _frames(self, u: Array) -> Array:
        """Orthonormal bases (n, m, k) of N's tangent spaces."""
        return self._base.tangents(np.ascontiguousarray(u), np.ones(len(u), dtype=bool))

    def _slopes(self, u: Array, frames: Array) -> Array:
        """f's derivative along the frames, (n, d, k)."""
        if self._derivative is not None:
            return product(self._derivative(u), frames)
        h = _FIRST_STEP * self._length
        columns = [
            (self._values(u + h * frames[:, :, a]) - self._values(u - h * frames[:, :, a]))
            / (2 * h)
            for a in range(self.dimension)
        ]
        return np.stack(columns, axis=2)

    def _bend(self, u: Array, frames: Array, r: Array) -> Array:
        """The second derivative of r . f along N in the frames, (n, k, k)."""
        k, h = self.dimension, _STEP * self._length
        here = (self._values(u) * r).sum(axis=1)

        def second(v: Array) -> Array:
            total = -2 * here
            for side in (u + v, u - v):
                total = total + (self._values(self._base.closest_points(side)[0]) * r).sum(axis=1)
            return np.asarray(total / (h * h))

        bend = np.empty((len(u), k, k))
        for a in range(k):
            bend[:, a, a] = second(h * frames[:, :, a])
        for a in range(k):
            for b in range(a):
                plus = second(h * (frames[:, :, a] + frames[:, :, b]))
                minus = second(h * (frames[:, :, a] - frames[:, :, b]))
                bend[:, a, b] = bend[:, b, a] = (plus - minus) / 4
        return bend

    def _insist_on_immersion(self) -> None:
        """Looks for the direction that f changes least, and follows it down. Raises: InvalidArgument."""
        some = self._samples[:: max(1, len(self._samples) // _LOOKS)]
        usual = float(np.median(self._stretches(some, 0)))
        lowest = np.argsort(self._stretches(some, -1), kind="stable")[:_DESCENTS]

        def least(u: Array) -> Array:
            return self._stretches(u, -1)

        places, sizes = descend(
            some[lowest], least, self._base.closest_points, self._frames, self._length
        )
        worst = int(np.argmin(sizes))
        if not sizes[worst] > _FLAT * usual:
            place = places[worst : worst + 1]
            raise InvalidArgument(
                f"f is not an immersion near {place[0].round(6).tolist()} of the manifold, which it takes "
                f"to {self._values(place)[0].round(6).tolist()}: it does not change in some direction "
                "there, so that its image has a fold, a tip or an end. A quotient by a reflection, or by "
                "anything with fixed points, is no manifold"
            )

    def _stretches(self, u: Array, which: int) -> Array:
        """(n, m) -> (n,): how f stretches N most, by 0, or least, by -1."""
        slopes = self._slopes(u, self._frames(u))
        return np.asarray(np.linalg.svd(slopes, compute_uv=False)[:, which])
