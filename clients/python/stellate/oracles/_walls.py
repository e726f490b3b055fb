"""Manifolds with boundary: what walls leave of another manifold, and domains of space."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Callable

import numpy as np

from ..errors import InvalidArgument
from ..oracle import CheckedOracle
from ._combined import LevelSet
from ._common import Array, apply, norms, transposed

Wall = Callable[[Array], Any]


class _Face(LevelSet):
    """The points of a manifold where some walls are zero; a corner is one of dimension 0."""

    _least_dimension = 0


class Space:
    """All of R^d, as a manifold that is to be cut by walls. bounding_box: where to look."""

    thread_safe = True

    def __init__(self, bounding_box: Sequence[Any]) -> None:
        lower, upper = (np.asarray(corner, dtype=np.float64) for corner in bounding_box)
        self.bounding_box = lower, upper
        self.dimension = self.ambient_dimension = len(lower)

    def closest_point(self, points: Array) -> Array:
        return np.array(points, dtype=np.float64)

    def tangent_basis(self, points: Array) -> Array:
        return np.broadcast_to(
            np.eye(self.dimension), (len(points), self.dimension, self.dimension)
        ).copy()


class Clipped:
    """{x in M : g(x) >= 0 for all walls g}: a manifold with boundary, edges and corners.

    Where several walls meet on M they have to cross at an angle: tangential walls are refused.

    Args:
      oracle: of M, with tangent bases.
      walls: functions (n, d) -> (n,), smooth near where they are zero; what counts elsewhere is their
        sign. Wall i of mesh.boundary is the i-th of them; those of box and ball come after these.
      gradients: of the walls, (n, d) -> (n, d) each; None: differences.
      box: (lower (d,), upper (d,)): M within a box, whose sides are walls, lower ones first. An
        infinite side is none.
      ball: (centre (d,), radius): M within a ball.
      seeds: (s, d) points near what is left, where M's box or seeds are not to be gone by.
    """

    def __init__(
        self,
        oracle: Any,
        walls: Sequence[Wall] = (),
        *,
        gradients: Sequence[Wall | None] | None = None,
        box: Sequence[Any] | None = None,
        ball: Sequence[Any] | None = None,
        seeds: Any = None,
    ) -> None:
        self._base = CheckedOracle(oracle)
        if not self._base.has_tangent_basis:
            raise InvalidArgument(f"to clip {type(oracle).__name__} takes its tangent_basis")
        self._oracle = oracle
        self.dimension = self._base.dimension
        self.ambient_dimension = d = self._base.ambient_dimension
        self._walls = list(walls)
        self._gradients = list(gradients) if gradients is not None else [None] * len(self._walls)
        if len(self._gradients) != len(self._walls) or not all(map(callable, self._walls)):
            raise InvalidArgument("walls have to be functions, and gradients one for each, or None")
        if box is not None:
            self._add_box(*(np.asarray(corner, dtype=np.float64) for corner in box))
        if ball is not None:
            self._add_ball(np.asarray(ball[0], dtype=np.float64), float(ball[1]))
        self.walls = len(self._walls)
        if not 1 <= self.walls <= 64:
            raise InvalidArgument(f"there are {self.walls} walls; there have to be 1 to 64")
        if seeds is not None:
            self.seeds = np.asarray(seeds, dtype=np.float64)
        elif self._base.seeds is not None:
            self.seeds = self._base.seeds
        if self._base.bounding_box is not None:
            self.bounding_box = self._base.bounding_box
        if self._base.has_intersect_flat and self.dimension < d:
            self.intersect_flat = oracle.intersect_flat
        if self._base.has_local_size:
            self.local_size = oracle.local_size
        self.thread_safe = bool(getattr(oracle, "thread_safe", False))
        self._faces: dict[tuple[int, ...], _Face] = {}

    def closest_point(self, points: Array) -> Array:
        """Of M, whatever the walls say."""
        return np.asarray(self._oracle.closest_point(points))

    def tangent_basis(self, points: Array) -> Array:
        return np.asarray(self._oracle.tangent_basis(points))

    def face_point(self, points: Array, face: tuple[int, ...]) -> Array:
        """(n, d) -> (n, d): nearest points of M where the walls of `face` are zero."""
        solver = self._faces.get(face)
        if solver is None:
            solver = self._faces[face] = _Face(
                self._oracle,
                lambda x: np.stack([self._value(wall, x) for wall in face], axis=1),
                lambda x: np.stack([self._slope(wall, x) for wall in face], axis=1),
            )
        return solver.closest_point(points)

    def clearances(self, points: Array) -> Array:
        """(n, d) -> (n, walls): the walls' values."""
        return np.stack([self._value(wall, points) for wall in range(self.walls)], axis=1)

    def conormals(self, points: Array, face: tuple[int, ...]) -> Array:
        """(n, d) -> (n, len(face), d): outward unit normals of the walls within M."""
        bases = np.asarray(self._oracle.tangent_basis(points))
        outward = np.empty((len(points), len(face), self.ambient_dimension))
        for i, wall in enumerate(face):
            along = apply(transposed(bases), self._slope(wall, points))
            steep = norms(along)[:, None]
            outward[:, i] = apply(bases, -along / np.where(steep > 0, steep, 1.0))
        return outward

    def _value(self, wall: int, points: Array) -> Array:
        values = np.asarray(self._walls[wall](points), dtype=np.float64)
        return values.reshape(len(points))

    def _slope(self, wall: int, points: Array) -> Array:
        gradient = self._gradients[wall]
        if gradient is not None:
            return np.asarray(gradient(points), dtype=np.float64).reshape(points.shape)
        h = 6e-6 * self._scale() * np.eye(self.ambient_dimension)
        columns = [
            (self._value(wall, points + v) - self._value(wall, points - v)) / (2 * v.sum())
            for v in h
        ]
        return np.stack(columns, axis=1)

    def _scale(self) -> float:
        if self._base.bounding_box is not None:
            lower, upper = self._base.bounding_box
            return float(norms(upper - lower))
        seeds = self._base.seeds
        return float(norms(np.ptp(seeds, axis=0))) if seeds is not None and len(seeds) > 1 else 1.0

    def _add_box(self, lower: Array, upper: Array) -> None:
        d = self.ambient_dimension
        if lower.shape != (d,) or upper.shape != (d,) or not (lower < upper).all():
            raise InvalidArgument(f"box has to be two corners of R^{d}, the lower one first")
        for corner, sign in ((lower, 1.0), (upper, -1.0)):
            for i in np.flatnonzero(np.isfinite(corner)):
                self._walls.append(_side(int(i), float(corner[i]), sign))
                self._gradients.append(_constant(sign * np.eye(d)[i]))

    def _add_ball(self, centre: Array, radius: float) -> None:
        if centre.shape != (self.ambient_dimension,) or not radius > 0:
            raise InvalidArgument(
                f"ball has to be a point of R^{self.ambient_dimension} and a radius"
            )
        self._walls.append(lambda x: radius**2 - ((x - centre) ** 2).sum(axis=1))
        self._gradients.append(lambda x: -2 * (x - centre))


def _side(axis: int, at: float, sign: float) -> Wall:
    return lambda x: sign * (x[:, axis] - at)


def _constant(slope: Array) -> Wall:
    return lambda x: np.broadcast_to(slope, x.shape)


class Solid(Clipped):
    """{x in R^d : g(x) >= 0 for all walls g}, as a manifold of dimension d with boundary.

    Args:
      walls: a function (n, d) -> (n,), or several.
      bounding_box: (lower (d,), upper (d,)) around it.
      gradients, box, ball, seeds: as in Clipped.
    """

    def __init__(
        self, walls: Wall | Sequence[Wall], bounding_box: Sequence[Any], **options: Any
    ) -> None:
        one = callable(walls)
        if one and "gradients" in options:
            options["gradients"] = [options["gradients"]]
        super().__init__(Space(bounding_box), [walls] if one else walls, **options)  # type: ignore[list-item, arg-type]
        self.thread_safe = False
