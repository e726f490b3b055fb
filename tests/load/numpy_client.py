"""Meshes a torus from numpy, and prints: seconds in all, seconds in the oracle, vertices."""

from __future__ import annotations

import argparse
import pathlib
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "clients" / "python"))

import numpy as np  # noqa: E402
import stellate  # noqa: E402


class Timed:
    """An oracle, and the time that is spent in it."""

    def __init__(self, oracle: object) -> None:
        self._oracle = oracle
        self.dimension = oracle.dimension
        self.ambient_dimension = oracle.ambient_dimension
        self.bounding_box = oracle.bounding_box
        self.seconds = 0.0
        self.calls = 0

    def closest_point(self, points: np.ndarray) -> np.ndarray:
        return self._timed(self._oracle.closest_point, points)

    def tangent_basis(self, points: np.ndarray) -> np.ndarray:
        return self._timed(self._oracle.tangent_basis, points)

    def _timed(self, method: object, points: np.ndarray) -> np.ndarray:
        begin = time.perf_counter()
        try:
            return method(points)
        finally:
            self.seconds += time.perf_counter() - begin
            self.calls += 1


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--server", required=True)
    parser.add_argument("--epsilon", type=float, required=True)
    arguments = parser.parse_args()
    oracle = Timed(stellate.manifolds.Torus())
    begin = time.perf_counter()
    mesh = stellate.mesh(oracle, arguments.epsilon, server=arguments.server)
    print(time.perf_counter() - begin, oracle.seconds, len(mesh.points))


if __name__ == "__main__":
    main()
