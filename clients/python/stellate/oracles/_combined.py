"""Manifolds made of others: products, images under similarities, level sets on a manifold."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .._functions import Exactness, UserFunction
from .._rows import Array, Flags, apply, norms, product, transposed
from ..errors import InvalidArgument
from ..oracle import CheckedOracle
from ._common import about_of, all_or_raise, refuse_walls


class Product:
    """The product of manifolds A x B x ... in R^(a + b + ...), points one after the other.

    Has tangent bases and local sizes if all of its factors have.
    """

    def __init__(self, *factors: Any) -> None:
        if len(factors) < 2:
            raise InvalidArgument(f"a product needs two factors at least, and has {len(factors)}")
        self._factors = [CheckedOracle(factor) for factor in factors]
        for factor in self._factors:
            refuse_walls(factor, "a product")
        ends = np.cumsum([factor.ambient_dimension for factor in self._factors])
        self._parts = [slice(b - f.ambient_dimension, b) for b, f in zip(ends, self._factors)]
        self.about = about_of(*self._factors)
        self.dimension = sum(factor.dimension for factor in self._factors)
        self.ambient_dimension = int(ends[-1])
        self.thread_safe = all(getattr(factor, "thread_safe", False) for factor in factors)
        boxes = [factor.bounding_box for factor in self._factors]
        if all(box is not None for box in boxes):
            corners = [np.concatenate([box[i] for box in boxes if box]) for i in (0, 1)]
            self.bounding_box = corners[0], corners[1]
        seeds = [self._seeds_of(factor) for factor in self._factors]
        if all(some is not None for some in seeds) and any(
            f.seeds is not None for f in self._factors
        ):
            grid = np.meshgrid(*[np.arange(len(some)) for some in seeds if some is not None])
            chosen = zip(seeds, (axis.reshape(-1) for axis in grid))
            self.seeds = np.concatenate([some[i] for some, i in chosen if some is not None], axis=1)
        if all(factor.has_tangent_basis for factor in self._factors):
            self.tangent_basis = self._tangent_basis
        if all(factor.has_local_size for factor in self._factors):
            self.local_size = self._local_size

    def closest_point(self, points: Array) -> Array:
        """(n, d) -> (n, d), factor by factor. Raises: NotConverged, with what was found."""
        nearest = np.empty_like(points, dtype=np.float64)
        found = np.ones(len(points), dtype=bool)
        for factor, part in zip(self._factors, self._parts):
            nearest[:, part], here = factor.closest_points(np.ascontiguousarray(points[:, part]))
            found &= here
        return all_or_raise(nearest, found)

    def _tangent_basis(self, points: Array) -> Array:
        bases = np.zeros((len(points), self.ambient_dimension, self.dimension))
        column = 0
        for factor, part in zip(self._factors, self._parts):
            columns = slice(column, column + factor.dimension)
            here = np.ascontiguousarray(points[:, part])
            bases[:, part, columns] = factor.tangents(here, np.ones(len(points), dtype=bool))
            column += factor.dimension
        return bases

    def _local_size(self, points: Array) -> Array:
        everywhere = np.ones(len(points), dtype=bool)
        sizes = [
            factor.sizes(np.ascontiguousarray(points[:, part]), everywhere)
            for factor, part in zip(self._factors, self._parts)
        ]
        return np.minimum.reduce(sizes)

    @staticmethod
    def _seeds_of(factor: CheckedOracle) -> Array | None:
        if factor.seeds is not None:
            return np.asarray(factor.seeds)
        if factor.bounding_box is None:
            return None
        lower, upper = factor.bounding_box
        return np.asarray((lower + upper) / 2 + (upper - lower) * 0.37 * np.eye(len(lower))[:1])


class Transformed:
    """The image of a manifold under x -> scale * rotation x + translation.

    Args:
      oracle: of the manifold, in R^d.
      rotation: (D, d) with orthonormal columns, D >= d; the identity if left out. D > d puts the
        manifold into a space of more dimensions.
      scale: a positive factor.
      translation: (D,).
    """

    def __init__(
        self,
        oracle: Any,
        *,
        rotation: Any = None,
        scale: float = 1.0,
        translation: Any = None,
    ) -> None:
        self._inner = CheckedOracle(oracle)
        refuse_walls(self._inner, "Transformed")
        d = self._inner.ambient_dimension
        turn = np.eye(d) if rotation is None else np.array(rotation, dtype=np.float64)
        if turn.ndim != 2 or turn.shape[1] != d or turn.shape[0] < d:
            raise InvalidArgument(
                f"rotation has shape {turn.shape}; it has to be (D, {d}), D >= {d}"
            )
        if not np.allclose(turn.T @ turn, np.eye(d), rtol=0, atol=1e-9):
            raise InvalidArgument(
                "rotation has to have orthonormal columns; np.linalg.qr makes them"
            )
        shift = np.zeros(len(turn)) if translation is None else np.array(translation, dtype=float)
        if shift.shape != (len(turn),) or not np.isfinite(shift).all():
            raise InvalidArgument(
                f"translation has to be {len(turn)} finite numbers: {translation}"
            )
        if np.ndim(scale):
            raise InvalidArgument(
                f"scale has to be one number, and is {scale!r}: of a similarity. Axes of different units have "
                "stellate.mesh(oracle, epsilon, scale=)"
            )
        if not (np.isfinite(scale) and scale > 0):
            raise InvalidArgument(f"scale has to be positive, and is {scale!r}")
        self._turn, self._scale, self._shift = turn, float(scale), shift
        self.about = about_of(self._inner)
        if self.about and scale != 1:
            self.about += f", scaled by {scale:.6g}"  # lengths in it are those of before
        self.dimension, self.ambient_dimension = self._inner.dimension, len(turn)
        self.thread_safe = bool(getattr(oracle, "thread_safe", False))
        if self._inner.bounding_box is not None:
            # The box about the turned box.
            lower, upper = self._inner.bounding_box
            middle = self._forth(((lower + upper) / 2)[None, :])[0]
            half = self._scale * (np.abs(turn) * ((upper - lower) / 2)).sum(axis=1)
            half = np.maximum(half, 1e-3 * half.max())  # thin across the space that M lies in
            self.bounding_box = middle - half, middle + half
        if self._inner.seeds is not None:
            self.seeds = self._forth(np.asarray(self._inner.seeds))
        if self._inner.has_tangent_basis:
            self.tangent_basis = self._tangent_basis
        if self._inner.has_local_size:
            self.local_size = self._local_size
        if self._inner.has_intersect_flat and turn.shape[0] == turn.shape[1]:
            self.intersect_flat = self._intersect_flat

    def closest_point(self, points: Array) -> Array:
        """(n, D) -> (n, D). Raises: NotConverged, with what was found."""
        nearest, found = self._inner.closest_points(self._back(points))
        return all_or_raise(self._forth(nearest), found)

    def _tangent_basis(self, points: Array) -> Array:
        everywhere = np.ones(len(points), dtype=bool)
        bases = self._inner.tangents(self._back(points), everywhere)
        return np.stack([self._turned(bases[:, :, a]) for a in range(self.dimension)], axis=2)

    def _local_size(self, points: Array) -> Array:
        everywhere = np.ones(len(points), dtype=bool)
        return np.asarray(self._scale * self._inner.sizes(self._back(points), everywhere))

    def _intersect_flat(self, centers: Array, bases: Array, radii: Array) -> tuple[Array, Flags]:
        inner = np.stack(
            [_times(bases[:, :, a], self._turn.T) for a in range(bases.shape[2])], axis=2
        )
        there, found = self._inner.intersections(self._back(centers), inner, radii / self._scale)
        return self._forth(there), found

    # Sums of a row alone: a product of matrices may round by how many rows there are.
    def _turned(self, vectors: Array) -> Array:
        return _times(vectors, self._turn)

    def _forth(self, points: Array) -> Array:
        return np.asarray(self._scale * self._turned(points) + self._shift)

    def _back(self, points: Array) -> Array:
        return np.asarray(_times(points - self._shift, self._turn.T) / self._scale)


def _times(vectors: Array, matrix: Array) -> Array:
    """Each row v as matrix v."""
    return np.ascontiguousarray((vectors[:, None, :] * matrix).sum(axis=2))


class LevelSet:
    """{x in M : f(x) = 0}, of a manifold M with tangent bases and a smooth f: R^d -> R^m.

    f's derivative along M has to have rank m where f is zero. The set has dimension k - m.

    Args:
      oracle: of M.
      f: (n, d) -> (n, m), or (n,) for m = 1.
      gradient: (n, d) -> (n, m, d), or (n, d) for m = 1; None: differences of f.
      seeds: (s, d) points near the set, where M's box or seeds are not to be gone by.
    """

    _least_dimension = 1

    def __init__(
        self,
        oracle: Any,
        f: Callable[[Array], Any],
        gradient: Callable[[Array], Any] | None = None,
        *,
        seeds: Any = None,
        max_iterations: int = 200,
    ) -> None:
        self._base = CheckedOracle(oracle)
        refuse_walls(self._base, "a level set")
        if not self._base.has_tangent_basis:
            raise InvalidArgument(f"a level set on {type(oracle).__name__} needs its tangent_basis")
        if not callable(f) or not (gradient is None or callable(gradient)):
            raise InvalidArgument(
                "a level set needs a function f, and a function or None as gradient"
            )
        self.ambient_dimension = d = self._base.ambient_dimension
        self.about = about_of(self._base)
        if callable(getattr(oracle, "coordinates", None)):
            self.coordinates = oracle.coordinates
        self._values, self._gradient = UserFunction(f, "f", ("m",), str(d)), None
        if gradient is not None:
            self._gradient = UserFunction(gradient, "gradient", ("m", d), str(d))
        self._max_iterations = max_iterations
        box, given = self._base.bounding_box, self._base.seeds
        starts = self._starts(box, given)
        self._scale = float(norms(np.ptp(starts, axis=0)))
        near, found = self._base.closest_points(starts)
        if not found.any():
            raise InvalidArgument("no point of M was found, to look for the level set from")
        self._count = self._values(near[found][:1]).shape[1]
        Exactness(near[found], starts.min(axis=0), starts.max(axis=0)).insist(self._values)
        self.dimension = self._base.dimension - self._count
        if self.dimension < self._least_dimension:
            raise InvalidArgument(
                f"{self._count} equations on a manifold of dimension {self._base.dimension} leave none"
            )
        if seeds is not None:
            self.seeds = np.array(seeds, dtype=np.float64)
        elif given is not None:
            self.seeds = given
        else:
            self.bounding_box = box

    def closest_point(self, points: Array) -> Array:
        """(n, d) -> (n, d): nearest points of the set. Raises: NotConverged, with what was found."""
        return all_or_raise(*self.find(np.asarray(points, dtype=np.float64)))

    def find(self, x: Array) -> tuple[Array, Flags]:
        """(n, d) -> nearest points of the set (n, d), and where they were found.

        Down to the level and along it towards x, in M's tangent space, and back to M, again and
        again; a step is halved while it oversteps.
        """
        y, alive = self._base.closest_points(np.ascontiguousarray(x))
        y, found = y.copy(), np.zeros(len(x), dtype=bool)
        damping, last = np.ones(len(x)), np.full(len(x), np.inf)
        for _ in range(self._max_iterations):
            rows = np.flatnonzero(alive & ~found)
            if not rows.size:
                break
            here = np.ascontiguousarray(y[rows])
            bases = self._base.tangents(here, np.ones(len(rows), dtype=bool))
            slopes = product(self._slopes(here), bases)  # (n, m, k)
            down, along = self._steps(
                slopes, self._values(here), apply(transposed(bases), x[rows] - here)
            )
            length = norms(down) + norms(along)
            # Longer than the last: the surface bends so that the step went too far.
            damping[rows[length > 0.9 * last[rows]]] *= 0.5
            last[rows] = length
            found[rows[length <= 1e-10 * self._scale]] = True
            usable = np.isfinite(length) & (damping[rows] > 1e-3)
            alive[rows[~usable]] = False
            if not usable.any():
                continue
            rows, v = rows[usable], (down + damping[rows][:, None] * along)[usable]
            longest = 0.1 * self._scale
            v *= (longest / np.maximum(norms(v), longest))[:, None]
            there = y[rows] + apply(bases[usable], v)
            y[rows], landed = self._base.closest_points(np.ascontiguousarray(there))
            alive[rows[~landed]] = False
        return y, found

    def tangent_basis(self, points: Array) -> Array:
        """(n, d) -> (n, d, k - m): the directions of M along which f does not change."""
        points = np.ascontiguousarray(points, dtype=np.float64)
        bases = self._base.tangents(points, np.ones(len(points), dtype=bool))
        _, _, directions = np.linalg.svd(product(self._slopes(points), bases), full_matrices=True)
        return product(bases, transposed(directions[:, self._count :]))

    def _steps(self, slopes: Array, values: Array, wish: Array) -> tuple[Array, Array]:
        """In M's tangent space: the shortest to f = 0, and what of the wish does not change f."""
        gram = product(slopes, transposed(slopes))
        # Rows that rounding alone keeps apart lead nowhere, least of all to f = 0.
        lengths2 = np.diagonal(gram, axis1=1, axis2=2).prod(axis=1)
        regular = np.linalg.det(gram) > 1e-12 * lengths2
        gram[~regular] = np.eye(self._count)
        down = -apply(transposed(slopes), np.linalg.solve(gram, values[..., None])[..., 0])
        off = apply(slopes, wish)
        along = wish - apply(transposed(slopes), np.linalg.solve(gram, off[..., None])[..., 0])
        down[~regular] = np.nan
        return down, along

    def _slopes(self, points: Array) -> Array:
        if self._gradient is not None:
            return self._gradient(points)
        h = 6e-6 * self._scale * np.eye(self.ambient_dimension)
        columns = [(self._values(points + v) - self._values(points - v)) / (2 * v.sum()) for v in h]
        return np.stack(columns, axis=2)

    def _starts(self, box: Any, seeds: Any) -> Array:
        if box is None and seeds is None:
            raise InvalidArgument("the oracle has neither a bounding_box nor seeds")
        if box is None:
            return np.asarray(seeds, dtype=np.float64)
        lower, upper = box
        shares = np.random.default_rng(1).random((64, len(lower)))
        return np.asarray(lower + shares * (upper - lower))
