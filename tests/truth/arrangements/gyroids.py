"""Solids of five triply periodic surfaces: what is certified of them, and how the others are refused.

    tests/truth/arrangements/run gyroids [--runs N] [--seed S] [--surface NAME]... [--kind KIND]...
                                         [--within PLACE]... [--fractions .1,.5] [--case N]

Skeletal: where g is above a level; sheets: where it is within two. The level is that which leaves the
volume fraction. Each is cut by a box, a ball or a cylinder at a random place, or periodic. epsilon is a
share of what the level set bends and of what the sheet is thick, sampled; so thin sheets are fine meshes.
Near a level with singular points that would be too fine everywhere, and epsilon is coarse: what is not
certified there is meshed once more, with sizes that follow what is seen, as the verdict says (size_rate).
"""

from __future__ import annotations

import collections
import dataclasses
import itertools
import sys
import time
from typing import Any

import command
import numpy as np
import scipy.ndimage
import stellate
from families import Motion, thrown
from judge import Truth, judge
from stellate import oracles
from stellate import solids as s

norm = np.linalg.norm
_HALF = 1.8  # of the box's side; the ball's and the cylinder's radius is a little more and less
_SHARE = 0.35  # of what bends and of half of what is thick
_LEAST, _MOST = 0.14, 0.5  # of epsilon, where a period is 2 pi
_MOST_EVEN, _MOST_GRADED = 60_000, 200_000  # vertices
_GRID = 72
_COARSE = 0.4
_STARTS = 700
_BOUNDS = [10, 15, 20, 30]
_CLASSES = ["0 to 10", "10 to 15", "15 to 20", "20 to 30", "30 degrees or more"]


def gyroid(x: Any) -> Any:
    return sum(np.sin(x[i]) * np.cos(x[(i + 1) % 3]) for i in range(3))


def primitive(x: Any) -> Any:
    return sum(np.cos(x[i]) for i in range(3))


def diamond(x: Any) -> Any:
    sines, cosines = [np.sin(t) for t in x], [np.cos(t) for t in x]
    mixed = sum(sines[i] * cosines[i - 1] * cosines[i - 2] for i in range(3))
    return sines[0] * sines[1] * sines[2] + mixed


def iwp(x: Any) -> Any:
    pairs = sum(np.cos(x[i]) * np.cos(x[i - 1]) for i in range(3))
    return 2 * pairs - sum(np.cos(2 * t) for t in x)


def neovius(x: Any) -> Any:
    return 3 * primitive(x) + 4 * np.cos(x[0]) * np.cos(x[1]) * np.cos(x[2])


SURFACES = {
    "gyroid": gyroid,
    "Schwarz P": primitive,
    "Schwarz D": diamond,
    "IWP": iwp,
    "Neovius": neovius,
}
KINDS = ["skeletal", "sheet"]
PLACES = ["box", "ball", "cylinder", "periodic"]


@dataclasses.dataclass(frozen=True)
class Level:
    """g - level, or level - |g|: positive inside, and what is known of its zero set.

    Attributes:
      bend: the least radius of curvature, where it was sampled.
      epsilon: that is fine enough.
    """

    surface: str
    kind: str
    level: float
    bend: float
    epsilon: float

    def g(self, x: np.ndarray) -> np.ndarray:
        return np.asarray(SURFACES[self.surface](x.T))

    def inside(self, x: np.ndarray) -> np.ndarray:
        return self.g(x) > self.level if self.kind == "skeletal" else np.abs(self.g(x)) < self.level

    def walls(self) -> list[tuple[float, float]]:
        """Signs and levels: sign * (g - level) is positive inside."""
        if self.kind == "skeletal":
            return [(1.0, self.level)]
        return [(1.0, -self.level), (-1.0, self.level)]

    def slope(self, x: np.ndarray, h: float = 1e-5) -> np.ndarray:
        return np.stack([(self.g(x + v) - self.g(x - v)) / (2 * h) for v in h * np.eye(3)], axis=1)


def level_of(surface: str, kind: str, fraction: float) -> Level:
    line = 2 * np.pi * (np.arange(96) + 0.5) / 96
    g = SURFACES[surface](np.stack(np.meshgrid(line, line, line), axis=0)).ravel()
    level = float(
        np.quantile(g, 1 - fraction) if kind == "skeletal" else np.quantile(abs(g), fraction)
    )
    some = Level(surface, kind, level, 1.0, 1.0)
    x = np.random.default_rng(1).uniform(0, 2 * np.pi, (20_000, 3))
    bends, halves = [np.inf], [np.inf]
    for _, at in some.walls():
        y = x.copy()
        for _ in range(12):
            slope = some.slope(y)
            square = np.maximum((slope**2).sum(axis=1), 1e-3)
            y -= np.clip((some.g(y) - at) / square, -0.5, 0.5)[:, None] * slope
        y = y[np.abs(some.g(y) - at) < 1e-6]
        slope = some.slope(y)
        steep = norm(slope, axis=1)
        h = 1e-3
        turned = np.stack(
            [(some.slope(y + v) - some.slope(y - v)) / (2 * h) for v in h * np.eye(3)], axis=2
        )
        n = slope / steep[:, None]
        across = np.eye(3) - n[:, :, None] * n[:, None, :]
        shape = across @ turned @ across / steep[:, None, None]
        bends.append(float(np.quantile(1 / np.maximum(norm(shape, 2, axis=(1, 2)), 1e-9), 0.002)))
        if kind == "sheet":
            halves.append(float(np.quantile(level / steep, 0.002)))
    bend = min(bends)
    epsilon = float(np.clip(_SHARE * min(bend, 2 * min(halves)), _LEAST, _MOST))
    return Level(surface, kind, level, bend, epsilon)


@dataclasses.dataclass(frozen=True)
class Cut:
    """Of an infinite solid, by a box, a ball or a cylinder about a random point, turned at random."""

    level: Level
    place: str
    centre: np.ndarray
    motion: Motion

    def container(self) -> tuple[s.Solid, Any]:
        """In coordinates about 0, and the distances to its walls."""
        if self.place == "ball":
            r = 1.2 * _HALF
            return s.Ball(r), lambda x: np.stack([r - norm(x, axis=1)], axis=1)
        if self.place == "cylinder":
            r, h = 1.05 * _HALF, 0.95 * _HALF
            return s.Cylinder(r, 2 * h), lambda x: np.stack(
                [r - np.hypot(x[:, 0], x[:, 1]), h - x[:, 2], h + x[:, 2]], axis=1
            )
        return s.Box([-_HALF] * 3, [_HALF] * 3), lambda x: np.concatenate(
            [_HALF - x, _HALF + x], axis=1
        )

    def oracle(self) -> Any:
        solid, _ = self.container()
        result = self.motion.solid(solid)
        for sign, at in self.level.walls():
            f, slope = self.motion.function(
                lambda x, sign=sign, at=at: sign * (self.level.g(x + self.centre) - at),
                lambda x, sign=sign: sign * self.level.slope(x + self.centre),
            )
            corner = 4 * _HALF * self.motion.scale
            box = self.motion.shift - corner, self.motion.shift + corner
            result = result & s.Implicit(f, slope, bounding_box=box)
        return result

    def truth(self) -> Truth:
        _, sides = self.container()

        def values(x: np.ndarray) -> np.ndarray:
            steep = np.maximum(norm(self.level.slope(x + self.centre), axis=1), 0.05)
            g = self.level.g(x + self.centre)
            mine = [sign * (g - at) / steep for sign, at in self.level.walls()]
            return np.concatenate([np.stack(mine, axis=1), sides(x)], axis=1)

        def label(x: np.ndarray) -> np.ndarray:
            return (self.level.inside(x + self.centre) & (sides(x) > 0).all(axis=1)).astype(int)

        return Truth(values, label, self.level.bend, {1: None}, thrown(label, 1.25 * _HALF, 3, [1]))

    def sharpest(self) -> float:
        """The least angle, in degrees, at which walls meet, and of a straight angle what is left.

        By Newton's method from random points to where a side of the container, or two, and the level
        set are zero. Where three meet: the angle of two, if these had the Gram matrix's least eigenvalue.
        """
        _, sides = self.container()
        x = np.random.default_rng(3).uniform(-1.3, 1.3, (_STARTS, 3)) * _HALF
        count, least = sides(x[:1]).shape[1], 90.0
        for sign, at in self.level.walls():

            def zeros(x: np.ndarray, at: float = at, sign: float = sign) -> np.ndarray:
                g = sign * (self.level.g(x + self.centre) - at)
                return np.concatenate([sides(x), g[:, None]], axis=1)

            groups = [(i, count) for i in range(count)]
            groups += [(*both, count) for both in itertools.combinations(range(count), 2)]
            for group in groups:
                least = min(least, _meeting(zeros, list(group), x, self.level, self.centre))
        return least

    def pieces(self) -> int:
        """Components that a grid shows, of more than a few of its points; their number at least."""
        line = np.linspace(-1.25 * _HALF, 1.25 * _HALF, _GRID)
        x = np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1).reshape(-1, 3)
        inside = self.truth().label(x).reshape(_GRID, _GRID, _GRID) > 0
        marks, count = scipy.ndimage.label(inside, np.ones((3, 3, 3)))
        return int((np.bincount(marks.ravel())[1:] > 30).sum()) if count else 0


def _meeting(
    zeros: Any, group: list[int], x: np.ndarray, level: Level, centre: np.ndarray
) -> float:
    h = 1e-5
    for _ in range(14):
        rows = np.stack([(zeros(x + v) - zeros(x - v)) / (2 * h) for v in h * np.eye(3)], axis=2)
        across = rows[:, group]
        gram = across @ np.swapaxes(across, 1, 2) + 1e-9 * np.eye(len(group))
        steps = np.swapaxes(across, 1, 2) @ np.linalg.solve(gram, zeros(x)[:, group, None])
        x = x - np.clip(steps[..., 0], -0.5, 0.5)
    values = zeros(x)
    there = (np.abs(values[:, group]) < 1e-7).all(axis=1) & (values > -1e-6).all(axis=1)
    there &= np.all(
        [sign * (level.g(x + centre) - at) > -1e-6 for sign, at in level.walls()], axis=0
    )
    if not there.any():
        return 90.0
    normals = rows[there][:, group]
    normals /= norm(normals, axis=2, keepdims=True)
    eigenvalues = np.linalg.eigvalsh(normals @ np.swapaxes(normals, 1, 2))[:, 0]
    return float(np.degrees(np.arccos(1 - eigenvalues.min())))


@dataclasses.dataclass
class Run:
    surface: str
    kind: str
    place: str
    fraction: float
    outcome: str = "certified"
    words: str = ""
    vertices: int = 0
    seconds: float = 0.0
    angle: float = 180.0
    meeting: float = 90.0  # degrees, the least angle of walls
    coarse: bool = False  # epsilon is above 0.4 of what bends, as near a level with singular points


def periodic(level: Level) -> Any:
    cell = oracles.PeriodicCell(2 * np.pi * np.eye(3))
    walls = [lambda x, sign=sign, at=at: sign * (level.g(x) - at) for sign, at in level.walls()]
    slopes = [lambda x, sign=sign: sign * level.slope(x) for sign, _ in level.walls()]
    return cell, cell.solid(walls, slopes)


def _judge_period(mesh: Any, cell: Any, level: Level, epsilon: float) -> list[str]:
    """Volume and barycentres in plain coordinates; what it is as a complex the torus's own code says."""
    corners = mesh.unwrap(cell).corners()
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])).sum() / 6
    x = np.random.default_rng(2).random((200_000, 3)) * 2 * np.pi
    share = level.inside(x).mean()
    steep = max(float(norm(level.slope(x), axis=1).mean()), 1e-3)
    thin = np.mean(np.abs(level.g(x)[:, None] - [at for _, at in level.walls()]).min(axis=1) < 0.05)
    area = thin * (2 * np.pi) ** 3 / 0.1 * steep
    allowed = area * epsilon**2 / (2 * level.bend) + 0.005 * (2 * np.pi) ** 3
    wrong = []
    if abs(volume - share * (2 * np.pi) ** 3) > allowed:
        wrong.append(f"the volume is {volume:.4g}, not {share * (2 * np.pi) ** 3:.4g}")
    middles = corners.mean(axis=1)
    off = ~level.inside(middles)
    for _, at in level.walls():
        near = np.abs(level.g(middles) - at) / np.maximum(norm(level.slope(middles), axis=1), 0.05)
        off &= near > 0.6 * epsilon**2 / level.bend
    if off.any():
        wrong.append(f"{int(off.sum())} barycentres are outside")
    return wrong


def one(
    surface: str, kind: str, place: str, fraction: float, seed: int, places: int, server: Any
) -> Run:
    level = level_of(surface, kind, fraction)
    run = Run(surface, kind, place, fraction, coarse=level.epsilon > _COARSE * level.bend)
    rng = np.random.default_rng([seed, *map(ord, surface + kind + place), int(100 * fraction)])
    motion = Motion.random(rng, 3)
    if place != "periodic":
        some = [Cut(level, place, rng.uniform(0, 2 * np.pi, 3), motion) for _ in range(places)]
        there = [c for c in some if c.pieces() > 0] or some
        run.meeting, cut = max(((c.sharpest(), c) for c in there), key=lambda both: both[0])
    began = time.monotonic()
    try:
        if place == "periodic":
            epsilon = min(level.epsilon, 0.4)
            cell, oracle = periodic(level)
            size = epsilon
        else:
            epsilon = level.epsilon
            oracle, size = cut.oracle(), epsilon * motion.scale
        mesh = stellate.mesh(oracle, size, server=server, max_vertices=_MOST_EVEN)
        if run.coarse and not mesh.certified:
            mesh = stellate.mesh(
                oracle, size, server=server, max_vertices=_MOST_GRADED, size_rate=_SHARE
            )
    except stellate.StellateError as error:
        run.outcome, run.words = "refused", f"{error.reason}: {error}"
        run.seconds = time.monotonic() - began
        return run
    run.seconds, run.vertices = time.monotonic() - began, len(mesh.points)
    certificate = mesh.report.certificate
    if not mesh.certified:
        run.outcome, run.words = "not certified", certificate.verdict
        return run
    if place == "periodic":
        wrong = _judge_period(mesh, cell, level, epsilon)
    else:
        labels = np.ones(len(mesh.simplices), dtype=int)
        found = judge(motion.back(mesh.points), mesh.simplices, labels, cut.truth(), epsilon)
        run.angle, wrong = found.least_angle, found.wrong
        if found.euler[1] != certificate.euler_characteristic:
            wrong.append(f"chi is {found.euler[1]}, not {certificate.euler_characteristic}")
        if not wrong and found.components[1] < cut.pieces():
            run.outcome, run.words = "unseen", f"{found.components[1]} of {cut.pieces()} pieces"
    if wrong:
        run.outcome, run.words = "false", "; ".join(wrong)
    return run


def table(runs: list[Run]) -> str:
    words = ["certified", "unseen", "false", "not certified", "refused"]
    lines = [f"{'':34s} runs {' '.join(words)}  vertices  us/vertex  least angle"]
    groups = collections.defaultdict(list)
    for run in runs:
        groups[f"{run.surface}, {run.kind}"].append(run)
        groups[f"in a {run.place}" if run.place != "periodic" else "periodic"].append(run)
        groups[f"{run.kind}, fraction {run.fraction:g}"].append(run)
        if run.place != "periodic":
            groups[f"walls meet at {_CLASSES[np.searchsorted(_BOUNDS, run.meeting)]}"].append(run)
        if run.coarse:
            groups["all but singular levels"].append(run)
        elif run.meeting >= 15:
            groups["others, walls at 15 or more"].append(run)
        groups["all"].append(run)
    ranks = ["in a", "periodic", "skeletal, f", "sheet, f", "walls", "all but", "others", "all"]

    def rank(name: str) -> int:
        return next((i for i, begin in enumerate(ranks) if name.startswith(begin)), -1)

    order = sorted(groups, key=lambda name: (rank(name), name))
    for name in order:
        own = groups[name]
        counts = collections.Counter(run.outcome for run in own)
        done = [run for run in own if run.vertices] or [Run("", "", "", 0, vertices=1)]
        vertices = sum(run.vertices for run in done)
        lines.append(
            f"{name:34s} {len(own):4d} "
            + " ".join(f"{counts[word]:{len(word)}d}" for word in words)
            + f" {vertices / len(done):9.0f} {1e6 * sum(r.seconds for r in done) / vertices:10.0f}"
            + f" {min(run.angle for run in own):12.1f}"
        )
    return "\n".join(lines)


def main() -> int:
    parser = command.parser(__doc__, None, "so many, spread over all (all)")
    parser.add_argument("--surface", action="append", choices=SURFACES, help="these alone")
    parser.add_argument("--kind", action="append", choices=KINDS)
    parser.add_argument("--within", action="append", choices=PLACES)
    parser.add_argument("--fractions", default=".1,.2,.3,.4,.5,.6,.7,.8,.9")
    parser.add_argument(
        "--places",
        type=int,
        default=3,
        help="of so many random ones that of the largest angles (3)",
    )
    given = parser.parse_args()
    fractions = [float(f) for f in given.fractions.split(",")]
    cases = list(
        itertools.product(
            given.surface or SURFACES, given.kind or KINDS, given.within or PLACES, fractions
        )
    )
    numbers = np.random.default_rng(1).permutation(len(cases)).tolist()[: given.runs]
    if given.case is not None:
        numbers = [given.case]

    def mesh(number: int, server: stellate.Server) -> Run:
        return one(*cases[number], given.seed, given.places, server)

    def show(number: int, run: Run) -> None:
        print(
            f"{number:4d} {run.surface}, {run.kind}, {run.place}, {run.fraction:g}, walls at "
            f"{run.meeting:.0f} degrees: {run.outcome}, "
            f"{run.vertices} vertices, {run.seconds:.1f} s{': ' if run.words else ''}{run.words}",
            flush=True,
        )

    runs = command.run_all(numbers, mesh, show)
    print(table(runs))
    return 1 if any(run.outcome == "false" for run in runs) else 0


if __name__ == "__main__":
    sys.exit(main())
