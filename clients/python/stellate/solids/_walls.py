"""The walls that solids are made of: functions that are positive inside, smooth where they are zero.

Where it can be, a wall's value is the distance to it, so that walls can be offset and blended.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Callable

import numpy as np

from .._rows import Array, norms
from ..oracles import HalfSpace
from ._motions import _ROUNDING, Motion, times

Function = Callable[[Array], Any]


class Wall:
    """A function (n, d) -> (n,)."""

    def __call__(self, points: Array) -> Array:
        raise NotImplementedError

    @property
    def gradient(self) -> Function | None:
        """(n, d) -> (n, d), or None where it is not known."""
        return None

    def moved(self, motion: Motion) -> Wall:
        raise NotImplementedError

    def offset(self, distance: float) -> Wall | None:
        """The wall that lies farther out by a distance; None where values are no distances."""
        return None

    def like(self, other: Wall) -> int:
        """1 if both are the same wall, -1 if they are of opposite sides, 0 if they differ."""
        return 0


class Plane(Wall):
    """normal . x - level, with a unit normal inwards."""

    def __init__(self, normal: Array, level: float) -> None:
        size = float(norms(normal))
        self.normal, self.level = normal / size + 0.0, level / size + 0.0  # without -0
        self._function = HalfSpace(self.normal, self.level)

    def __call__(self, points: Array) -> Array:
        return self._function(points)

    @property
    def gradient(self) -> Function | None:
        return self._function.gradient

    def moved(self, motion: Motion) -> Plane:
        normal = times(self.normal[None, :], motion.turn)[0]
        return Plane(normal, motion.scale * self.level + float((normal * motion.shift).sum()))

    def offset(self, distance: float) -> Plane:
        return Plane(self.normal, self.level - distance)

    def like(self, other: Wall) -> int:
        if not isinstance(other, Plane):
            return 0
        size = _ROUNDING * max(1.0, abs(self.level))
        for sign in (1, -1):
            turned = np.abs(self.normal - sign * other.normal).max() <= _ROUNDING
            if turned and abs(self.level - sign * other.level) <= size:
                return sign
        return 0

    def __repr__(self) -> str:
        return f"plane {self.normal.round(6).tolist()} . x >= {self.level:.6g}"


class Profile:
    """What a Placed wall is where it has not been moved to yet."""

    def values(self, points: Array) -> Array:
        raise NotImplementedError

    def slopes(self, points: Array) -> Array:
        raise NotImplementedError

    @property
    def has_slopes(self) -> bool:
        return True

    def offset(self, distance: float) -> Profile | None:
        return None


@dataclasses.dataclass(frozen=True)
class Tube(Profile):
    """What is within a radius of the z axis; with `across` all coordinates, of a point."""

    radius: float
    across: int | None = 2

    def values(self, points: Array) -> Array:
        return np.asarray(self.radius - norms(points[:, : self.across]))

    def slopes(self, points: Array) -> Array:
        out = np.zeros_like(points)
        out[:, : self.across] = -_unit(points[:, : self.across])
        return out

    def offset(self, distance: float) -> Profile | None:
        return Tube(self.radius + distance, self.across) if self.radius + distance > 0 else None


@dataclasses.dataclass(frozen=True)
class Taper(Profile):
    """The side of a cone: around the z axis, `radius` wide at z = 0, wider by `slope` a unit of z."""

    radius: float
    slope: float

    def values(self, points: Array) -> Array:
        wide = self.radius + self.slope * points[:, 2]
        return np.asarray((wide - norms(points[:, :2])) / np.hypot(1.0, self.slope))

    def slopes(self, points: Array) -> Array:
        out = np.empty_like(points)
        out[:, :2] = -_unit(points[:, :2]) / np.hypot(1.0, self.slope)
        out[:, 2] = self.slope / np.hypot(1.0, self.slope)
        return out

    def offset(self, distance: float) -> Profile:
        return Taper(self.radius + distance * float(np.hypot(1.0, self.slope)), self.slope)


@dataclasses.dataclass(frozen=True)
class Ring(Profile):
    """What is within `minor` of a circle around the z axis."""

    major: float
    minor: float

    def values(self, points: Array) -> Array:
        return np.asarray(self.minor - norms(self._from_circle(points)))

    def slopes(self, points: Array) -> Array:
        away = _unit(self._from_circle(points))
        return np.concatenate([-away[:, :1] * _unit(points[:, :2]), -away[:, 1:]], axis=1)

    def offset(self, distance: float) -> Profile | None:
        minor = self.minor + distance
        return Ring(self.major, minor) if 0 < minor < self.major else None

    def _from_circle(self, points: Array) -> Array:
        return np.stack([norms(points[:, :2]) - self.major, points[:, 2]], axis=1)


@dataclasses.dataclass(frozen=True)
class Pill(Profile):
    """What is within a radius of the z axis from -half to half."""

    half: float
    radius: float

    def values(self, points: Array) -> Array:
        return np.asarray(self.radius - norms(self._from_segment(points)))

    def slopes(self, points: Array) -> Array:
        return -_unit(self._from_segment(points))

    def offset(self, distance: float) -> Profile | None:
        return Pill(self.half, self.radius + distance) if self.radius + distance > 0 else None

    def _from_segment(self, points: Array) -> Array:
        away = points.copy()
        away[:, 2] -= np.clip(away[:, 2], -self.half, self.half)
        return away


@dataclasses.dataclass(frozen=True)
class Given(Profile):
    """A function of the user's, with its gradient or None, and what is added to it."""

    function: Function
    gradient: Function | None
    distance: bool
    added: float = 0.0

    def values(self, points: Array) -> Array:
        values = np.asarray(self.function(points))
        return values + self.added if self.added else values

    def slopes(self, points: Array) -> Array:
        assert self.gradient is not None
        slopes = np.asarray(self.gradient(points))
        return slopes.reshape(points.shape) if slopes.size == points.size else slopes

    @property
    def has_slopes(self) -> bool:
        return self.gradient is not None

    def offset(self, distance: float) -> Profile | None:
        return dataclasses.replace(self, added=self.added + distance) if self.distance else None


@dataclasses.dataclass(frozen=True)
class Blended(Profile):
    """The union of two walls, its edge filled by a fillet, of a radius where they cross squarely.

    Outside of both, where a and b are their values, the fillet is the arc (r + a)^2 + (r + b)^2 = r^2.
    """

    first: Wall
    second: Wall
    radius: float

    def values(self, points: Array) -> Array:
        a, b = self._both(points)
        arc = np.hypot(np.maximum(self.radius + a, 0), np.maximum(self.radius + b, 0))
        return np.asarray(np.minimum(-self.radius, np.maximum(a, b)) + arc)

    def slopes(self, points: Array) -> Array:
        a, b = self._both(points)
        assert self.first.gradient is not None and self.second.gradient is not None
        u, v = np.maximum(self.radius + a, 0), np.maximum(self.radius + b, 0)
        arc = np.hypot(u, v)
        far = arc <= 0  # from both: as the nearer of them is
        u, v = np.where(far, a >= b, u), np.where(far, a < b, v)
        share = np.stack([u, v], axis=1) / np.where(far, 1.0, arc)[:, None]
        slopes = self.first.gradient(points), self.second.gradient(points)
        return np.asarray(share[:, :1] * slopes[0] + share[:, 1:] * slopes[1])

    @property
    def has_slopes(self) -> bool:
        return self.first.gradient is not None and self.second.gradient is not None

    def _both(self, points: Array) -> tuple[Array, Array]:
        a, b = (np.asarray(wall(points)).reshape(len(points)) for wall in (self.first, self.second))
        return a, b


class Placed(Wall):
    """A profile somewhere in R^d: distances stay distances."""

    def __init__(self, profile: Profile, motion: Motion) -> None:
        self.profile, self.motion = profile, motion

    def __call__(self, points: Array) -> Array:
        return np.asarray(self.motion.scale * self.profile.values(self.motion.back(points)))

    @property
    def gradient(self) -> Function | None:
        return self._slopes if self.profile.has_slopes else None

    def _slopes(self, points: Array) -> Array:
        return times(self.profile.slopes(self.motion.back(points)), self.motion.turn)

    def moved(self, motion: Motion) -> Placed:
        return Placed(self.profile, motion.after(self.motion))

    def offset(self, distance: float) -> Placed | None:
        profile = self.profile.offset(distance / self.motion.scale)
        return None if profile is None else Placed(profile, self.motion)

    def like(self, other: Wall) -> int:
        same = isinstance(other, Placed) and self.profile == other.profile
        return int(same and isinstance(other, Placed) and self.motion.is_like(other.motion))

    def __repr__(self) -> str:
        return f"{self.profile!r} at {self.motion.shift.round(6).tolist()}"


class Opposite(Wall):
    """A wall whose other side is the inside."""

    def __init__(self, wall: Wall) -> None:
        self.wall = wall

    def __call__(self, points: Array) -> Array:
        return np.asarray(-self.wall(points))

    @property
    def gradient(self) -> Function | None:
        return None if self.wall.gradient is None else self._slopes

    def _slopes(self, points: Array) -> Array:
        assert self.wall.gradient is not None
        return np.asarray(-self.wall.gradient(points))

    def moved(self, motion: Motion) -> Opposite:
        return Opposite(self.wall.moved(motion))

    def offset(self, distance: float) -> Wall | None:
        moved = self.wall.offset(-distance)
        return None if moved is None else Opposite(moved)

    def like(self, other: Wall) -> int:
        if isinstance(other, Opposite):
            return self.wall.like(other.wall)
        return -self.wall.like(other)

    def __repr__(self) -> str:
        return f"outside of {self.wall!r}"


def _unit(vectors: Array) -> Array:
    """Each row over its length; 0 stays 0."""
    size = norms(vectors)[:, None]
    return np.asarray(vectors / np.where(size > 0, size, 1.0))
