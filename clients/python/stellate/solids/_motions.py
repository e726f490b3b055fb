"""Similarities of R^d, and convex bodies around solids, known by their support functions."""

from __future__ import annotations

import dataclasses
from typing import Any, Protocol

import numpy as np

from .._rows import Array, norms
from ..errors import InvalidArgument

_ROUNDING = 1e-12  # of unit vectors and of lengths beside their own size


@dataclasses.dataclass(frozen=True, eq=False)
class Motion:
    """x -> scale * turn x + shift, with an orthogonal turn (d, d), a shift (d,) and a scale above 0."""

    turn: Array
    scale: float
    shift: Array

    @staticmethod
    def none(d: int) -> Motion:
        return Motion(np.eye(d), 1.0, np.zeros(d))

    def forth(self, points: Array) -> Array:
        return np.asarray(self.scale * times(points, self.turn) + self.shift)

    def back(self, points: Array) -> Array:
        return np.asarray(times(points - self.shift, self.turn.T) / self.scale)

    def after(self, first: Motion) -> Motion:
        """`first`, and then this one."""
        shift = self.forth(first.shift[None, :])[0]
        return Motion(self.turn @ first.turn, self.scale * first.scale, shift)

    def is_like(self, other: Motion) -> bool:
        """But for rounding."""
        size = max(self.scale, float(norms(self.shift)))
        return bool(
            np.allclose(self.turn, other.turn, rtol=0, atol=_ROUNDING)
            and abs(self.scale - other.scale) <= _ROUNDING * self.scale
            and np.allclose(self.shift, other.shift, rtol=0, atol=_ROUNDING * size)
        )


class Body(Protocol):
    """A convex body."""

    def support(self, direction: Array) -> float:
        """The most that direction . x is in it; infinite where there is no most."""
        ...

    def moved(self, motion: Motion) -> Body:
        """Its image."""
        ...


@dataclasses.dataclass(frozen=True, eq=False)
class Hull:
    """The convex hull of parallel discs, and what is within a distance of that.

    Attributes:
      centres: (m, d) of the discs.
      axis: (d,), a unit vector across them.
      discs: (m,), their radii.
      around: the distance.
      endless: whether it goes on along the axis, both ways, without end.
    """

    centres: Array
    axis: Array
    discs: Array
    around: float = 0.0
    endless: bool = False

    def support(self, direction: Array) -> float:
        """As Body.support."""
        along = float((direction * self.axis).sum())
        length = float(norms(direction))
        if self.endless and abs(along) > _ROUNDING * length:
            return np.inf
        across = float(norms(direction - along * self.axis))
        most = (self.centres * direction).sum(axis=1) + across * self.discs
        return float(most.max()) + self.around * length

    def moved(self, motion: Motion) -> Hull:
        return Hull(
            motion.forth(self.centres),
            times(self.axis[None, :], motion.turn)[0],
            motion.scale * self.discs,
            motion.scale * self.around,
            self.endless,
        )


@dataclasses.dataclass(frozen=True, eq=False)
class Hulls:
    """The convex hull of several."""

    of: tuple[Body, ...]

    def support(self, direction: Array) -> float:
        """As Body.support."""
        return max(float(hull.support(direction)) for hull in self.of)

    def moved(self, motion: Motion) -> Hulls:
        return Hulls(tuple(hull.moved(motion) for hull in self.of))


@dataclasses.dataclass(frozen=True, eq=False)
class Grown:
    """All within a distance of a hull; below 0, what has that much of it around."""

    hull: Body
    distance: float

    def support(self, direction: Array) -> float:
        """As Body.support."""
        return float(self.hull.support(direction)) + self.distance * float(norms(direction))

    def moved(self, motion: Motion) -> Grown:
        return Grown(self.hull.moved(motion), motion.scale * self.distance)


def corners(lower: Array, upper: Array) -> Hull:
    """Of a box."""
    sides = np.stack(np.meshgrid(*np.stack([lower, upper], axis=1), indexing="ij"), axis=-1)
    points = sides.reshape(-1, len(lower))
    return Hull(points, np.eye(len(lower))[0], np.zeros(len(points)))


def times(vectors: Array, matrix: Array) -> Array:
    """Each row v as matrix v, whatever rows there are beside it."""
    return np.ascontiguousarray((vectors[:, None, :] * matrix).sum(axis=2))


def vector(value: Any, what: str, d: int | None = None) -> Array:
    """(d,), finite. Raises: InvalidArgument."""
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.empty((0, 0))
    if array.ndim != 1 or len(array) < 1 or (d is not None and len(array) != d):
        size = "a point of R^d" if d is None else f"{d} numbers"
        raise InvalidArgument(f"{what} has to be {size}, and is {value!r}")
    if not np.isfinite(array).all():
        raise InvalidArgument(f"{what} has to be finite, and is {value!r}")
    return array


def length(value: Any, what: str) -> float:
    """A number above 0. Raises: InvalidArgument."""
    if not (isinstance(value, (int, float, np.integer, np.floating)) and 0 < value < np.inf):
        raise InvalidArgument(f"{what} has to be a length above 0, and is {value!r}")
    return float(value)


def direction(axis: Any, d: int = 3) -> Array:
    """A unit vector, from "x", "y", "z" or any vector but 0. Raises: InvalidArgument."""
    if isinstance(axis, str):
        if axis not in ("x", "y", "z"):
            raise InvalidArgument(f"axis has to be 'x', 'y', 'z' or a vector, and is {axis!r}")
        return np.asarray(np.eye(d)["xyz".index(axis)])
    given = vector(axis, "axis", d)
    if not norms(given) > 0:
        raise InvalidArgument(f"axis has to be a vector other than 0, and is {axis!r}")
    return np.asarray(given / norms(given))


def turn_to(axis: Array) -> Array:
    """A rotation of space that takes the z axis to a unit vector."""
    around = np.cross([0.0, 0.0, 1.0], axis)
    sine, cosine = float(norms(around)), float(axis[2])
    if sine < _ROUNDING:
        return np.diag([1.0, np.sign(cosine), np.sign(cosine)])
    k = around / sine
    cross = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    return np.asarray(np.eye(3) + sine * cross + (1 - cosine) * cross @ cross)
