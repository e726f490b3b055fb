"""Solids of formulas with minimum, maximum, abs, clip, where and norms: their smooth pieces as walls.

1. The formula is traced: it is known with its derivatives and its branches.
2. A branch matters if the formula has a crease on its zero set where the branch changes from one choice
   to the other. The others stay in the walls: a rounded box is one wall.
3. What the formula is between the branches that matter, as it occurs just inside of its zero set, are
   the pieces, which are smooth where they are needed: the walls.
4. What their signs say of the inside is read off many points. Where they do not tell it from the
   outside, selectors of branches become walls too, the best first.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Callable, Literal

import numpy as np

from .._rows import Array, Flags, apply, norms, product, transposed
from ..errors import InvalidArgument, OracleError
from . import _formulas as formulas
from ._formulas import BRANCHES, Node, Program
from ._motions import Motion, corners, vector
from ._signs import MOST_IN_TABLES, All, Arrangement, Half, Not, Table
from ._solid import Solid
from ._tracing import formula_of
from ._walls import Placed, Profile

_POINTS = 40_000  # of the box that show where the inside is
_SURFACE = 6_000  # points of the zero set
_NEARBY = 0.02  # of the box's diagonal: how far from these more points are looked at
_STARTS, _STEPS = 400, 30  # of Newton's method, to a crease
_ASIDE = 1e-6  # of the diagonal, to either side of a crease
_CREASE = 0.05  # gradients that differ by more of their size, at more than
_SHARE = 0.02  # of the points of a crease, make it one
_MOST_PIECES = 62  # sign vectors are numbers of 64 bits
_ROUNDING = 1e-9  # of what a wall is usually: so near zero its sign is not gone by
_JUMP = 1e-6  # of what the formula is usually, where it changes its sign without being zero

Inside = Literal["negative", "positive"]


def traced(
    f: Callable[[Any], Any], box: Any, *, inside: Inside = "negative", seed: int = 0
) -> Solid:
    """The solid of a function written in numpy, such as a signed distance with minimum and maximum.

    Its creases become edges. f is called once, with symbols in place of points, and may be made of
    sums, products, powers, numpy's smooth functions, minimum, maximum, abs, clip, where, sign,
    linalg.norm, sums and extrema along axis=1, stack and x @ A. Where the pieces lie is read off
    random points of the box: what is smaller than a few hundredths of it may be missed. Every point
    that a server asks about is compared with f itself.

    Args:
      f: (n, d) -> (n,), continuous where it is zero.
      box: (lower (d,), upper (d,)) around the solid. What leaves it has to be cut by a Box, or other
        solids, within it.
      inside: the sign of f inside: "negative", as of signed distances, or "positive".
      seed: of the random points.

    Raises: InvalidArgument, where f cannot be traced, saying by what.
    """
    lower = vector(box[0], "the lower corner")
    upper, d = vector(box[1], "the upper corner", len(lower)), len(lower)
    if not (lower < upper).all():
        raise InvalidArgument(f"box is empty: lower {lower}, upper {upper}")
    if inside not in ("negative", "positive"):
        raise InvalidArgument(f"inside has to be 'negative' or 'positive', and is {inside!r}")
    if not callable(f):
        raise InvalidArgument(f"traced takes a function, and has {f!r}")
    try:
        root = formula_of(f, d)
        if inside == "negative":
            root = formulas.make("negative", root)
        return _Search(root, lower, upper, np.random.default_rng(seed)).solid()
    finally:
        formulas.forget()


@dataclasses.dataclass(frozen=True)
class Formula(Profile):
    """A wall of a formula."""

    program: Program
    gradients: Program

    @staticmethod
    def of(root: Node, d: int) -> Formula:
        return Formula(Program([root]), Program(formulas.gradient(root, d)))

    def values(self, points: Array) -> Array:
        return self.program(points)[:, 0]

    def slopes(self, points: Array) -> Array:
        return self.gradients(points)

    def __repr__(self) -> str:
        return "a piece of a traced function"


class _Witness:
    """The formula itself, with which the walls that were made of it are compared."""

    def __init__(
        self,
        value: Program,
        usual: float,
        node: Any,
        motion: Motion,
        box: tuple[Array, Array] | None,
    ) -> None:
        self._value, self._usual, self._node, self._motion = value, usual, node, motion
        self._box = box  # beyond which the walls are not said to go on
        self._arrangement = Arrangement(node)

    def moved(self, motion: Motion) -> _Witness:
        after = motion.after(self._motion)
        return _Witness(self._value, self._usual, self._node.moved(motion), after, self._box)

    def insist(self, points: Array) -> None:
        """Raises: OracleError, where signs of walls and the formula disagree about the inside.

        Where one wall is zero, and its sign matters, the formula is zero, too.
        """
        x = self._motion.back(points)
        if self._box is not None:
            within = ((x >= self._box[0]) & (x <= self._box[1])).all(axis=1)
            x, points = x[within], points[within]
        if not len(x):
            return
        f = self._value(x)[:, 0] / self._usual
        walls = self._arrangement.walls
        values = np.stack([wall(points) for wall in walls], axis=1)
        small = np.abs(values) <= _ROUNDING * self._usual * self._motion.scale
        inside = self._arrangement.inside_at(values > 0)
        wrong = ~small.any(axis=1) & (np.abs(f) > _ROUNDING) & (inside != (f > 0))
        on_one = small.sum(axis=1) == 1
        flipped = self._arrangement.inside_at((values > 0) ^ small)
        wrong |= on_one & (inside != flipped) & (np.abs(f) > _JUMP)
        if wrong.any():
            row = int(np.flatnonzero(wrong)[0])
            raise OracleError(
                f"the walls that were traced are not those of the function: at {points[row].tolist()} it "
                f"is {f[row] * self._usual:.3g}, and they say otherwise. Something there is smaller than "
                "what random points of the box show: trace in a smaller box, or give the walls by "
                "Implicit and &",
                "ORACLE_BAD_CONORMAL",
            )


class _Search:
    """For the walls of a formula that is positive inside."""

    def __init__(self, root: Node, lower: Array, upper: Array, random: np.random.Generator) -> None:
        self._root, self._lower, self._upper, self._random = root, lower, upper, random
        self._d, self._size = len(lower), float(norms(upper - lower))
        self._value = Program([root])
        points = lower + random.random((_POINTS, self._d)) * (upper - lower)
        values = self._value(points)[:, 0]
        if not np.isfinite(values).all():
            raise InvalidArgument(
                f"the function is not finite at {points[np.argmin(np.isfinite(values))].tolist()}"
            )
        self._usual = float(np.median(np.abs(values)))
        within = values > 0
        if within.all() or not within.any():
            raise InvalidArgument(
                f"the function has one sign at all of {_POINTS:,} points of the box, so that no solid is "
                f"seen there: it is {'inside' if within.all() else 'outside'} of it by `inside`"
            )
        self._just_inside = self._zeros(points[within], points[~within])
        near = self._just_inside + _NEARBY * self._size * random.standard_normal(
            self._just_inside.shape
        )
        near = near[self._in_box(near)]
        self._points = np.concatenate([points, near])
        self._within = np.concatenate([within, self._value(near)[:, 0] > 0])
        self._pieces: list[Node] = []
        self._signs: list[Flags] = []  # of the pieces, at the points

    def _in_box(self, points: Array) -> Flags:
        return np.asarray(((points >= self._lower) & (points <= self._upper)).all(axis=1))

    def _zeros(self, inside: Array, outside: Array) -> Array:
        """Points just inside of the zero set: of segments, by bisection."""
        a = inside[self._random.integers(len(inside), size=_SURFACE)]
        b = outside[self._random.integers(len(outside), size=_SURFACE)]
        for _ in range(44):
            middle = (a + b) / 2
            positive = (self._value(middle)[:, 0] > 0)[:, None]
            a, b = np.where(positive, middle, a), np.where(positive, b, middle)
        return a

    def solid(self) -> Solid:
        branches = [n for n in formulas.in_order([self._root]) if n.op in BRANCHES]
        selectors = [branch.selector() for branch in branches]
        chosen = Program(selectors)(self._just_inside) > 0
        creased = [k for k in range(len(branches)) if self._has_crease(selectors[k], chosen[:, k])]
        self._begin_pieces(branches, chosen, creased)
        self._tell_apart(branches, chosen, creased)
        if len(self._pieces) > _MOST_PIECES:
            raise InvalidArgument(
                f"the function has {len(self._pieces)} smooth pieces, and there may be {_MOST_PIECES}"
            )
        codes, labels = self._labels()
        while self._impure(codes, labels):
            best = self._best_selector([selectors[k] for k in creased])
            if best is None:
                wrong = self._points[np.flatnonzero(self._unlike(codes, labels))[0]]
                raise InvalidArgument(
                    "the signs of the function's smooth pieces do not tell its inside from its outside, "
                    f"as at {wrong.tolist()}: give the solid's walls, by Implicit and &"
                )
            self._take(best)
            codes, labels = self._labels()
        return self._made(labels)

    def _begin_pieces(self, branches: list[Node], chosen: Flags, creased: list[int]) -> None:
        """The pieces between some branches, to which those are added that are in their way."""
        while True:
            self._add_pieces(branches, chosen, creased)
            more = [k for k in self._in_the_way(branches) if k not in creased]
            if not more:
                return
            creased += more

    def _tell_apart(self, branches: list[Node], chosen: Flags, creased: list[int]) -> None:
        """Makes walls each of the places where a piece is zero, where it does not tell what is between
        them: of the branches within pieces those that leave the fewest wrong labels."""
        while before := self._impure(*self._labels()):
            trials = [(before, creased)]
            for k in self._branches_of(branches, *self._pieces):
                self._add_pieces(branches, chosen, [*creased, k])
                trials.append((self._impure(*self._labels()), [*creased, k]))
            after, creased = min(trials, key=lambda trial: trial[0])
            self._begin_pieces(branches, chosen, creased)
            if after == before:
                return

    # Branches that matter.

    def _has_crease(self, selector: Node, chosen: Flags) -> bool:
        """Whether the zero set has a crease, or a step, where the selector is zero."""
        if chosen.all() or not chosen.any():
            return False
        both = Program([self._root, selector])
        slopes = [Program(formulas.gradient(node, self._d)) for node in (self._root, selector)]
        values = np.abs(both(self._just_inside))
        if (values[:, 0] > _JUMP * self._usual).any():
            return True  # it is not continuous there
        steep = norms(slopes[1](self._just_inside))
        away = np.divide(values[:, 1], steep, out=np.full(len(steep), np.inf), where=steep > 0)
        places = self._onto(both, slopes, self._just_inside[np.argsort(away)[:_STARTS]])
        return self._jumps(places, *slopes)

    def _jumps(self, places: Array, slope: Program, across: Program) -> bool:
        """Whether a gradient is another one on the other side of the places, in the direction across."""
        direction = across(places)
        steep = norms(direction)
        places, direction = places[steep > 0], direction[steep > 0] / steep[steep > 0, None]
        if not len(places):
            return False
        aside = _ASIDE * self._size * direction
        one, other = slope(places + aside), slope(places - aside)
        sizes = np.maximum(norms(one), norms(other))
        jumps = norms(one - other) > _CREASE * np.where(sizes > 0, sizes, 1.0)
        return bool(jumps.mean() > _SHARE)

    def _onto(self, zeros: Program, slopes: list[Program], points: Array) -> Array:
        """Newton's method to where all formulas are zero, from points near; those that came there."""
        x = points
        for _ in range(_STEPS):
            matrix = np.stack([slope(x) for slope in slopes], axis=1)
            gram = product(matrix, transposed(matrix))
            small = 1e-12 * np.trace(gram, axis1=1, axis2=2)[:, None, None]
            gram += small * np.eye(len(slopes)) + 1e-300
            try:
                step = np.linalg.solve(gram, zeros(x)[..., None])[..., 0]
            except np.linalg.LinAlgError:
                break
            move = np.nan_to_num(apply(transposed(matrix), step))
            far = 0.05 * self._size / np.maximum(norms(move), 1e-300)
            x = x - move * np.minimum(1.0, far)[:, None]
        zero = (np.abs(zeros(x)) <= 1e-9 * max(self._usual, 1e-300)).all(axis=1)
        return x[zero & self._in_box(x)]

    def _in_the_way(self, branches: list[Node]) -> list[int]:
        """Branches within pieces, with which these cannot be walls.

        Those of two pieces that are zero on the same part of the surface, where other parts of it keep
        them different: the upper sides of two slabs in one plane. And those with a crease that is on
        the surface in a corner alone: a pyramid's four sides, by two absolute values.
        """
        inner = [set(self._branches_of(branches, piece)) for piece in self._pieces]
        values = np.abs(Program(self._pieces)(self._just_inside))
        zero = values <= _ROUNDING * self._usual
        shared = zero[zero.sum(axis=1) > 1].any(axis=0)
        found = {k for i in np.flatnonzero(shared) for k in inner[i]}
        for i, piece in enumerate(self._pieces):
            for k in inner[i] - found:
                if self._ends_in_a_corner(piece, branches[k].selector(), values[:, i]):
                    found.add(k)
        return sorted(found)

    def _branches_of(self, branches: list[Node], *pieces: Node) -> list[int]:
        """Which branches there are in pieces."""
        inner = {id(n) for n in formulas.in_order(pieces) if n.op in BRANCHES}
        return [k for k, branch in enumerate(branches) if id(branch) in inner]

    def _ends_in_a_corner(self, piece: Node, selector: Node, values: Array) -> bool:
        """Whether the piece has a crease by the selector where the surface is."""
        three = [piece, selector, self._root]
        slopes = [Program(formulas.gradient(node, self._d)) for node in three]
        near = values + np.abs(Program([selector])(self._just_inside)[:, 0])
        starts = self._just_inside[np.argsort(near)[:_STARTS]]
        return self._jumps(self._onto(Program(three), slopes, starts), *slopes[:2])

    # Pieces.

    def _add_pieces(self, branches: list[Node], chosen: Flags, creased: list[int]) -> None:
        self._pieces, self._signs = [], []
        groups, which = np.unique(chosen[:, creased], axis=0, return_inverse=True)
        which = np.ravel(which)
        members: dict[int, tuple[Node, list[int]]] = {}
        for number, group in enumerate(groups):
            piece = formulas.frozen(
                self._root, {id(branches[k]): bool(v) for k, v in zip(creased, group)}
            )
            rows = np.flatnonzero(which == number).tolist()
            if np.abs(Program([piece])(self._just_inside[rows])).min() > _JUMP * self._usual:
                continue  # the formula has a step there: a selector is the wall
            like = self._like(piece, [node for node, _ in members.values()])
            key = id(piece) if like is None else id(like)
            members.setdefault(key, (piece, []))[1].extend(rows)
        # A distance to a box is a norm outside of it, and not inside: the zero set is where these
        # branches change.
        steep = Program(formulas.gradient(self._root, self._d))(self._just_inside)
        away = _ASIDE * self._size * steep / np.maximum(norms(steep), 1e-300)[:, None]
        beyond = self._just_inside - away
        changes = (Program([branch.selector() for branch in branches])(beyond) > 0) != chosen
        for piece, rows in sorted(members.values(), key=lambda m: -len(m[1])):
            for part in self._crossed(piece, np.array(rows), beyond, changes):
                self._take(self._extended(piece, part))

    def _crossed(self, piece: Node, rows: Any, beyond: Array, changes: Flags) -> list[Any]:
        """The rows in parts, so that the piece, extended by each, is negative beyond the zero set there.

        A norm is not, where other parts need it as such: -norm of what is frozen to one component
        here, and to several there.
        """
        lost = Program([self._extended(piece, rows)])(beyond[rows])[:, 0] > 0
        if not lost.any():
            return [rows]
        _, which = np.unique(changes[rows[lost]], axis=0, return_inverse=True)
        apart = [rows[lost][np.ravel(which) == i] for i in range(int(np.max(which)) + 1)]
        return ([] if lost.all() else [rows[~lost]]) + sorted(apart, key=len, reverse=True)

    def _extended(self, piece: Node, rows: Any) -> Node:
        """The piece with those choices for good that are the same wherever it is needed.

        Where it is not needed it is smooth then, too, as far as can be: Newton's method and
        differences see both sides of an edge.
        """
        while True:
            inner = [n for n in formulas.in_order([piece]) if n.op in BRANCHES]
            if not inner:
                return piece
            chosen = Program([n.selector() for n in inner])(self._just_inside[rows]) > 0
            same = (chosen == chosen[0]).all(axis=0)
            if not same.any():
                return piece
            choices = {id(n): bool(c) for n, c, s in zip(inner, chosen[0], same) if s}
            piece = formulas.frozen(piece, choices)  # where norms of one component may be left

    def _take(self, piece: Node) -> None:
        if self._like(piece, self._pieces) is None:
            self._pieces.append(piece)
            self._signs.append(Program([piece])(self._points)[:, 0] > 0)

    def _like(self, piece: Node, others: list[Node]) -> Node | None:
        """One of the others that has the same values, or these times a number."""
        if any(node is piece for node in others):
            return piece
        some = self._points[:200]
        values = Program([piece, *others])(some).T
        for node, theirs in zip(others, values[1:]):
            square = theirs @ theirs
            times = values[0] @ theirs / square if square > 0 else 0.0
            close = np.isclose(values[0], times * theirs, rtol=1e-9, atol=1e-12 * self._usual)
            if times != 0 and close.all():
                return node
        return None

    # Labels.

    def _labels(self) -> tuple[Any, dict[int, bool]]:
        """The points' sign vectors, and of each that occurs whether most of its points are inside."""
        codes = np.zeros(len(self._points), dtype=np.int64)
        for bit, signs in enumerate(self._signs):
            codes |= signs.astype(np.int64) << bit
        found, which, counts = np.unique(codes, return_inverse=True, return_counts=True)
        inside = np.bincount(np.ravel(which), self._within, len(found))
        return codes, {int(c): bool(2 * i > n) for c, i, n in zip(found, inside, counts)}

    def _unlike(self, codes: Any, labels: dict[int, bool]) -> Flags:
        found, which = np.unique(codes, return_inverse=True)
        return np.asarray(
            np.array([labels[int(c)] for c in found])[np.ravel(which)] != self._within
        )

    def _impure(self, codes: Any, labels: dict[int, bool]) -> int:
        return int(np.count_nonzero(self._unlike(codes, labels)))

    def _best_selector(self, selectors: list[Node]) -> Node | None:
        """That whose sign leaves the fewest points with a wrong label, if it is of any use."""
        least, best = self._impure(*self._labels()), None
        for selector in selectors:
            before = len(self._pieces)
            self._take(selector)
            if len(self._pieces) > before:
                wrong = self._impure(*self._labels())
                if wrong < least:
                    least, best = wrong, selector
                self._pieces.pop()
                self._signs.pop()
        return best

    def _made(self, labels: dict[int, bool]) -> Solid:
        walls = [Placed(Formula.of(p, self._d), Motion.none(self._d)) for p in self._pieces]
        literals = _literals(labels, len(walls))
        node: Any
        if literals is not None:
            halves = [(Half(walls[i]), positive) for i, positive in literals]
            node = All(tuple(half if positive else Not(half) for half, positive in halves))
        elif len(walls) <= MOST_IN_TABLES:
            table = np.full(1 << len(walls), -1, dtype=np.int8)
            for code, is_inside in labels.items():
                table[code] = is_inside
            node = Table(tuple(walls), table)
        else:
            raise InvalidArgument(
                f"the function has {len(walls)} smooth pieces, and is no intersection of their "
                f"half-spaces: tables of signs are of {MOST_IN_TABLES} at most"
            )
        ends = self._is_within_box()
        box = (self._lower, self._upper) if ends else None
        witness = _Witness(self._value, self._usual, node, Motion.none(self._d), box)
        body = corners(self._lower, self._upper)
        return Solid(All((node,), body) if ends else node, self._d, (witness,))

    def _is_within_box(self) -> bool:
        """Whether the solid ends in the box."""
        random = self._random.random((_SURFACE, self._d))
        side = self._random.integers(self._d, size=_SURFACE)
        random[np.arange(_SURFACE), side] = self._random.integers(2, size=_SURFACE)
        points = self._lower + random * (self._upper - self._lower)
        return not (self._value(points)[:, 0] > 0).any()


def _literals(labels: dict[int, bool], walls: int) -> list[tuple[int, bool]] | None:
    """The signs that tell the inside from all else that occurs, as few as will do; None: none do."""
    codes = np.array(list(labels), dtype=np.int64)
    inside = np.array(list(labels.values()))
    signs = (codes[:, None] >> np.arange(walls) & 1).astype(bool)
    first = signs[inside][0]
    fixed = [i for i in range(walls) if (signs[inside][:, i] == first[i]).all()]

    def is_all(some: list[int]) -> bool:
        return bool((signs[:, some] == first[some]).all(axis=1)[~inside].sum() == 0)

    if not is_all(fixed):
        return None
    for i in reversed(fixed.copy()):
        fewer = [j for j in fixed if j != i]
        if is_all(fewer):
            fixed = fewer
    return [(i, bool(first[i])) for i in fixed]
