"""Meshes on a server, for the viewer to look at.

    tests/view/meshes.py ADDRESS

Reads a line of JSON for each mesh wanted, {"shape": NAME, "epsilon": E, ...}; writes its name once
it is declared, and "over" when it is done. "wait": for one more line before it is begun. "hold": for
one more line once the oracle has answered for so many points. "cancel": it before it is begun.
"delete": it after its end and one more line. "points" instead of "shape": it is reconstructed from
them.
"""

from __future__ import annotations

import json
import pathlib
import sys
import threading

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "clients" / "python"))

import stellate  # noqa: E402
from stellate import manifolds, oracles  # noqa: E402
from stellate import solids as s  # noqa: E402
from stellate._points import CheckedPoints  # noqa: E402


class TwoSpheres:
    """Unit spheres about (-1.5, 0, 0) and (1.5, 0, 0)."""

    dimension, ambient_dimension = 2, 3
    bounding_box = [-2.6, -1.1, -1.1], [2.6, 1.1, 1.1]

    def closest_point(self, x: np.ndarray) -> np.ndarray:
        centre = np.where(x[:, :1] < 0, -1.5, 1.5) * [1.0, 0.0, 0.0]
        away = x - centre
        return centre + away / np.linalg.norm(away, axis=1, keepdims=True)


class Held:
    """The same, but after some points it answers no more, until there is one more line.

    How many calls these come in depends on how fast they are answered.
    """

    def __init__(self, oracle: object, points: float) -> None:
        self._oracle, self._points, self._lock = oracle, points, threading.Lock()

    def __getattr__(self, name: str) -> object:
        return getattr(self._oracle, name)

    def closest_point(self, x: np.ndarray) -> np.ndarray:
        with self._lock:
            if self._points <= 0:
                sys.stdin.readline()
                self._points = np.inf
            self._points -= len(x)
        return self._oracle.closest_point(x)


def ellipsoid() -> object:
    """Its axes have different units, by which it is a sphere."""
    scale = np.array([0.01, 500.0, 1.0])
    own = stellate.ImplicitManifold(
        lambda x: ((x / scale) ** 2).sum(axis=1) - 1,
        ambient_dimension=3,
        dimension=2,
        bounding_box=(-1.3 * scale, 1.3 * scale),
    )
    return oracles.in_units(own, scale)


SHAPES = {
    "ellipsoid": ellipsoid,
    "circle": lambda: manifolds.Sphere(1),
    "four-sphere": lambda: manifolds.Sphere(4),
    "torus": lambda: manifolds.Torus(1.0, 0.4),
    "thin torus": lambda: manifolds.Torus(1.0, 0.12),
    "two spheres": TwoSpheres,
    "rotations": manifolds.SpecialOrthogonal3,
    "flat torus": lambda: manifolds.ProductOfCircles([1.0, 1.0, 1.0]),
    "octant": lambda: oracles.Clipped(
        manifolds.Sphere(2), box=([0.0, 0.0, 0.0], [np.inf, np.inf, np.inf])
    ),
    "grain": lambda: s.Labels(matrix=s.Box([-1] * 3, [1] * 3), grain=s.Ball(0.6)),
    "cube": lambda: oracles.Solid([], ([-1.3] * 3, [1.3] * 3), box=([-1.0] * 3, [1.0] * 3)),
}


def cap(n: int) -> np.ndarray:
    """Points of a sphere, which end at a circle."""
    i = np.arange(n) + 0.5
    z, turn = 1 - 1.2 * i / n, i * np.pi * (3 - np.sqrt(5))
    around = np.sqrt(1 - z**2)
    return np.stack([around * np.cos(turn), around * np.sin(turn), z], axis=1)


POINTS = {"cap": lambda: cap(800)}


def reconstruct(client: stellate.Client, points: np.ndarray, **options: object) -> None:
    limits = {"label": options["label"]}
    checked = CheckedPoints(points, 2, None, 0, None, 0.0, True, {}, **limits)
    name = client.declare_points(checked).name
    print(name, flush=True)
    client.upload(name, checked).run()
    for event in client.watch(name, progress_only=True):
        if event.WhichOneof("event") == "final":
            break
    print("over", flush=True)


def main() -> None:
    client = stellate.Client(sys.argv[1])
    for line in sys.stdin:
        wish = json.loads(line)
        if "points" in wish:
            reconstruct(client, POINTS[wish.pop("points")](), **wish)
            continue
        oracle = SHAPES[wish.pop("shape")]()
        hold = wish.pop("hold", None)
        wait = wish.pop("wait", False)
        cancel = wish.pop("cancel", False)
        delete = wish.pop("delete", False)
        if hold is not None:
            oracle = Held(oracle, hold)
        name = client.create(oracle, **wish).name
        print(name, flush=True)
        if wait:
            sys.stdin.readline()
        if cancel:
            client.cancel(name)
        else:
            client.serve(oracle, name, worker="a worker")
        print("over", flush=True)
        if delete:
            sys.stdin.readline()
            client.delete(name)


if __name__ == "__main__":
    main()
