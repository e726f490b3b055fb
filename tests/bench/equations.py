"""What a mesh costs who has equations: values of F and of its Jacobian, walls and all.

    tests/bench/run equations [REGEX]    the table, or its rows of these names

Each mesh is made twice, from values of F alone and with its Jacobian. Counted are the points that F, the
walls and their derivatives are called for, certificate included, a vertex.
"""

from __future__ import annotations

import pathlib
import re
import sys

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "clients" / "python"))

import stellate  # noqa: E402
from stellate import oracles  # noqa: E402

ROWS, COLUMNS = np.triu_indices(3)


class Counted:
    """A function of batches that counts the points that it is called for."""

    def __init__(self, f) -> None:
        self._f, self.points = f, 0

    def __call__(self, x):
        self.points += len(x)
        return self._f(x)


def oval(x):
    return (x[:, 0] ** 2 / 1.5 + x[:, 1] ** 2 - 1 + 0.1 * x[:, 0] ** 3)[:, None]


def oval_slopes(x):
    return np.stack([2 * x[:, 0] / 1.5 + 0.3 * x[:, 0] ** 2, 2 * x[:, 1]], axis=1)


def curve(x):  # (cos t, sin t, cos(2 t) / 2, sin(2 t) / 2)
    a, b, c, d = x.T
    return np.stack([a * a + b * b - 1, c - (a * a - b * b) / 2, d - a * b], axis=1)


def curve_slopes(x):
    a, b, zero, one = x[:, 0], x[:, 1], np.zeros(len(x)), np.ones(len(x))
    rows = [[2 * a, 2 * b, zero, zero], [-a, b, one, zero], [-b, -a, zero, one]]
    return np.stack([np.stack(row, axis=1) for row in rows], axis=1)


def torus(x):
    return ((np.hypot(x[:, 0], x[:, 1]) - 1) ** 2 + x[:, 2] ** 2 - 0.16)[:, None]


def torus_slopes(x):
    r = np.hypot(x[:, 0], x[:, 1])
    return 2 * np.stack([(r - 1) * x[:, 0] / r, (r - 1) * x[:, 1] / r, x[:, 2]], axis=1)


def tanglecube(x):
    return (x**4 - 5 * x**2).sum(axis=1)[:, None] + 11.8


def tanglecube_slopes(x):
    return 4 * x**3 - 10 * x


def sphere(x):
    return (x * x).sum(axis=1)[:, None] - 1


def clifford(x):
    return np.stack([(x[:, :2] ** 2).sum(axis=1) - 1, (x[:, 2:] ** 2).sum(axis=1) - 0.64], axis=1)


def clifford_slopes(x):
    slopes = np.zeros((len(x), 2, 4))
    slopes[:, 0, :2], slopes[:, 1, 2:] = 2 * x[:, :2], 2 * x[:, 2:]
    return slopes


def rotations(x):
    r = x.reshape(-1, 3, 3)
    return (r @ r.transpose(0, 2, 1) - np.eye(3))[:, ROWS, COLUMNS]


def rotations_slopes(x):
    r = x.reshape(-1, 3, 3)
    slopes = np.zeros((len(x), 6, 3, 3))
    for equation, (i, j) in enumerate(zip(ROWS, COLUMNS)):
        slopes[:, equation, i] += r[:, j]
        slopes[:, equation, j] += r[:, i]
    return slopes.reshape(-1, 6, 9)


def wall(x):
    return x[:, 0] + 0.3 * x[:, -1] ** 2


def wall_slopes(x):
    slopes = np.zeros(x.shape)
    slopes[:, 0], slopes[:, -1] = 1, 0.6 * x[:, -1]
    return slopes


def cube(d: int, half: float):
    return np.full(d, -half), np.full(d, half)


TORUS_BOX = np.array([-1.5, -1.5, -0.5]), np.array([1.5, 1.5, 0.5])
CASES = [  # name, F, its slopes, k, box, epsilon
    ("oval", oval, oval_slopes, 1, cube(2, 2.0), 0.05),
    ("curve", curve, curve_slopes, 1, cube(4, 1.3), 0.05),
    ("torus", torus, torus_slopes, 2, TORUS_BOX, 0.1),
    ("tanglecube", tanglecube, tanglecube_slopes, 2, cube(3, 3.0), 0.2),
    ("T^2", clifford, clifford_slopes, 2, cube(4, 1.3), 0.2),
    ("S^3", sphere, lambda x: 2 * x, 3, cube(4, 1.3), 0.3),
    ("SO(3)", rotations, rotations_slopes, 3, cube(9, 1.0), 0.5),
    ("oval, cut", oval, oval_slopes, 1, cube(2, 2.0), 0.05),
    ("curve, cut", curve, curve_slopes, 1, cube(4, 1.3), 0.02),
    ("torus, cut", torus, torus_slopes, 2, TORUS_BOX, 0.1),
    ("T^2, cut", clifford, clifford_slopes, 2, cube(4, 1.3), 0.2),
    ("S^3, cut", sphere, lambda x: 2 * x, 3, cube(4, 1.3), 0.4),
]


def price(case, given: bool, server) -> tuple[int, dict[str, float]]:
    """Vertices, and points a vertex of F, its Jacobian, the wall, its gradient."""
    name, f, slopes, k, box, epsilon = case
    counted = {w: Counted(g) for w, g in zip("FJgd", (f, slopes, wall, wall_slopes))}
    oracle = stellate.ImplicitManifold(
        counted["F"],
        counted["J"] if given else None,
        ambient_dimension=len(box[0]),
        dimension=k,
        bounding_box=box,
    )
    if "cut" in name:
        gradients = [counted["d"]] if given else None
        oracle = oracles.Clipped(oracle, [counted["g"]], gradients=gradients)
    mesh = stellate.mesh(oracle, epsilon, server=server, speculative=False)
    vertices = mesh.report.counts.vertices
    return vertices, {which: c.points / vertices for which, c in counted.items()}


def main(wanted: str) -> None:
    print("| | k, d | epsilon | vertices | F | wall | F + J, given | wall + gradient, given |")
    print("|---|--:|--:|--:|--:|--:|--:|--:|")
    with stellate.Server() as server:
        for case in CASES:
            name, _, _, k, box, epsilon = case
            if not re.search(wanted, name):
                continue
            vertices, alone = price(case, False, server)
            _, both = price(case, True, server)
            numbers = [
                f"{alone['F']:.0f}",
                f"{alone['g']:.0f}",
                f"{both['F']:.0f} + {both['J']:.0f}",
                f"{both['g']:.0f} + {both['d']:.0f}",
            ]
            print(
                f"| {name} | {k}, {len(box[0])} | {epsilon} | {vertices:,} | {' | '.join(numbers)} |"
            )


if __name__ == "__main__":
    if len(sys.argv) > 2 or "--help" in sys.argv[1:]:
        print(__doc__)
        sys.exit(0 if "--help" in sys.argv[1:] else 2)
    main(sys.argv[1] if len(sys.argv) > 1 else "")
