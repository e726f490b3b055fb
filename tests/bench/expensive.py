"""What an expensive oracle costs: questions, rounds, and hours by the number of workers.

    tests/bench/run expensive              the table, at a second a question
    tests/bench/run expensive --check      the same model beside the clock, with oracles that sleep

The questions of each round are counted on a real run. A round of n questions takes ceil(n / workers)
of an answer's seconds: the model leaves out what the mesher and the network take, and answers that
take longer than others.
"""

from __future__ import annotations

import math
import pathlib
import sys
import time
from collections.abc import Sequence

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "clients" / "python"))

import stellate  # noqa: E402
from stellate import manifolds  # noqa: E402

SECONDS = 1.0
WORKERS = (1, 16, 256)
CASES = [
    ("circle", manifolds.Sphere(1), 0.1),
    ("sphere", manifolds.Sphere(2), 0.25),
    ("torus", manifolds.Torus(), 0.1),
    ("T² in R⁴", manifolds.ProductOfCircles(), 0.2),
    ("S³ in R⁴", manifolds.Sphere(3), 0.3),
    ("SO(3) in R⁹", manifolds.SpecialOrthogonal3(), 0.4),
]


class ClosestPointsAlone:
    """The least that an oracle can be."""

    thread_safe = True

    def __init__(self, oracle, seconds: float = 0.0) -> None:
        self.dimension, self.ambient_dimension = oracle.dimension, oracle.ambient_dimension
        self.bounding_box = oracle.bounding_box
        self._oracle, self._seconds = oracle, seconds

    def closest_point(self, x):
        time.sleep(self._seconds * len(x))
        return self._oracle.closest_point(x)


def questions_by_round(
    oracle, epsilon: float, **options
) -> tuple[list[int], stellate.report.Counts]:
    """What each round asked, tangent spaces included; a slow listener sees several rounds as one."""
    asked: dict[int, int] = {}

    def see(progress) -> None:
        asked[progress.round] = progress.queries

    mesh = stellate.mesh(oracle, epsilon, on_progress=see, **options)
    end = mesh.report.counts
    asked[end.rounds] = end.queries + end.tangent_queries
    totals = [asked[r] for r in sorted(asked)]
    return [b - a for a, b in zip([0, *totals], totals) if b > a], end


def seconds_of(rounds: Sequence[int], workers: int, seconds: float) -> float:
    return seconds * sum(math.ceil(n / workers) for n in rounds)


def told(seconds: float) -> str:
    for unit, name in ((86400, "d"), (3600, "h"), (60, "min")):
        if seconds >= 2 * unit:
            return f"{seconds / unit:.3g} {name}"
    return f"{seconds:.3g} s"


def print_table() -> None:
    heads = " | ".join(f"{w} worker{'s' * (w > 1)}" for w in WORKERS)
    print(f"| | epsilon | oracle | ahead | vertices | questions | rounds | {heads} |")
    print("|---|--:|---|---|--:|--:|--:|" + "--:|" * len(WORKERS))
    for name, oracle, epsilon in CASES:
        for words, asked in (("closest points", ClosestPointsAlone(oracle)), ("all", oracle)):
            for ahead in (False, True):
                rounds, counts = questions_by_round(asked, epsilon, speculative=ahead)
                times = " | ".join(told(seconds_of(rounds, w, SECONDS)) for w in WORKERS)
                print(
                    f"| {name} | {epsilon} | {words} | {'yes' if ahead else 'no'} | {counts.vertices:,} "
                    f"| {sum(rounds):,} | {counts.rounds} | {times} |"
                )


def check(seconds: float = 0.02, workers: int = 16) -> None:
    for name, oracle, epsilon in CASES[1:3]:
        rounds, _ = questions_by_round(ClosestPointsAlone(oracle), epsilon, speculative=False)
        begin = time.perf_counter()
        slow = ClosestPointsAlone(oracle, seconds)
        stellate.mesh(slow, epsilon, speculative=False, workers=workers)
        clock = time.perf_counter() - begin
        print(f"{name}: {clock / seconds_of(rounds, workers, seconds):.2f} times the model's")


if __name__ == "__main__":
    if sys.argv[1:] not in ([], ["--check"]):
        print(__doc__)
        sys.exit(0 if sys.argv[1:] == ["--help"] else 2)
    check() if sys.argv[1:] else print_table()
