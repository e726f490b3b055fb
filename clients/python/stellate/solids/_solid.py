"""Solids that are composed of others, and meshed as intersections of half-walls."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from .._rows import Array
from ..errors import InvalidArgument
from ..oracles import Solid as WalledSolid
from ..oracles._walls import ClippedInUnits
from ._motions import Body, Grown, Motion, direction, length, turn_to, vector
from ._signs import (
    All,
    Arrangement,
    Either,
    Half,
    Labels,
    Node,
    NoIntersection,
    Not,
    check_count,
    needed,
    simplified,
    support,
)
from ._walls import Opposite, Plane, Wall

_MARGIN = 0.15  # of a solid's sides, around it


class ByWalls:
    """The methods of an oracle that is another, of walls in space: its `_oracle`."""

    @property
    def _oracle(self) -> WalledSolid:
        raise NotImplementedError

    @property
    def walls(self) -> int:
        return self._oracle.walls

    @property
    def labels(self) -> Labels | None:
        """Of the vectors of the walls' signs; None where it is all that is positive."""
        return self._oracle.labels

    @property
    def closures(self) -> tuple[tuple[int, ...], ...]:
        """Of walls that depend on each other."""
        return self._oracle.closures

    def closest_point(self, points: Array) -> Array:
        """(n, d) -> (n, d): the points themselves, as of all of space."""
        return self._oracle.closest_point(points)

    def tangent_basis(self, points: Array) -> Array:
        """(n, d) -> (n, d, d)."""
        return self._oracle.tangent_basis(points)

    def face_point(self, points: Array, face: tuple[int, ...]) -> Array:
        """(n, d) -> (n, d): nearest points where the walls of `face` are zero."""
        return self._oracle.face_point(points, face)

    def clearances(self, points: Array) -> Array:
        """(n, d) -> (n, walls): the walls' values."""
        return self._oracle.clearances(points)

    def conormals(self, points: Array, face: tuple[int, ...]) -> Array:
        """(n, d) -> (n, len(face), d): outward unit normals of the walls."""
        return self._oracle.conormals(points, face)

    def in_units(self, scale: Array) -> Any:
        """The oracle of {x / scale : x in it}; see oracles.in_units."""
        return ClippedInUnits(self._oracle, scale, self)


class Solid(ByWalls):
    """A solid of R^d: walls, and a Boolean of their signs. It is an oracle, which stellate.mesh takes.

        part = (Box([-1] * 3, [1] * 3) & Ball(1.3)) - Cylinder(axis="x", radius=0.5)
        mesh = stellate.mesh(part, epsilon=0.2)

    `a & b` is the intersection, `a | b` the union, `a - b` the difference, `a ^ b` what is in one of the
    two, `~a` the complement. Walls that are the same in several parts are one.

    What is an intersection of half-walls, once what does not matter is left out, is meshed by these
    alone; `half_walls` says whether a solid is one, and of which. Of others all walls count, with a
    label for each vector of their signs (`label_table`): 16 at most.

    Attributes:
      ambient_dimension: d, and `dimension` the same.
      walls: how many half-walls bound it: wall i of mesh.boundary is half_walls()[i].
      bounding_box: (lower (d,), upper (d,)) around it, with a margin.
    """

    def __init__(self, tree: Node, dimension: int, witnesses: tuple[Any, ...] = ()) -> None:
        self._tree, self.dimension = tree, dimension
        self._witnesses = witnesses  # what else knows the inside, and is compared with

    @property
    def ambient_dimension(self) -> int:
        return self.dimension

    # Composition.

    def __and__(self, other: Solid) -> Solid:
        return self._joined(other, lambda a, b: All((a, b)))

    def __or__(self, other: Solid) -> Solid:
        return self._joined(other, lambda a, b: Either((a, b)))

    def __add__(self, other: Any) -> Solid:
        raise TypeError("solids are joined by a | b, cut by a & b, and a - b takes b away")

    __mul__ = __rmul__ = __add__

    def __sub__(self, other: Solid) -> Solid:
        return self._joined(other, lambda a, b: All((a, Not(b))))

    def __xor__(self, other: Solid) -> Solid:
        return self._joined(other, lambda a, b: Either((All((a, Not(b))), All((b, Not(a))))))

    def __invert__(self) -> Solid:
        tree = self._tree.of if isinstance(self._tree, Not) else Not(self._tree)
        return Solid(tree, self.dimension, self._witnesses)

    def _joined(self, other: Any, join: Any) -> Solid:
        if not isinstance(other, Solid):
            return NotImplemented
        if other.dimension != self.dimension:
            raise InvalidArgument(
                f"a solid of R^{self.dimension} and one of R^{other.dimension} cannot be joined"
            )
        tree = join(self._tree, other._tree)
        return Solid(tree, self.dimension, (*self._witnesses, *other._witnesses))

    def at(self, *point: Any) -> Solid:
        """Moved by a vector (d,), or d numbers: what is about 0 comes to lie about the point."""
        shift = vector(point[0] if len(point) == 1 else point, "the point", self.dimension)
        return self._moved(Motion(np.eye(self.dimension), 1.0, shift))

    def rotated(self, rotation: Any) -> Solid:
        """Turned about 0, by an orthogonal matrix (d, d)."""
        turn, d = np.array(rotation, dtype=np.float64), self.dimension
        if turn.shape != (d, d) or not np.allclose(turn @ turn.T, np.eye(d), rtol=0, atol=1e-9):
            raise InvalidArgument(
                f"a rotation has to be an orthogonal matrix ({d}, {d}); solids.rotation(axis, angle) "
                "makes one of space"
            )
        return self._moved(Motion(turn, 1.0, np.zeros(d)))

    def scaled(self, factor: float) -> Solid:
        """Enlarged from 0 by a factor above 0."""
        by = length(factor, "the factor")
        return self._moved(Motion(np.eye(self.dimension), by, np.zeros(self.dimension)))

    def _moved(self, motion: Motion) -> Solid:
        witnesses = tuple(witness.moved(motion) for witness in self._witnesses)
        return Solid(self._tree.moved(motion), self.dimension, witnesses)

    def offset(self, distance: float) -> Solid:
        """All within a distance of it; below 0, what is farther than that from its outside.

        Of solids of one wall whose values are distances: balls, tori, capsules, cylinders without
        ends, half-spaces, Implicit(..., distance=True), and the complements of these.

        Raises: InvalidArgument.
        """
        sign, wall, hull = self.single("offset takes")
        moved = wall.offset(sign * float(distance))
        if moved is None:
            raise InvalidArgument(
                f"{wall!r} cannot be offset by {sign * distance:g}: its values are no distances, or "
                "nothing would be left"
            )
        grown = None if hull is None else Grown(hull, sign * float(distance))
        tree: Node = All((Half(moved),), grown)
        return Solid(tree if sign > 0 else Not(tree), self.dimension)

    # What it is.

    def contains(self, points: Any) -> np.ndarray:
        """(n, d) -> (n,) bool: which points are inside. Any solid knows."""
        x = np.atleast_2d(np.array(points, dtype=np.float64))
        if x.ndim != 2 or x.shape[1] != self.dimension:
            raise InvalidArgument(
                f"points have to be (n, {self.dimension}), and are {np.shape(points)}"
            )
        arrangement = Arrangement(self._tree)
        values = [np.asarray(wall(x)).reshape(len(x)) for wall in arrangement.walls]
        return np.asarray(arrangement.inside_at(np.stack(values, axis=1) > 0))

    def label_table(self) -> tuple[list[Wall], Labels]:
        """All walls, functions (n, d) -> (n,), and a label for each vector of their signs.

        Returns: the m walls, and (2^m,) int8. The label of a point is at the number that has bit i
          where wall i is positive there: 1 inside, 0 outside, -1 where no point can have the signs.
        Raises: InvalidArgument, for more than 16 walls.
        """
        arrangement = Arrangement(simplified(self._tree))
        return arrangement.walls, arrangement.labels()

    def half_walls(self) -> list[Wall]:
        """Functions (n, d) -> (n,), all of which are positive inside and nowhere else, each needed.

        oracles.Clipped takes them: what the solid leaves of a manifold.

        Raises: InvalidArgument where the solid is no intersection of half-walls, saying what can be.
        """
        arrangement = Arrangement(simplified(self._tree))
        literals = arrangement.literals()
        check_count(literals)
        return [_on_side(arrangement.walls[i], positive) for i, positive in literals]

    @functools.cached_property
    def bounding_box(self) -> tuple[Array, Array]:
        return box_of(self._tree, self.dimension)

    # What joins solids takes of them.

    @property
    def tree(self) -> Node:
        """The Boolean of its walls."""
        return self._tree

    @property
    def witnesses(self) -> tuple[Any, ...]:
        """What else knows the inside."""
        return self._witnesses

    # The oracle.

    @functools.cached_property
    def _oracle(self) -> WalledSolid:
        try:
            return WalledSolid(self.half_walls(), self.bounding_box)
        except NoIntersection:
            walls, labels = needed(*self.label_table())
        # Signs that no point has count as outside, of which nothing is seen.
        return WalledSolid(walls, self.bounding_box, labels=np.maximum(labels, 0))

    def clearances(self, points: Array) -> Array:
        """(n, d) -> (n, walls): the half-walls' values."""
        for witness in self._witnesses:
            witness.insist(points)
        return self._oracle.clearances(points)

    def __repr__(self) -> str:
        return f"<stellate.solids.Solid of R^{self.dimension}: {len(Arrangement(self._tree).walls)} walls>"

    def single(self, what: str) -> tuple[int, Wall, Body | None]:
        """Of a solid of one wall: whether that is positive inside (1) or outside (-1), the wall, and
        a hull of where it is positive. Raises: InvalidArgument."""
        sign, node = 1, self._tree
        hull: Body | None = None
        while not isinstance(node, Half):
            if isinstance(node, Not):
                sign, node = -sign, node.of
            elif isinstance(node, All) and len(node.parts) == 1:
                hull, node = node.hull, node.parts[0]
            else:
                raise InvalidArgument(
                    f"{what} solids of one wall, as balls, tori, capsules, cylinders without ends "
                    "and half-spaces are; this has edges, or several walls"
                )
        return sign, node.wall, hull


def box_of(tree: Node, d: int) -> tuple[Array, Array]:
    """(lower (d,), upper (d,)) around a solid, with a margin. Raises: InvalidArgument."""
    upper = np.array([support(tree, axis) for axis in np.eye(d)])
    lower = np.array([-support(tree, -axis) for axis in np.eye(d)])
    if not (np.isfinite(lower).all() and np.isfinite(upper).all()):
        raise InvalidArgument(
            "the solid goes on without end, or is not known to end: cut it by a box, "
            "solid & Box(lower, upper)"
        )
    if not (lower < upper).all():
        raise InvalidArgument("the solid is empty: its parts lie apart from each other")
    margin = _MARGIN * (upper - lower)
    return lower - margin, upper + margin


def _on_side(wall: Wall, positive: bool) -> Wall:
    if positive:
        return wall
    return Plane(-wall.normal, -wall.level) if isinstance(wall, Plane) else Opposite(wall)


def rotation(axis: Any, angle: float) -> Array:
    """The matrix (3, 3) of a turn of space about an axis, "x", "y", "z" or a vector, by radians."""
    to = turn_to(direction(axis))
    cosine, sine = np.cos(angle), np.sin(angle)
    about_z = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(to @ about_z @ to.T)
