"""Balls, boxes, cylinders and their like, and what is given by a function."""

from __future__ import annotations

from typing import Any, Callable, Literal

import numpy as np

from .._derivatives import Library
from .._rows import Array, norms
from ..errors import InvalidArgument
from ..oracles._walls import derived
from ._motions import Body, Hull, Hulls, Motion, corners, direction, length, turn_to, vector
from ._signs import All, Half
from ._solid import Solid
from ._walls import Blended, Given, Opposite, Pill, Placed, Plane, Ring, Taper, Tube, Wall

_ORIGIN = (0.0, 0.0, 0.0)
_DOT = np.zeros(1)  # a disc of no radius

Join = Literal["|", "&", "-"]


class Ball(Solid):
    """The ball of a radius about a point of R^d, any d: one wall."""

    def __init__(self, radius: float = 1.0, at: Any = _ORIGIN) -> None:
        r, centre = length(radius, "the radius, which comes first,"), vector(at, "the centre")
        d = len(centre)
        wall = Placed(Tube(r, None), Motion(np.eye(d), 1.0, centre))
        hull = Hull(centre[None, :], np.eye(d)[0], _DOT, r)
        super().__init__(All((Half(wall),), hull), d)


class Box(Solid):
    """The box between two corners of R^d, any d: 2 d walls, the lower ones first. Box(-1, 1) is the cube of
    space between (-1, -1, -1) and (1, 1, 1)."""

    def __init__(self, lower: Any, upper: Any) -> None:
        if np.ndim(lower) == 0 and np.ndim(upper) == 0:
            lower, upper = [lower] * 3, [upper] * 3
        low = vector(lower, "the lower corner")
        high, d = vector(upper, "the upper corner", len(low)), len(low)
        if not (low < high).all():
            raise InvalidArgument(
                f"a box needs corners lower < upper, and has {lower!r} and {upper!r}"
            )
        sides = [Plane(axis, level) for axis, level in zip(np.eye(d), low)]
        sides += [Plane(-axis, -level) for axis, level in zip(np.eye(d), high)]
        super().__init__(All(tuple(map(Half, sides)), corners(low, high)), d)


class HalfSpace(Solid):
    """{x : normal . x >= offset}, the normal inwards, of any length: one wall."""

    def __init__(self, normal: Any, offset: float = 0.0) -> None:
        inwards = vector(normal, "the normal")
        if not norms(inwards) > 0:
            raise InvalidArgument("a half-space needs a normal other than 0")
        if not isinstance(offset, (int, float, np.integer, np.floating)) or not np.isfinite(offset):
            raise InvalidArgument(
                f"a half-space's offset has to be a number, normal . p for a point p of its plane, "
                f"and is {offset!r}"
            )
        super().__init__(Half(Plane(inwards, float(offset))), len(inwards))


class Cylinder(Solid):
    """A cylinder of space: its side, one wall, and with a height two ends.

    Args:
      axis: its direction, "x", "y", "z" or a vector.
      height: from one end to the other; None: it goes on without ends, to be cut or taken away.
      at: its centre, or a point of its axis.
    """

    def __init__(
        self,
        radius: float = 1.0,
        height: float | None = None,
        *,
        axis: Any = "z",
        at: Any = _ORIGIN,
    ) -> None:
        along, centre = direction(axis), vector(at, "the centre", 3)
        r = length(radius, "the radius")
        side = Placed(Tube(r), Motion(turn_to(along), 1.0, centre))
        if height is None:
            hull = Hull(centre[None, :], along, np.array([r]), endless=True)
            super().__init__(All((Half(side),), hull), 3)
            return
        ends = _ends(along, centre, length(height, "the height"))
        hull = Hull(ends[0], along, np.array([r, r]))
        super().__init__(All((Half(side), *map(Half, ends[1])), hull), 3)


class Cone(Solid):
    """A cone of space whose tip may be cut off: its side, one wall, and one or two ends.

    Args:
      radius: at its lower end.
      height: from one end to the other.
      top: the radius at its upper end; 0: it has a tip, which is no smooth point of its side. As a
        whole it is not meshed then, but what is left where the tip is cut away.
      axis: from the lower end to the upper one, "x", "y", "z" or a vector.
      at: the middle between the ends.
    """

    def __init__(
        self,
        radius: float = 1.0,
        height: float = 1.0,
        top: float = 0.0,
        *,
        axis: Any = "z",
        at: Any = _ORIGIN,
    ) -> None:
        along, centre = direction(axis), vector(at, "the middle", 3)
        r, h = length(radius, "the radius"), length(height, "the height")
        upper = length(top, "the radius at the top") if top != 0 else 0.0
        side = Taper((r + upper) / 2, (upper - r) / h)
        places, ends = _ends(along, centre, h)
        kept = ends if upper > 0 else ends[:1]  # the side ends at its tip by itself
        walls = (Placed(side, Motion(turn_to(along), 1.0, centre)), *kept)
        super().__init__(All(tuple(map(Half, walls)), Hull(places, along, np.array([r, upper]))), 3)


class Torus(Solid):
    """What is within `minor` of a circle of radius `major` around an axis: one wall."""

    def __init__(
        self, major: float = 1.0, minor: float = 0.4, *, axis: Any = "z", at: Any = _ORIGIN
    ) -> None:
        along, centre = direction(axis), vector(at, "the centre", 3)
        wide, thick = length(major, "the major radius"), length(minor, "the minor radius")
        if not thick < wide:
            raise InvalidArgument(f"a torus needs minor < major, not {minor} and {major}")
        wall = Placed(Ring(wide, thick), Motion(turn_to(along), 1.0, centre))
        hull = Hull(centre[None, :], along, np.array([wide]), thick)
        super().__init__(All((Half(wall),), hull), 3)


class Capsule(Solid):
    """What is within a radius of the segment between two points of space: one wall."""

    def __init__(self, start: Any, end: Any, radius: float = 1.0) -> None:
        a, b = vector(start, "the start", 3), vector(end, "the end", 3)
        size = float(norms(b - a))
        r = length(radius, "the radius")
        if not size > 0:
            raise InvalidArgument("a capsule needs two points that differ; Ball is for one")
        along = (b - a) / size
        wall = Placed(Pill(size / 2, r), Motion(turn_to(along), 1.0, (a + b) / 2))
        hull = Hull(np.stack([a, b]), along, np.zeros(2), r)
        super().__init__(All((Half(wall),), hull), 3)


class Implicit(Solid):
    """{x : g(x) >= 0}, g smooth where it is zero: one wall.

    Args:
      g: (n, d) -> (n,), positive inside.
      gradient: (n, d) -> (n, d); or "autograd", "jax" or "torch", if g is written for one of these;
        or None: differences of g.
      bounding_box: (lower (d,), upper (d,)) around it; None: it has to be cut by what has an end.
      distance: g's values are distances, so that it can be offset.
      dimension: d; that of the box, if there is one.
    """

    def __init__(
        self,
        g: Callable[[Any], Any],
        gradient: Callable[[Array], Any] | Library | None = None,
        *,
        bounding_box: Any = None,
        distance: bool = False,
        dimension: int = 3,
    ) -> None:
        if not callable(g) or not (
            gradient is None or isinstance(gradient, str) or callable(gradient)
        ):
            raise InvalidArgument("Implicit takes a function, and a function or None as gradient")
        if isinstance(gradient, str):
            g, gradient = derived(g, gradient)
        hull: Body | None = None
        if bounding_box is not None:
            lower = vector(bounding_box[0], "the lower corner")
            hull = corners(lower, vector(bounding_box[1], "the upper corner", len(lower)))
            dimension = len(lower)
        wall = Placed(Given(g, gradient, distance), Motion.none(dimension))
        super().__init__(All((Half(wall),), hull), dimension)


def blend(a: Solid, b: Solid, radius: float, join: Join = "|") -> Solid:
    """The union of two solids of one wall each, with a fillet where they meet: one wall again.

    Args:
      a, b: as Solid.offset takes them; where values are no distances the fillet is not round.
      radius: of the fillet, where the two cross at a right angle.
      join: "|", the union; "&", the intersection; "-", a without b, both with their edges rounded.
    """
    if join not in ("|", "&", "-"):
        raise InvalidArgument(f"join has to be '|', '&' or '-', and is {join!r}")
    if not isinstance(a, Solid) or not isinstance(b, Solid) or a.dimension != b.dimension:
        raise InvalidArgument("blend takes two solids of the same R^d")
    r = length(radius, "the radius")
    first, second = _wall_of(a), _wall_of(b)
    inside = {"|": (1, 1), "&": (-1, -1), "-": (-1, 1)}[join]
    parts = [_turned(wall, side) for wall, side in zip((first[0], second[0]), inside)]
    wall = Placed(Blended(parts[0], parts[1], r), Motion.none(a.dimension))
    if join == "|":
        bodies = [body for _, body in (first, second) if body is not None]
        hull = Hulls(tuple(bodies)) if len(bodies) == 2 else None
        return Solid(All((Half(wall),), hull), a.dimension)
    return Solid(All((Half(Opposite(wall)),), first[1]), a.dimension)


def _wall_of(solid: Solid) -> tuple[Wall, Body | None]:
    """What is positive inside, and a hull of the inside. Raises: InvalidArgument."""
    sign, wall, hull = solid.single("blend takes")
    return _turned(wall, sign), hull if sign > 0 else None


def _turned(wall: Wall, sign: int) -> Wall:
    return wall if sign > 0 else Opposite(wall)


def _ends(along: Array, centre: Array, height: float) -> tuple[Array, tuple[Plane, Plane]]:
    """The middles (2, 3) of the lower and the upper end, and the planes."""
    middle, half = float((along * centre).sum()), height / 2
    places = np.stack([centre - half * along, centre + half * along])
    return places, (Plane(along, middle - half), Plane(-along, -middle - half))
