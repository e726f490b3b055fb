"""Solids as Booleans of the signs of walls: trees, tables of labels, and what a server can mesh of them.

A sign vector says of each wall whether it is positive: wall i as bit i of a number.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from .._rows import Array, Flags, norms
from ..errors import InvalidArgument
from ._motions import _ROUNDING, Body, Motion
from ._walls import Placed, Plane, Tube, Wall

MOST_IN_TABLES = 16  # walls, whose sign vectors are all gone through
_MOST = 64  # walls that a server takes

Labels = npt.NDArray[np.int8]
Node = Any  # one of those below
Literal = tuple[int, bool]  # a wall, and whether it is positive


@dataclasses.dataclass(frozen=True, eq=False)
class Half:
    """Where a wall is positive."""

    wall: Wall

    def moved(self, motion: Motion) -> Node:
        return Half(self.wall.moved(motion))


@dataclasses.dataclass(frozen=True, eq=False)
class Not:
    """The complement."""

    of: Node

    def moved(self, motion: Motion) -> Node:
        return Not(self.of.moved(motion))


@dataclasses.dataclass(frozen=True, eq=False)
class All:
    """The intersection; of no parts it is all of space. It lies within `hull`, where there is one."""

    parts: tuple[Node, ...]
    hull: Body | None = None

    def moved(self, motion: Motion) -> Node:
        hull = None if self.hull is None else self.hull.moved(motion)
        return All(tuple(part.moved(motion) for part in self.parts), hull)


@dataclasses.dataclass(frozen=True, eq=False)
class Either:
    """The union; of no parts it is nothing."""

    parts: tuple[Node, ...]

    def moved(self, motion: Motion) -> Node:
        return Either(tuple(part.moved(motion) for part in self.parts))


@dataclasses.dataclass(frozen=True, eq=False)
class Table:
    """By the sign vector of some walls: 1 inside, 0 outside, -1 where no point has it."""

    walls: tuple[Wall, ...]
    labels: Labels

    def moved(self, motion: Motion) -> Node:
        return Table(tuple(wall.moved(motion) for wall in self.walls), self.labels)


def walls_of(node: Node) -> Iterator[Wall]:
    """Those that occur, as often as they do."""
    if isinstance(node, Half):
        yield node.wall
    elif isinstance(node, Not):
        yield from walls_of(node.of)
    elif isinstance(node, Table):
        yield from node.walls
    else:
        for part in node.parts:
            yield from walls_of(part)


def support(node: Node, direction: Array) -> float:
    """The most that direction . x may be there: infinite where it is not known to have a most."""
    if isinstance(node, (All, Either)):
        sides = [support(part, direction) for part in node.parts]
        if isinstance(node, Either):
            return max(sides, default=-np.inf)
        if node.hull is not None:
            sides.append(node.hull.support(direction))
        return min(sides, default=np.inf)
    if isinstance(node, Not):
        return support(_pushed_in(node.of), direction)
    if isinstance(node, Half) and isinstance(node.wall, Plane):
        away = float((direction * node.wall.normal).sum())
        size = float(norms(direction))
        if norms(direction + size * node.wall.normal) <= _ROUNDING * size and away < 0:
            return -size * node.wall.level
    return np.inf


def _pushed_in(node: Node) -> Node:
    """The complement of a node, by de Morgan's laws."""
    if isinstance(node, Not):
        return node.of
    if isinstance(node, All):
        return Either(tuple(Not(part) for part in node.parts))
    if isinstance(node, Either):
        return All(tuple(Not(part) for part in node.parts))
    if isinstance(node, Half) and isinstance(node.wall, Plane):
        return Half(Plane(-node.wall.normal, -node.wall.level))
    return All(())  # which is not known to end anywhere


class NoIntersection(InvalidArgument):
    """A solid that is not all points on given sides of its walls."""


class Arrangement:
    """A tree's walls, each once, and the labels of their sign vectors."""

    def __init__(self, tree: Node) -> None:
        self.tree = tree
        self.walls: list[Wall] = []
        self._seen: dict[int, Literal] = {}
        for wall in walls_of(tree):
            self._number(wall)

    def _number(self, wall: Wall) -> Literal:
        """A wall's number, and whether it is that one, or that one from its other side."""
        if id(wall) not in self._seen:
            for i, known in enumerate(self.walls):
                side = known.like(wall)
                if side:
                    self._seen[id(wall)] = i, side > 0
                    break
            else:
                self._seen[id(wall)] = len(self.walls), True
                self.walls.append(wall)
        return self._seen[id(wall)]

    def labels(self) -> Labels:
        """(2^m,): 1 inside, 0 outside, -1 where no point is known to be able to have the signs.

        Raises: InvalidArgument, for too many walls.
        """
        if len(self.walls) > MOST_IN_TABLES:
            raise InvalidArgument(
                f"the solid has {len(self.walls)} walls, and a table of all their signs is made of "
                f"{MOST_IN_TABLES} at most"
            )
        labels = self.inside(self.tree).astype(np.int8)
        codes = np.arange(len(labels))
        signs = [(codes >> i & 1).astype(bool) for i in range(len(self.walls))]
        for cube in self._impossible():
            at = np.ones(len(codes), dtype=bool)
            for i, positive in cube:
                at &= signs[i] == positive
            labels[at] = -1
        for node in _tables(self.tree):
            labels[node.labels[self._code(node, signs)] < 0] = -1
        return labels

    def _code(self, node: Table, signs: list[Flags]) -> Any:
        code = np.zeros(len(signs[0]) if signs else 1, dtype=np.int64)
        for bit, wall in enumerate(node.walls):
            i, same = self._number(wall)
            code |= (signs[i] == same).astype(np.int64) << bit
        return code

    def _inside(self, node: Node, signs: list[Flags]) -> Flags:
        """Of sign vectors, a column a wall."""
        count = len(signs[0]) if signs else 1
        if isinstance(node, Half):
            i, same = self._number(node.wall)
            return np.asarray(signs[i] == same)
        if isinstance(node, Not):
            return ~self._inside(node.of, signs)
        if isinstance(node, Table):
            return np.asarray(node.labels[self._code(node, signs)] > 0)
        inside = np.full(count, isinstance(node, All))
        for part in node.parts:
            there = self._inside(part, signs)
            inside = inside & there if isinstance(node, All) else inside | there
        return inside

    def inside(self, node: Node) -> Flags:
        """(2^m,), of the vectors of the walls' signs and a node whose walls are among these."""
        codes = np.arange(1 << len(self.walls))
        signs = [(codes >> i & 1).astype(bool) for i in range(len(self.walls))]
        return self._inside(node, signs)

    def inside_at(self, signs: Flags) -> Flags:
        """(n, m) -> (n,), of sign vectors a row each."""
        return self._inside(self.tree, list(signs.T))

    def literals(self) -> list[Literal]:
        """The signs that all of the inside has, and nothing else; as few as will do.

        Raises: NoIntersection, where that is not all there is to say of the inside; InvalidArgument.
        """
        conjunction = self._conjunction(self.tree)
        if len(self.walls) > MOST_IN_TABLES:
            if conjunction is None:
                raise InvalidArgument(
                    f"the solid has {len(self.walls)} walls, and of more than {MOST_IN_TABLES} only what "
                    "is written as an intersection of half-walls can be meshed: `a & b`, or `a - b` for "
                    "a `b` of one wall"
                )
            return sorted(conjunction)
        labels = self.labels()
        inside = np.flatnonzero(labels > 0)
        if not len(inside):
            raise InvalidArgument("the solid is empty: no point has the signs that it asks for")
        if (labels != 0).all():
            raise InvalidArgument("the solid is all of space: it has no walls")
        signs = inside[:, None] >> np.arange(len(self.walls)) & 1
        fixed = {
            i: bool(signs[0, i])
            for i in range(len(self.walls))
            if (signs[:, i] == signs[0, i]).all()
        }
        codes = np.arange(len(labels))

        def is_all(some: dict[int, bool]) -> bool:
            """Whether points that have these signs are all inside."""
            at = np.ones(len(codes), dtype=bool)
            for i, positive in some.items():
                at &= (codes >> i & 1).astype(bool) == positive
            return not (labels[at] == 0).any()

        if not is_all(fixed):
            raise why_not(_in_words(len(self.walls), fixed))
        for i in reversed(sorted(fixed)):
            fewer = {j: positive for j, positive in fixed.items() if j != i}
            if is_all(fewer):
                fixed = fewer
        return sorted(fixed.items())

    def _conjunction(self, node: Node, positive: bool = True) -> set[Literal] | None:
        """The signs of which the node, or its complement, is the conjunction; None if it is none."""
        if isinstance(node, Half):
            i, same = self._number(node.wall)
            return {(i, same == positive)}
        if isinstance(node, Not):
            return self._conjunction(node.of, not positive)
        if isinstance(node, Table) or isinstance(node, All) != positive and len(node.parts) != 1:
            return None
        signs: set[Literal] = set()
        for part in node.parts:
            some = self._conjunction(part, positive)
            if some is None:
                return None
            signs |= some
        return signs if not any((i, not sign) in signs for i, sign in signs) else None

    def _impossible(self) -> Iterator[list[Literal]]:
        """Signs that no point has together: of parallel planes, of balls, of planes beyond a hull."""
        planes = [(i, wall) for i, wall in enumerate(self.walls) if isinstance(wall, Plane)]
        for a, (i, one) in enumerate(planes):
            for j, other in planes[:a]:
                yield from _of_parallels(i, one, j, other)
        balls = [(i, *ball) for i, wall in enumerate(self.walls) for ball in _ball(wall)]
        for a, (i, centre, radius) in enumerate(balls):
            for j, middle, wide in balls[:a]:
                apart = float(norms(centre - middle))
                if apart >= radius + wide:
                    yield [(i, True), (j, True)]
                elif apart <= abs(radius - wide):
                    small, large = (i, j) if radius < wide else (j, i)
                    yield [(small, True), (large, False)]
        for node in _bodies(self.tree):
            body = self._conjunction(node)
            if body is None:
                continue
            for i, plane in planes:
                for literal in _cut(node.hull, i, plane):
                    if (i, not literal[1]) not in body:
                        yield [*sorted(body), literal]


def needed(walls: list[Wall], labels: Labels) -> tuple[list[Wall], Labels]:
    """The walls, and labels of their signs, without those whose sign tells nothing.

    A wall tells nothing if no two points that differ in its sign alone have different labels. Of
    those that formulas choose their branches by, most do not.
    """
    kept = list(walls)
    for i in reversed(range(len(walls))):
        below, above = np.moveaxis(labels.reshape(-1, 2, 1 << i), 1, 0)
        if ((below == above) | (below < 0) | (above < 0)).all():
            labels = np.maximum(below, above).ravel()
            del kept[i]
    return kept, labels


def why_not(what: str) -> NoIntersection:
    return NoIntersection(
        f"the solid is no intersection of half-walls: {what}. It can be meshed; what has half-walls, to "
        "cut another manifold by, are intersections (&), and differences from which a single wall is "
        "taken, as of a cylinder that goes through"
    )


def simplified(node: Node, known: tuple[All, ...] = ()) -> Node:
    """The same solid, without planes that pass by the bodies which it is intersected with."""
    if isinstance(node, Half):
        if isinstance(node.wall, Plane):
            for body in known:
                for _, positive in _cut(body.hull, 0, node.wall):
                    return Either(()) if positive else All(())
        return node
    if isinstance(node, Not):
        inner = simplified(node.of, known)
        return node if inner is node.of else _short(Not(inner))
    if isinstance(node, Either):
        return _short(Either(tuple(simplified(part, known) for part in node.parts)))
    if isinstance(node, All):
        if node.hull is not None:
            kept = tuple(simplified(part, known) for part in node.parts)
            changed = any(part is not was for part, was in zip(kept, node.parts))
            # What is left is that body no longer, but where it is intersected with the others.
            return _short(All(kept)) if changed else node
        own, parts = tuple(_flat(node)), []
        for number, part in enumerate(own):
            # A body may go by later ones alone: two that are the same must not both be left out.
            others = own[number + 1 :] if _is_body(part) else own
            parts.append(simplified(part, (*known, *filter(_is_body, others))))
        return _short(All(tuple(parts)))
    return node


def _is_body(node: Node) -> bool:
    return isinstance(node, All) and node.hull is not None


def _flat(node: All) -> Iterator[Node]:
    """The parts of an intersection, and those of intersections among them that have no hull."""
    for part in node.parts:
        if isinstance(part, All) and part.hull is None:
            yield from _flat(part)
        else:
            yield part


def _short(node: Node) -> Node:
    """Without parts that are nothing, or all of space."""
    if isinstance(node, Not):
        if isinstance(node.of, (All, Either)) and not node.of.parts:
            return Either(()) if isinstance(node.of, All) else All(())
        return node
    same: Any = All if isinstance(node, All) else Either
    opposite: Any = Either if isinstance(node, All) else All
    if any(isinstance(part, opposite) and not part.parts for part in node.parts):
        return opposite(())
    parts = tuple(p for p in node.parts if not (isinstance(p, same) and not p.parts))
    return same(parts)


def _tables(node: Node) -> Iterator[Table]:
    if isinstance(node, Table):
        yield node
    elif isinstance(node, Not):
        yield from _tables(node.of)
    elif isinstance(node, (All, Either)):
        for part in node.parts:
            yield from _tables(part)


def _bodies(node: Node) -> Iterator[All]:
    """The intersections that lie in a hull, wherever they are in the tree."""
    if _is_body(node):
        yield node
    if isinstance(node, Not):
        yield from _bodies(node.of)
    elif isinstance(node, (All, Either)):
        for part in node.parts:
            yield from _bodies(part)


def _ball(wall: Wall) -> Iterator[tuple[Array, float]]:
    """Centre and radius of a wall that is a sphere."""
    if isinstance(wall, Placed) and isinstance(wall.profile, Tube) and wall.profile.across is None:
        yield wall.motion.shift, wall.motion.scale * wall.profile.radius


def _cut(hull: Body | None, i: int, plane: Plane) -> Iterator[Literal]:
    """The sign of plane i that no point of the hull has, if one of them is not there."""
    if hull is None:
        return
    size = _ROUNDING * max(1.0, abs(plane.level))
    if -hull.support(-plane.normal) >= plane.level - size:
        yield i, False
    elif hull.support(plane.normal) <= plane.level + size:
        yield i, True


def _of_parallels(i: int, one: Plane, j: int, other: Plane) -> Iterator[list[Literal]]:
    for sign in (1.0, -1.0):
        if np.abs(one.normal - sign * other.normal).max() <= _ROUNDING:
            # Along one's normal, `other` begins or ends at this level.
            level = sign * other.level
            beyond = sign > 0  # the side of `other` that lies at higher levels
            if one.level > level:
                yield [(i, True), (j, not beyond)]
            else:
                yield [(i, False), (j, beyond)]


def _in_words(walls: int, fixed: dict[int, bool]) -> str:
    if not fixed:
        return f"of its {walls} walls none has one sign throughout the inside, as in a union"
    return (
        f"of its {walls} walls {len(fixed)} have one sign throughout the inside, and these signs do "
        "not tell it from what is outside, as where two solids are joined, or a corner is cut away"
    )


def check_count(literals: list[Literal]) -> None:
    """Raises: InvalidArgument."""
    if len(literals) > _MOST:
        raise InvalidArgument(f"the solid has {len(literals)} walls; there may be {_MOST}")
