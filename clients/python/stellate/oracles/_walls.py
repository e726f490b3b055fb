"""Manifolds with boundary: what walls leave of another manifold, and domains of space."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, Callable

import numpy as np

from .._derivatives import Library, with_derivatives
from .._equations import System, along, differences
from .._functions import Exactness, UserFunction
from .._rows import Array, Flags, apply, norms, transposed
from ..errors import InvalidArgument
from ..oracle import CheckedOracle
from ._combined import LevelSet
from ._common import all_or_raise, refuse_walls, where_of
from ._implicit import ImplicitManifold, OnWalls
from ._touching import Touching
from ._units import Before, SlopeBefore, in_units

Wall = Callable[[Array], Any]


class _Face(LevelSet):
    """The points of a manifold where some walls are zero; a corner is one of dimension 0."""

    _least_dimension = 0


class _WallEquation(System):
    """A wall that is zero, beside the equations of a manifold."""

    def __init__(
        self,
        value: Callable[[int, Array], Array],
        gradients: Sequence[UserFunction | None],
        wall: int,
        like: System,
    ) -> None:
        """`like`: those equations."""
        d = like.shape[1]
        super().__init__((1, d), like.scale, like.largest, like.max_iterations)
        self._value, self._gradient, self._wall = value, gradients[wall], wall
        self.seen_over = np.full(1, self.difference if self._gradient is None else 0.0)

    def values(self, x: Array) -> Array:
        """(n, d) -> (n, 1)"""
        return self._value(self._wall, x)[:, None]

    def slopes(self, x: Array, ways: Array, values: Array | None = None) -> Array:
        """(n, d) -> (n, 1, r), see System."""
        if self._gradient is None:
            return differences(self, x, ways, values)
        return along(self._gradient(x), ways)


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

    def in_units(self, scale: Array) -> Space:
        """Space in the coordinates x / scale."""
        lower, upper = self.bounding_box
        return Space((lower / scale, upper / scale))


class Clipped:
    """{x in M : g(x) >= 0 for all walls g}: a manifold with boundary, edges and corners.

    Where several walls meet on M they have to cross at an angle: tangential walls are refused.

    Args:
      oracle: of M, with tangent bases.
        If it is Clipped itself, its walls come first.
      walls: functions (n, d) -> (n,), smooth near where they are zero; what counts elsewhere is their
        sign. Wall i of mesh.boundary is the i-th of them; those of box and ball come after these.
      gradients: of the walls, (n, d) -> (n, d) each, or "autograd", "jax" or "torch" as in
        ImplicitManifold; None: differences.
      box: (lower (d,), upper (d,)): M within a box, whose sides are walls, lower ones first. An
        infinite side is none.
      ball: (centre (d,), radius): M within a ball.
      seeds: (s, d) points near what is left, where M's box or seeds are not to be gone by.
      labels: (2^walls,): the part of M with labels other than 0 instead of what is positive, region by
        region; see Oracle.labels. Walls have to cross at an angle only where labels differ.
      closures: of walls with labels: sets of their numbers, each of three or more walls that are zero
        wherever all others of the set are, as f - g, g - h and f - h; see Oracle.closures.
    """

    def __init__(
        self,
        oracle: Any,
        walls: Sequence[Wall] | Wall = (),
        *,
        gradients: Sequence[Wall | Library | None] | Library | None = None,
        box: Sequence[Any] | None = None,
        ball: Sequence[Any] | None = None,
        seeds: Any = None,
        labels: Any = None,
        closures: Sequence[Sequence[int]] = (),
    ) -> None:
        if callable(walls):
            walls = [walls]
        self._walls: list[UserFunction] = []
        self._gradients: list[UserFunction | None] = []
        self.labels = None if labels is None else np.array(labels)
        self.closures = tuple(tuple(map(int, closure)) for closure in closures)
        if isinstance(oracle, Clipped):
            if oracle.labels is not None:
                raise InvalidArgument(
                    "what has labels cannot be clipped: give all walls to one Clipped"
                )
            self._walls += oracle._walls
            self._gradients += oracle._gradients
            seeds = getattr(oracle, "seeds", None) if seeds is None else seeds
            oracle = oracle._oracle
        self._base = CheckedOracle(oracle)
        refuse_walls(self._base, "Clipped")
        if not self._base.has_tangent_basis:
            raise InvalidArgument(f"to clip {type(oracle).__name__} takes its tangent_basis")
        self._oracle: Any = oracle
        self.dimension = self._base.dimension
        self.ambient_dimension = d = self._base.ambient_dimension
        self._add(list(walls), gradients)
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
        if callable(getattr(oracle, "coordinates", None)):
            self.coordinates = oracle.coordinates
        self.coordinate_scale = self._base.coordinate_scale
        if self._base.has_local_size:
            self.local_size = oracle.local_size
        self.thread_safe = bool(getattr(oracle, "thread_safe", False))
        self.about = self._base.about
        self._faces: dict[tuple[int, ...], Callable[[Array], tuple[Array, Flags]]] = {}
        lower, upper = where_of(self._base)
        self._touching = Touching(self._values, self._slopes, self._label_at, (lower, upper))
        about = self._base.seeds
        self._exactness = [Exactness(about, lower, upper) for _ in self._walls]

    def closest_point(self, points: Array) -> Array:
        """Of M, whatever the walls say."""
        return np.asarray(self._oracle.closest_point(points))

    def tangent_basis(self, points: Array) -> Array:
        return np.asarray(self._oracle.tangent_basis(points))

    def face_point(self, points: Array, face: tuple[int, ...]) -> Array:
        """(n, d) -> (n, d): nearest points of M where the walls of `face` are zero."""
        solver = self._faces.get(face)
        if solver is None:
            solver = self._faces[face] = self._solver_of(self._independent(face))
        x = np.asarray(points, dtype=np.float64)
        y, found = solver(x)
        if isinstance(self._oracle, Space):
            if found.any():
                self._touching.note_crossing(face)
            self._touching.insist_they_cross(x[~found], face, self.walls)
        return all_or_raise(y, found)

    def clearances(self, points: Array) -> Array:
        """(n, d) -> (n, walls): the walls' values."""
        values = self._values(tuple(range(self.walls)), points)
        if isinstance(self._oracle, Space):
            self._touching.look(np.asarray(points, dtype=np.float64), values)
        return values

    def conormals(self, points: Array, face: tuple[int, ...]) -> Array:
        """(n, d) -> (n, len(face), d): outward unit normals of the walls within M."""
        bases = np.asarray(self._oracle.tangent_basis(points))
        outward = np.empty((len(points), len(face), self.ambient_dimension))
        for i, wall in enumerate(face):
            along = apply(transposed(bases), self._slope(wall, points))
            steep = norms(along)[:, None]
            outward[:, i] = apply(bases, -along / np.where(steep > 0, steep, 1.0))
        return outward

    def in_units(self, scale: Array) -> Clipped:
        """The oracle of {x / scale : x in M}; see oracles.in_units."""
        return ClippedInUnits(self, scale, self)

    def _independent(self, face: tuple[int, ...]) -> tuple[int, ...]:
        """Walls of a face from which all others of it follow, by the closures."""
        chosen: list[int] = []
        zero: set[int] = set()
        for wall in face:
            if wall in zero:
                continue
            chosen.append(wall)
            zero.add(wall)
            while grown := {w for s in self.closures if len(set(s) - zero) == 1 for w in s} - zero:
                zero |= grown
        return tuple(chosen)

    def _solver_of(self, face: tuple[int, ...]) -> Callable[[Array], tuple[Array, Flags]]:
        if isinstance(self._oracle, ImplicitManifold):
            # Walls are equations like the others.
            return OnWalls(
                self._oracle,
                lambda like: [_WallEquation(self._value, self._gradients, w, like) for w in face],
            ).find
        return _Face(self._oracle, partial(self._values, face), partial(self._slopes, face)).find

    def _label_at(self, signs: Flags) -> Any:
        """(n, walls) -> (n,): the labels of sign vectors, 0 outside."""
        if self.labels is None:
            return signs.all(axis=1).astype(int)
        return self.labels[signs @ (1 << np.arange(self.walls))]

    def _values(self, face: tuple[int, ...], points: Array) -> Array:
        """(n, d) -> (n, len(face))"""
        return np.stack([self._value(wall, points) for wall in face], axis=1)

    def _slopes(self, face: tuple[int, ...], points: Array) -> Array:
        """(n, d) -> (n, len(face), d)"""
        return np.stack([self._slope(wall, points) for wall in face], axis=1)

    def _value(self, wall: int, points: Array) -> Array:
        if len(points):
            self._exactness[wall].insist(self._walls[wall])
        return self._walls[wall](points)[:, 0]

    def _slope(self, wall: int, points: Array) -> Array:
        gradient = self._gradients[wall]
        if gradient is not None:
            return gradient(points)[:, 0]
        lower, upper = where_of(self._base)
        h = 6e-6 * float(norms(upper - lower)) * np.eye(self.ambient_dimension)
        columns = [
            (self._value(wall, points + v) - self._value(wall, points - v)) / (2 * v.sum())
            for v in h
        ]
        return np.stack(columns, axis=1)

    def _add(
        self, walls: list[Wall], gradients: Sequence[Wall | Library | None] | Library | None
    ) -> None:
        if gradients is None or isinstance(gradients, str):
            gradients = [gradients] * len(walls)
        if len(gradients) != len(walls) or not all(map(callable, walls)):
            raise InvalidArgument("walls have to be functions, and gradients one for each, or None")
        d = self.ambient_dimension
        for wall, gradient in zip(walls, gradients):
            if isinstance(gradient, str):
                wall, gradient = derived(wall, gradient)
            if gradient is None:
                gradient = getattr(wall, "gradient", None)
            name = f"wall {len(self._walls)}"
            self._walls.append(UserFunction(wall, name, (1,), str(d)))
            slope = f"the gradient of {name}"
            self._gradients.append(
                None if gradient is None else UserFunction(gradient, slope, (1, d), str(d))
            )

    def _add_box(self, lower: Array, upper: Array) -> None:
        d = self.ambient_dimension
        if lower.shape != (d,) or upper.shape != (d,) or not (lower < upper).all():
            raise InvalidArgument(f"box has to be two corners of R^{d}, the lower one first")
        for corner, sign in ((lower, 1.0), (upper, -1.0)):
            for i in np.flatnonzero(np.isfinite(corner)):
                self._add([HalfSpace(sign * np.eye(d)[i], sign * corner[i])], None)

    def _add_ball(self, centre: Array, radius: float) -> None:
        if centre.shape != (self.ambient_dimension,) or not radius > 0:
            raise InvalidArgument(
                f"ball has to be a point of R^{self.ambient_dimension} and a radius"
            )
        self._add([_Ball(centre, radius)], None)


class ClippedInUnits(Clipped):
    """The same in the coordinates x / scale.

    Args:
      whole: it in x.
      told: has its `clearances`, and `region_names` if they have any.
    """

    def __init__(self, whole: Clipped, units: Array, told: Any) -> None:
        self._told, self._units = told, units
        seeds = getattr(whole, "seeds", None)
        super().__init__(
            in_units(whole._oracle, units),
            [Before(wall, units) for wall in whole._walls],
            gradients=[g if g is None else SlopeBefore(g, units) for g in whole._gradients],
            seeds=None if seeds is None else seeds / units,
            labels=whole.labels,
            closures=whole.closures,
        )
        self.thread_safe = whole.thread_safe
        self.region_names = getattr(told, "region_names", ())

    def clearances(self, points: Array) -> Array:
        """(n, d) -> (n, walls): the walls' values."""
        return np.asarray(self._told.clearances(points * self._units))


class _Ball:
    """The wall {x : |x - centre| <= radius}, a function that knows its gradient."""

    def __init__(self, centre: Array, radius: float) -> None:
        self._centre, self._radius = centre, radius

    def __call__(self, points: Array) -> Array:
        return np.asarray(self._radius**2 - ((points - self._centre) ** 2).sum(axis=1))

    def gradient(self, points: Array) -> Array:
        """(n, d) -> (n, d)"""
        return np.asarray(-2 * (points - self._centre))


class HalfSpace:
    """The wall {x : normal . x >= offset}, a function that knows its gradient.

    Args:
      normal: (d,), inwards, of any length.
    """

    def __init__(self, normal: Any, offset: float = 0.0) -> None:
        self._normal, self._offset = np.array(normal, dtype=np.float64), float(offset)
        if self._normal.ndim != 1 or not norms(self._normal) > 0:
            raise InvalidArgument(f"a half-space needs a normal (d,), and has {normal!r}")

    def __call__(self, points: Array) -> Array:
        return np.asarray((points * self._normal).sum(axis=1) - self._offset)

    def gradient(self, points: Array) -> Array:
        """(n, d) -> (n, d)"""
        return np.broadcast_to(self._normal, points.shape)


def derived(wall: Wall, library: Library) -> tuple[Wall, Wall]:
    """A wall written for a library, and its gradient, on numpy's arrays."""
    return with_derivatives(_Column(wall), library)


class _Column:
    """A wall's values as a column, in its library's arrays."""

    def __init__(self, wall: Wall) -> None:
        self._wall = wall

    def __call__(self, x: Any) -> Any:
        return self._wall(x)[:, None]


class Solid(Clipped):
    """{x in R^d : g(x) >= 0 for all walls g}, as a manifold of dimension d with boundary.

    Args:
      walls: a function (n, d) -> (n,), or several.
      bounding_box: (lower (d,), upper (d,)) around it; by default that of a finite box or a ball.
      gradients, box, ball, seeds, labels, closures: as in Clipped.
    """

    def __init__(
        self,
        walls: Wall | Sequence[Wall] = (),
        bounding_box: Sequence[Any] | None = None,
        *,
        gradients: Sequence[Wall | Library | None] | Wall | Library | None = None,
        box: Sequence[Any] | None = None,
        ball: Sequence[Any] | None = None,
        seeds: Any = None,
        labels: Any = None,
        closures: Sequence[Sequence[int]] = (),
    ) -> None:
        several = [walls] if callable(walls) else walls
        slopes = [gradients] if callable(gradients) else gradients
        if bounding_box is None:
            bounding_box = _around(box, ball)
        super().__init__(
            Space(bounding_box),
            several,
            gradients=slopes,
            box=box,
            ball=ball,
            seeds=seeds,
            labels=labels,
            closures=closures,
        )
        self.thread_safe = False


class ImplicitSolid(Solid):
    """{x in R^d : g(x) >= 0}, bounded by a smooth surface or by several.

    Args:
      g: (n, d) -> (n,), positive inside; its gradient is not zero where it is. Of a signed
        distance that is negative inside take the negative.
      jacobian: (n, d) -> (n, d); or "autograd", "jax" or "torch", if g is written for one of these;
        or None: differences of g.
      bounding_box: (lower (d,), upper (d,)) around the solid.
      inequalities: more such functions, which all have to be positive. They take `jacobian`, where
        that names a library, as g does.
      seeds, thread_safe: as in ImplicitManifold.
    """

    def __init__(
        self,
        g: Wall,
        jacobian: Wall | Library | None = None,
        *,
        bounding_box: Sequence[Any],
        inequalities: Sequence[Wall] = (),
        seeds: Any = None,
        thread_safe: bool = False,
    ) -> None:
        library = jacobian if isinstance(jacobian, str) else None
        gradients = [jacobian, *[library] * len(inequalities)]
        super().__init__([g, *inequalities], bounding_box, gradients=gradients, seeds=seeds)
        self.thread_safe = thread_safe


def _around(box: Sequence[Any] | None, ball: Sequence[Any] | None) -> tuple[Array, Array]:
    """A box with room for either. Raises: InvalidArgument where there is none."""
    if box is None and ball is not None:
        centre, radius = np.asarray(ball[0], dtype=np.float64), float(ball[1])
        box = centre - radius, centre + radius
    corners = box if box is not None else (np.inf, np.inf)
    lower, upper = (np.asarray(corner, dtype=np.float64) for corner in corners)
    if not (np.isfinite(lower).all() and np.isfinite(upper).all()):
        raise InvalidArgument("a solid needs a bounding_box, or a finite box or ball")
    margin = 0.15 * (upper - lower)
    return lower - margin, upper + margin
