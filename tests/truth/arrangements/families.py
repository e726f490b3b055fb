"""Arrangements whose regions are known, in random places, sizes and turns."""

from __future__ import annotations

import dataclasses
from typing import Any, Callable

import numpy as np
import stellate
from judge import Truth
from stellate import oracles
from stellate import solids as s

norm = np.linalg.norm
_THROWN = 400_000
Function = Callable[[np.ndarray], np.ndarray]


@dataclasses.dataclass(frozen=True)
class Motion:
    """x -> scale * turn @ x + shift"""

    turn: np.ndarray
    scale: float
    shift: np.ndarray

    @staticmethod
    def random(rng: np.random.Generator, d: int) -> Motion:
        turn = np.linalg.qr(rng.normal(size=(d, d)))[0]
        return Motion(turn, float(10 ** rng.uniform(-2, 2)), rng.normal(size=d))

    def back(self, x: np.ndarray) -> np.ndarray:
        return ((x - self.shift) / self.scale) @ self.turn

    def forth(self, x: np.ndarray) -> np.ndarray:
        return self.scale * (x @ self.turn.T) + self.shift

    def solid(self, solid: s.Solid) -> s.Solid:
        return solid.scaled(self.scale).rotated(self.turn).at(self.shift)

    def function(self, f: Function, gradient: Function | None = None) -> tuple[Function, Any]:
        if gradient is None:
            return lambda x: f(self.back(x)), None
        return lambda x: f(
            self.back(x)
        ), lambda x: gradient(self.back(x)) @ self.turn.T / self.scale


@dataclasses.dataclass(frozen=True)
class Case:
    """What is asked for, in the world's coordinates, and what is known of it in its own.

    Attributes:
      finest, coarsest: shares of the truth's size that epsilon is chosen between.
      alone: whether the boundary may be asked for alone.
    """

    oracle: Any
    truth: Truth
    motion: Motion
    finest: float
    coarsest: float
    alone: bool = True


# Walls and regions, written without the package.


def in_ball(centre: Any, radius: float) -> Function:
    return lambda x: radius - norm(x - np.asarray(centre), axis=1)


def in_box(lower: Any, upper: Any) -> list[Function]:
    sides: list[Function] = []
    for i, (a, b) in enumerate(zip(lower, upper)):
        sides += [lambda x, i=i, a=a: x[:, i] - a, lambda x, i=i, b=b: b - x[:, i]]
    return sides


def in_rod(axis: int, radius: float) -> Function:
    return lambda x: radius - norm(np.delete(x, axis, axis=1), axis=1)


def thrown(label: Function, size: float, d: int, labels: Any) -> dict[int, tuple[float, float]]:
    """Volumes by points in a cube of half a side `size`, with four standard deviations."""
    x = (np.random.default_rng(7).random((_THROWN, d)) * 2 - 1) * size
    have, whole = label(x), (2 * size) ** d
    shares = {one: float((have == one).mean()) for one in labels}
    return {
        one: (whole * p, 4 * whole * float(np.sqrt(p * (1 - p) / _THROWN)))
        for one, p in shares.items()
    }


def arrangement(
    rng: np.random.Generator,
    materials: dict[str, s.Solid],
    walls: list[Function],
    label: Callable[[np.ndarray], np.ndarray],
    topology: Any,
    *,
    bend: float,
    size: float,
    finest: float,
    coarsest: float,
    pinched: bool = False,
) -> Case:
    """Of solids; `label` takes the signs of the walls, (n, w) bool."""
    d = next(iter(materials.values())).dimension
    motion = Motion.random(rng, d)

    def values(x: np.ndarray) -> np.ndarray:
        return np.stack([wall(x) for wall in walls], axis=1)

    def at(x: np.ndarray) -> np.ndarray:
        return np.asarray(label(values(x) > 0)).astype(int)

    moved = {name: motion.solid(solid) for name, solid in materials.items()}
    oracle = next(iter(moved.values())) if len(moved) == 1 else s.Labels(**moved)
    truth = Truth(values, at, bend, topology, thrown(at, size, d, topology), pinched)
    return Case(oracle, truth, motion, finest, coarsest)


def _two_balls(rng: np.random.Generator, d: int) -> tuple[s.Solid, s.Solid, list[Function]]:
    """That cross at 60 to 100 degrees."""
    while True:
        r, apart = rng.uniform(0.9, 1), rng.uniform(0.95, 1.35)
        angle = np.degrees(np.arccos((1 + r * r - apart**2) / (2 * r)))
        if 60 < angle < 100:
            break
    a, b = np.zeros(d), np.zeros(d)
    a[0], b[0] = -apart / 2, apart / 2
    return s.Ball(1, at=a), s.Ball(r, at=b), [in_ball(a, 1), in_ball(b, r)]


def balls(kind: str, d: int) -> Callable[[np.random.Generator], Case]:
    def make(rng: np.random.Generator) -> Case:
        a, b, walls = _two_balls(rng, d)
        ring = 0 if d == 2 else 2  # of two pieces that touch in two points, or a circle
        materials, label, topology = {
            "union": ({"part": a | b}, lambda g: g.any(axis=1), {1: (1, 1)}),
            "difference": ({"part": a - b}, lambda g: g[:, 0] & ~g[:, 1], {1: (1, 1)}),
            "venn": (
                {"a": a, "b": b, "both": a & b},
                lambda g: np.where(g.all(axis=1), 3, g[:, 0] + 2 * g[:, 1]),
                {1: (1, 1), 2: (1, 1), 3: (1, 1)},
            ),
            "xor": ({"part": a ^ b}, lambda g: g[:, 0] ^ g[:, 1], {1: (1, ring)}),
        }[kind]
        return arrangement(
            rng, materials, walls, label, topology,
            bend=0.9, size=1.8, finest=0.05 if d == 2 else 0.15, coarsest=0.35,
            pinched=kind == "xor",
        )  # fmt: skip

    return make


def inclusion(d: int, grain: str) -> Callable[[np.random.Generator], Case]:
    """A ball in a cube, or a cube in a ball."""

    def make(rng: np.random.Generator) -> Case:
        around = (1, 2) if d == 3 else (1, 0)
        if grain == "ball":
            r, at = rng.uniform(0.5, 0.6), rng.uniform(-0.15, 0.15, d)
            materials = {"cube": s.Box([-1] * d, [1] * d), "grain": s.Ball(r, at=at)}
            walls = [*in_box([-1] * d, [1] * d), in_ball(at, r)]
            size, bend = 1.1, 0.5

            def label(g: np.ndarray) -> np.ndarray:
                return g[:, : 2 * d].all(axis=1) * (1 + g[:, 2 * d])

        else:
            half = rng.uniform(0.35, 0.5, d)
            materials = {"ball": s.Ball(1.1, at=np.zeros(d)), "cube": s.Box(-half, half)}
            walls = [*in_box(-half, half), in_ball(np.zeros(d), 1.1)]
            size, bend = 1.15, 1.1

            def label(g: np.ndarray) -> np.ndarray:
                return g[:, 2 * d] * (1 + g[:, : 2 * d].all(axis=1))

        return arrangement(
            rng, materials, walls, label, {1: (1, around[1]), 2: (1, 1)},
            bend=bend, size=size, finest=0.06 if d == 2 else 0.15, coarsest=0.2,
        )  # fmt: skip

    return make


def phases(count: int, d: int) -> Callable[[np.random.Generator], Case]:
    """Cells of centres, in a ball: three meet in an edge, or a point of the plane, four in a corner."""

    def make(rng: np.random.Generator) -> Case:
        corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3)
        if count < 4:
            turns = 2 * np.pi * np.arange(count) / count
            corners = np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=1)
        centres = 0.8 * corners[:count, :d] + rng.uniform(-0.1, 0.1, (count, d))
        pairs = [(i, j) for i in range(count) for j in range(i + 1, count)]

        def values(x: np.ndarray) -> np.ndarray:
            squares = ((x[:, None] - centres) ** 2).sum(axis=2)
            planes = [
                (squares[:, j] - squares[:, i]) / (2 * norm(centres[i] - centres[j]))
                for i, j in pairs
            ]
            return np.stack([*planes, 1 - norm(x, axis=1)], axis=1)

        def label(x: np.ndarray) -> np.ndarray:
            squares = ((x[:, None] - centres) ** 2).sum(axis=2)
            return np.where(norm(x, axis=1) < 1, 1 + squares.argmin(axis=1), 0)

        motion = Motion.random(rng, d)
        functions = [
            motion.function(lambda x, c=c: -((x - c) ** 2).sum(axis=1), lambda x, c=c: -2 * (x - c))
            for c in centres
        ]
        several = s.Phases(*(f for f, _ in functions), gradients=[g for _, g in functions])
        topology = {i + 1: (1, 1) for i in range(count)}
        truth = Truth(values, label, 1.0, topology, thrown(label, 1.05, d, topology))
        oracle = several & motion.solid(s.Ball(1, at=np.zeros(d)))
        return Case(oracle, truth, motion, 0.06 if d == 2 else 0.18, 0.3, alone=False)

    return make


def l_shape(rng: np.random.Generator) -> Case:
    notch = rng.uniform(-0.3, 0.3, 2)
    part = s.Box([-1, -1], [1, 1]) - s.Box(notch, [1.5, 1.5])
    walls = [*in_box([-1, -1], [1, 1]), *in_box(notch, [1.5, 1.5])]
    return arrangement(
        rng, {"part": part}, walls, lambda g: g[:, :4].all(axis=1) & ~g[:, 4:].all(axis=1),
        {1: (1, 1)}, bend=np.inf, size=1.01, finest=0.06, coarsest=0.4,
    )  # fmt: skip


def cube_and_ball(kind: str) -> Callable[[np.random.Generator], Case]:
    def make(rng: np.random.Generator) -> Case:
        cube, sides = s.Box([-1] * 3, [1] * 3), in_box([-1] * 3, [1] * 3)
        r = rng.uniform(0.5, 0.65)
        # Where the ball's centre is on a side they cross squarely; inside it is a void.
        at = np.array([1.0, 0, 0]) if kind != "void" else np.zeros(3)
        at = at + rng.uniform(-0.1, 0.1, 3)
        walls, ball = [*sides, in_ball(at, r)], s.Ball(r, at=at)
        if kind == "plus":
            part, chi = cube | ball, 1
            return arrangement(
                rng, {"part": part}, walls, lambda g: g[:, :6].all(axis=1) | g[:, 6],
                {1: (1, chi)}, bend=r, size=1.8, finest=0.15, coarsest=0.25,
            )  # fmt: skip
        part, chi = cube - ball, 2 if kind == "void" else 1
        return arrangement(
            rng, {"part": part}, walls, lambda g: g[:, :6].all(axis=1) & ~g[:, 6],
            {1: (1, chi)}, bend=r, size=1.01, finest=0.15, coarsest=0.25,
        )  # fmt: skip

    return make


def ball_and_rod(rng: np.random.Generator) -> Case:
    """A ball drilled through, and what was drilled out."""
    r = rng.uniform(0.4, 0.5)
    ball, rod = s.Ball(1), s.Cylinder(r, axis="z")
    return arrangement(
        rng, {"ball": ball, "core": ball & rod}, [in_ball(np.zeros(3), 1), in_rod(2, r)],
        lambda g: g[:, 0] * (1 + g[:, 1]), {1: (1, 0), 2: (1, 1)},
        bend=0.4, size=1.01, finest=0.12, coarsest=0.2,
    )  # fmt: skip


def tree(rng: np.random.Generator) -> Case:
    """Six primitives, eleven walls: a cube and a ball, drilled three times, with a ball joined on."""
    r, hole, knob = rng.uniform(1.28, 1.33), rng.uniform(0.46, 0.52), rng.uniform(0.19, 0.23)
    at = np.full(3, r / np.sqrt(3))
    part = (s.Box([-1] * 3, [1] * 3) & s.Ball(r)) - s.Cylinder(hole, axis="x")
    part = part - s.Cylinder(hole, axis="y") - s.Cylinder(hole, axis="z") | s.Ball(knob, at=at)
    walls = [*in_box([-1] * 3, [1] * 3), in_ball(np.zeros(3), r)]
    walls += [*(in_rod(i, hole) for i in range(3)), in_ball(at, knob)]
    return arrangement(
        rng, {"part": part}, walls,
        lambda g: g[:, :7].all(axis=1) & ~g[:, 7:10].any(axis=1) | g[:, 10],
        {1: (1, -4)}, bend=knob, size=1.01, finest=0.09, coarsest=0.12,
    )  # fmt: skip


def lens(rng: np.random.Generator) -> Case:
    """What two balls have in common: an edge of 20 to 55 degrees, a circle of radius 1."""
    angle = np.radians(rng.uniform(20, 55))
    r = 1 / np.sin(angle / 2)
    a = np.array([0, 0, r * np.cos(angle / 2)])
    return arrangement(
        rng, {"lens": s.Ball(r, at=a) & s.Ball(r, at=-a)}, [in_ball(a, r), in_ball(-a, r)],
        lambda g: g.all(axis=1), {1: (1, 1)}, bend=r, size=1.01, finest=0.1, coarsest=0.4,
    )  # fmt: skip


def octahedron(rng: np.random.Generator) -> Case:
    """Four walls in each corner, and a grain."""
    normals = np.array([[a, b, c] for a in (1, -1) for b in (1, -1) for c in (1, -1)]) / np.sqrt(3)
    at = rng.uniform(-0.05, 0.05, 3)
    solid = s.HalfSpace(-normals[0], -1 / np.sqrt(3))
    for n in normals[1:]:
        solid = solid & s.HalfSpace(-n, -1 / np.sqrt(3))
    solid = solid & s.Box([-1.5] * 3, [1.5] * 3)
    walls: list[Function] = [lambda x, n=n: 1 / np.sqrt(3) - x @ n for n in normals]
    return arrangement(
        rng, {"around": solid, "grain": s.Ball(0.3, at=at)}, [*walls, in_ball(at, 0.3)],
        lambda g: g[:, :8].all(axis=1) * (1 + g[:, 8]), {1: (1, 2), 2: (1, 1)},
        bend=0.3, size=1.01, finest=0.1, coarsest=0.13,
    )  # fmt: skip


# Cut manifolds of other codimensions, and level sets.


def tori(k: int) -> Callable[[np.random.Generator], Case]:
    """k circles, of radius 1: label 2 where all of two or three coordinates are small, 1 elsewhere."""

    def make(rng: np.random.Generator) -> Case:
        d, levels = 2 * k, rng.uniform(-0.3, 0.3, 2)
        motion = Motion.random(rng, d)
        number = 2

        def coordinate(i: int) -> tuple[Function, Function]:
            along = np.eye(d)[2 * i]
            return motion.function(
                lambda x: x[:, 2 * i] - levels[i], lambda x: np.tile(along, (len(x), 1))
            )

        base = _circles(k, motion, _box_of(motion, d, np.sqrt(k)))
        moved = [coordinate(i) for i in range(number)]
        labels = [2] + [1] * (2**number - 1)
        oracle = oracles.Clipped(
            base, [f for f, _ in moved], gradients=[g for _, g in moved], labels=labels
        )

        def values(x: np.ndarray) -> np.ndarray:
            # Along M: arcs, as far as they are from the walls.
            angle = np.arctan2(x[:, 1::2], x[:, ::2])[:, :number]
            return np.arccos(levels[:number]) - np.abs(angle)

        def label(x: np.ndarray) -> np.ndarray:
            return np.where((values(x) > 0).any(axis=1), 1, 2)

        arcs = 2 * np.pi - 2 * np.arccos(levels[:number])
        second = float(arcs.prod() * (2 * np.pi) ** (k - number))
        whole = (2 * np.pi) ** k
        # A square, or an interval, of arcs, times circles.
        topology = {1: (1, -1 if k == 2 else 0), 2: (1, 1 if k == 2 else 0)}
        truth = Truth(values, label, 1.0, topology, {1: (whole - second, 0.0), 2: (second, 0.0)})
        finest, coarsest = {2: (0.1, 0.4), 3: (0.4, 0.5)}[k]
        return Case(oracle, truth, motion, finest, coarsest, alone=False)

    return make


def cut_torus(rng: np.random.Generator) -> Case:
    """What of T^4 is near a point, in two labels, by the sine of the first angle."""
    k, d, within, level = 4, 8, 0.4, rng.uniform(-0.1, 0.1)
    motion = Motion.random(rng, d)
    middle = np.tile([1.0, 0.0], k)  # all angles are 0
    reach = 1.1 * motion.scale * np.sqrt(2 * within)
    place = motion.forth(middle)
    base = _circles(k, motion, (place - reach, place + reach))
    near = motion.function(
        lambda x: within - (1 - x[:, ::2]).sum(axis=1), lambda x: np.tile(middle, (len(x), 1))
    )
    sine = motion.function(lambda x: x[:, 1] - level, lambda x: np.tile(np.eye(d)[1], (len(x), 1)))
    oracle = oracles.Clipped(
        base, [near[0], sine[0]], gradients=[near[1], sine[1]], labels=[0, 1, 0, 2]
    )

    def of_angles(angle: np.ndarray) -> np.ndarray:
        steep = np.maximum(norm(np.sin(angle), axis=1), 0.3)
        ball = (within - (1 - np.cos(angle)).sum(axis=1)) / steep
        return np.stack([ball, angle[:, 0] - np.arcsin(level)], axis=1)

    def values(x: np.ndarray) -> np.ndarray:
        return of_angles(np.arctan2(x[:, 1::2], x[:, ::2]))

    def label(values: np.ndarray) -> np.ndarray:
        return np.where(values[:, 0] > 0, 1 + (values[:, 1] > 0), 0)

    # Angles are lengths along M.
    volumes = thrown(lambda angle: label(of_angles(angle)), 1.0, k, [1, 2])
    truth = Truth(values, lambda x: label(values(x)), 0.8, dict.fromkeys((1, 2), (1, 1)), volumes)
    return Case(oracle, truth, motion, 0.28, 0.3, alone=False)


def _circles(k: int, motion: Motion, box: Any) -> stellate.ImplicitManifold:
    """k circles of radius 1, in a plane each."""

    def product(x: np.ndarray) -> np.ndarray:
        return (x.reshape(len(x), k, 2) ** 2).sum(axis=2) - 1

    def slopes(x: np.ndarray) -> np.ndarray:
        rows = np.zeros((len(x), k, 2 * k))
        for i in range(k):
            rows[:, i, 2 * i : 2 * i + 2] = 2 * x[:, 2 * i : 2 * i + 2]
        return rows

    return stellate.ImplicitManifold(
        lambda x: product(motion.back(x)),
        lambda x: slopes(motion.back(x)) @ motion.turn.T / motion.scale,
        ambient_dimension=2 * k,
        dimension=k,
        bounding_box=box,
    )


def gyroid(x: np.ndarray) -> np.ndarray:
    return (np.sin(x) * np.cos(np.roll(x, -1, axis=1))).sum(axis=1)


def gyroid_slope(x: np.ndarray) -> np.ndarray:
    return np.cos(x) * np.cos(np.roll(x, -1, axis=1)) - np.sin(x) * np.sin(np.roll(x, 1, axis=1))


def gyroid_slice(rng: np.random.Generator) -> Case:
    """A plane through a gyroid of two phases, cut to a square where the curves end at 35 degrees or more."""
    while True:
        origin, half = rng.uniform(0, 2 * np.pi, 3), 3.0

        def lift(x: np.ndarray, origin: np.ndarray = origin) -> np.ndarray:
            return np.column_stack([x, np.zeros(len(x))]) + origin

        line = np.linspace(-half, half, 4001)
        rim = np.concatenate(
            [np.stack(p, axis=1) for e in (-half, half)
             for p in ((line, np.full(4001, e)), (np.full(4001, e), line))]
        )  # fmt: skip
        g, slope = gyroid(lift(rim)), gyroid_slope(lift(rim))[:, :2]
        crossing = np.flatnonzero((g[:-1] > 0) != (g[1:] > 0))
        crossing = crossing[norm(rim[crossing + 1] - rim[crossing], axis=1) < 0.1]
        axis = (np.abs(rim[crossing]) < half).argmax(axis=1)  # that the side runs along
        along = np.abs(slope[crossing, axis]) / norm(slope[crossing], axis=1)
        corners = np.abs(gyroid(lift(np.array([[a, b] for a in (-3.0, 3.0) for b in (-3.0, 3.0)]))))
        flat = np.stack(np.meshgrid(line[::20], line[::20]), axis=-1).reshape(-1, 2)
        near = np.abs(gyroid(lift(flat))) < 0.1  # a saddle, where curves all but cross
        steep = norm(gyroid_slope(lift(flat[near]))[:, :2], axis=1).min(initial=1)
        if (along > np.sin(np.radians(35))).all() and corners.min() > 0.2 and steep > 0.4:
            break
    sides = in_box([-half] * 2, [half] * 2)

    def values(x: np.ndarray) -> np.ndarray:
        slopes = norm(gyroid_slope(lift(x))[:, :2], axis=1)
        return np.stack(
            [gyroid(lift(x)) / np.maximum(slopes, 0.2), *(side(x) for side in sides)], axis=1
        )

    def label(x: np.ndarray) -> np.ndarray:
        return np.where((np.abs(x) < half).all(axis=1), 1 + (gyroid(lift(x)) > 0), 0)

    motion = Motion.random(rng, 2)
    g, slope = motion.function(lambda x: gyroid(lift(x)), lambda x: gyroid_slope(lift(x))[:, :2])  # type: ignore[assignment]
    wall = s.Implicit(g, slope, bounding_box=_box_of(motion, 2, half * np.sqrt(2)))
    square = motion.solid(s.Box([-half] * 2, [half] * 2))
    oracle = s.Labels(below=square, above=square & wall)
    topology = dict.fromkeys((1, 2), None)
    truth = Truth(values, label, 0.5, topology, thrown(label, half * 1.01, 2, topology))
    return Case(oracle, truth, motion, 0.1, 0.25)


def _box_of(motion: Motion, d: int, radius: float) -> Any:
    corner = 1.2 * motion.scale * radius * np.ones(d)
    return motion.shift - corner, motion.shift + corner


FAMILIES: dict[str, Callable[[np.random.Generator], Case]] = {
    "union of discs": balls("union", 2),
    "difference of discs": balls("difference", 2),
    "two discs, three labels": balls("venn", 2),
    "discs without what both have": balls("xor", 2),
    "disc in a square": inclusion(2, "ball"),
    "square in a disc": inclusion(2, "cube"),
    "three phases in a disc": phases(3, 2),
    "L shape": l_shape,
    "slice of a gyroid": gyroid_slice,
    "torus in R^4, two labels": tori(2),
    "union of balls": balls("union", 3),
    "difference of balls": balls("difference", 3),
    "two balls, three labels": balls("venn", 3),
    "balls without what both have": balls("xor", 3),
    "cube without a ball": cube_and_ball("minus"),
    "cube with a void": cube_and_ball("void"),
    "cube and ball": cube_and_ball("plus"),
    "ball in a cube": inclusion(3, "ball"),
    "cube in a ball": inclusion(3, "cube"),
    "ball and rod": ball_and_rod,
    "tree of six": tree,
    "two phases": phases(2, 3),
    "three phases": phases(3, 3),
    "four phases": phases(4, 3),
    "lens of 20 to 55 degrees": lens,
    "octahedron with a grain": octahedron,
    "three-torus in R^6, two labels": tori(3),
    "cut four-torus in R^8, two labels": cut_torus,
}
