"""Oracles that take their time: what sharing out their queries costs.

    slow.py                    a fixed cost for each chunk, and slow queries, of a torus
    slow.py --quick            a fifth of it

Oracles sleep, so that any number of them fits on one core. Efficiency is queries times the time of
one, over workers times the time of the whole mesh, the mesher's own included. Each mesh is compared
with that of an oracle that does not sleep.
"""

from __future__ import annotations

import argparse
import pathlib
import sys
import threading
import time
from typing import Any

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "clients" / "python"))

import numpy as np  # noqa: E402
import stellate  # noqa: E402

_LONGEST = 60.0  # seconds that a mesh is given; then it is cancelled and counted as far as it came


class Sleeping:
    """The torus 1:0.4, after a sleep of `fixed` seconds for a chunk and `each` for a query."""

    thread_safe = True

    def __init__(self, fixed: float, each: float) -> None:
        self._torus = stellate.manifolds.Torus(1.0, 0.4)
        self._fixed, self._each = fixed, each
        self.dimension, self.ambient_dimension = 2, 3
        self.bounding_box = self._torus.bounding_box
        self._lock = threading.Lock()
        self.queries = self.chunks = 0

    def closest_point(self, points: np.ndarray) -> np.ndarray:
        with self._lock:
            self.queries += len(points)
            self.chunks += 1
        time.sleep(self._fixed + self._each * len(points))
        return self._torus.closest_point(points)

    def tangent_basis(self, points: np.ndarray) -> np.ndarray:
        return self._torus.tangent_basis(points)


def run(address: str, oracle: Sleeping, epsilon: float, workers: int) -> tuple[float, Any]:
    """Seconds, and the mesh, or None where it would have taken too long."""
    begin = time.perf_counter()

    def on_progress(_: Any) -> None:
        if time.perf_counter() - begin > _LONGEST:
            raise TimeoutError

    try:
        mesh = stellate.mesh(
            oracle, epsilon, server=address, on_progress=on_progress, workers=workers
        )
    except TimeoutError:
        return time.perf_counter() - begin, None
    return time.perf_counter() - begin, mesh


def same(a: Any, b: Any) -> bool:
    return np.array_equal(a.points, b.points) and np.array_equal(a.simplices, b.simplices)


def fixed_costs(address: str, quick: bool) -> bool:
    """One worker, a fixed cost for each chunk."""
    _, plain = run(address, Sleeping(0, 0), 0.1, 1)
    good = True
    print("one worker, epsilon 0.1: by the fixed cost of a chunk")
    for fixed in (0.02, 0.25) if quick else (0, 0.02, 0.1, 0.125, 0.15, 0.2, 0.25, 0.5):
        oracle = Sleeping(fixed, 0)
        seconds, mesh = run(address, oracle, 0.1, 1)
        good = good and mesh is not None and same(mesh, plain)
        print(
            f"  {1000 * fixed:4.0f} ms  {seconds:7.2f} s  {oracle.chunks:5d} chunks  "
            f"{oracle.queries:6d} queries{'' if mesh is not None else ', given up'}",
            flush=True,
        )
    return good


def slow_queries(address: str, quick: bool) -> bool:
    """Some workers, a cost for each query."""
    cases = [(1, 0.001), (4, 0.02), (8, 0.02), (8, 0.1), (32, 0.02), (32, 0.1), (60, 0.1), (60, 1)]
    good = True
    _, plain = run(address, Sleeping(0, 0), 0.2, 1)
    print("epsilon 0.2: by the number of workers, the time of a query")
    for workers, each in [(32, 0.1)] if quick else cases:
        oracle = Sleeping(0, each)
        seconds, mesh = run(address, oracle, 0.2, workers)
        good = good and mesh is not None and same(mesh, plain)
        asked = mesh.report.counts.queries if mesh is not None else oracle.queries
        print(
            f"  {workers:3d} workers  {1000 * each:5.0f} ms  {seconds:7.2f} s  "
            f"{oracle.chunks:5d} chunks  {asked:6d} queries, {oracle.queries - asked} asked twice  "
            f"efficiency {asked * each / (workers * seconds):.2f}"
            f"{'' if mesh is not None else ', given up'}",
            flush=True,
        )
    return good


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    with stellate.Server(listen="127.0.0.1:0") as server:
        good = fixed_costs(server.address, arguments.quick)
        good = slow_queries(server.address, arguments.quick) and good
    print("all meshes as without a sleep" if good else "NOT all meshes as without a sleep")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
