#!/usr/bin/env python3
"""Measures Stellate beside its peers, in one run and on the same manifolds.

Each measurement is a process of its own, so that its memory is its own; times are processor time,
so that what else the machine does matters little. For every case the peer is brought to about the
number of vertices asked for, then Stellate to the same number of vertices, and to the same measured
distance from the manifold. Writes table.md, table.csv and plot.png.
"""

from __future__ import annotations

import argparse
import json
import math
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import report
from suite import CASES, Case, Mesher

COUNT_TOLERANCE = 0.03  # of the number of vertices, relative
ERROR_TOLERANCE = 0.05  # of the Hausdorff distance, relative
MAX_TRIES = 5
LONG_SECONDS = 5.0  # what takes longer is measured once


class Failed(Exception):
    """A measurement ended without a result."""


@dataclass(frozen=True)
class Runner:
    """Starts the measurements."""

    binary: Path
    timeout: float

    def measure(self, mesher: Mesher, size: float, quality: bool = True) -> dict[str, Any]:
        """One run of one mesher in a process of its own."""
        command = [str(self.binary), mesher.program, mesher.manifold, repr(size), *mesher.options]
        if not quality:
            command.append("--no-quality")
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, timeout=self.timeout, check=False
            )
        except subprocess.TimeoutExpired as late:
            raise Failed(f"{mesher.name}: no result in {self.timeout:.0f} s") from late
        if done.returncode != 0:
            raise Failed(f"{mesher.name}: {done.stderr.strip() or done.returncode}")
        result: dict[str, Any] = json.loads(done.stdout)
        return result

    def fit_count(self, mesher: Mesher, count: int) -> dict[str, Any]:
        """A run with about that many vertices."""
        start = mesher.start_size or float(count)
        return self.fit(mesher, start, ("vertices", count, mesher.exponent), COUNT_TOLERANCE)

    def fit(
        self, mesher: Mesher, size: float, goal: tuple[str, float, float], tolerance: float
    ) -> dict[str, Any]:
        """Looks for the size at which a quantity is met.

        goal: the quantity's name, the value wanted, and the power of the size that it goes with.
        """
        quantity, wanted, power = goal
        best: dict[str, Any] = {}
        for _ in range(MAX_TRIES):
            result = self.measure(mesher, size)
            if not best or off(result[quantity], wanted) < off(best[quantity], wanted):
                best = result
            if off(best[quantity], wanted) < tolerance:
                break
            size = result["size"] * (wanted / result[quantity]) ** (1 / power)
        return best


def off(value: float, wanted: float) -> float:
    """How far a positive value is from the one wanted, relative."""
    return abs(math.log(value / wanted))


def steady(runner: Runner, results: list[tuple[Mesher, dict[str, Any]]], repeats: int) -> None:
    """Runs everything again, in turn, and keeps the least processor time of each."""
    for _ in range(repeats - 1):
        for mesher, result in results:
            if result["seconds"] > LONG_SECONDS:
                continue
            again = runner.measure(mesher, result["size"], quality=False)
            if again["seconds"] < result["seconds"]:
                for key in ("seconds", "oracle_seconds", "certificate_seconds"):
                    result[key] = again[key]


def compare(runner: Runner, case: Case, count: int, repeats: int) -> list[report.Row]:
    """The rows of one case at one size."""
    peer = runner.fit_count(case.peer, count)
    same_count = runner.fit_count(case.ours, peer["vertices"])

    # A mesh that is no coarser than Stellate may be used at is then better than need be.
    guess = same_count["size"] * math.sqrt(peer["hausdorff"] / same_count["hausdorff"])
    if guess >= case.coarsest:
        same_error = runner.measure(case.ours, case.coarsest)
    else:
        error = ("hausdorff", peer["hausdorff"], 2.0)
        same_error = runner.fit(case.ours, guess, error, ERROR_TOLERANCE)

    results = [(case.peer, peer), (case.ours, same_count), (case.ours, same_error)]
    steady(runner, results, repeats)
    return report.rows_of(case, peer, same_count, same_error)


def main() -> int:
    """Runs the cases that are asked for."""
    parser = argparse.ArgumentParser(prog="tests/bench/run peers", description=__doc__)
    parser.add_argument(
        "--full", action="store_true", help="the large meshes too: some ten minutes"
    )
    parser.add_argument("--only", metavar="REGEX", default="", help="cases that it is found in")
    parser.add_argument("--list", action="store_true", help="print the cases and stop")
    parser.add_argument("--repeats", type=int, default=3, help="of short measurements (default 3)")
    parser.add_argument("--timeout", type=float, default=1800, help="seconds for one measurement")
    parser.add_argument(
        "--update-docs", action="store_true", help="write into docs/evidence/benchmarks.md"
    )
    parser.add_argument("--binary", type=Path, required=True, help=argparse.SUPPRESS)
    parser.add_argument("--output", type=Path, required=True, help=argparse.SUPPRESS)
    arguments = parser.parse_args()

    chosen = [
        (case, count)
        for case in CASES
        for count in (*case.quick, *(case.full if arguments.full else ()))
        if re.search(arguments.only, case.name(count))
    ]
    if arguments.list:
        print("\n".join(case.name(count) for case, count in chosen))
        return 0
    if not chosen:
        parser.error(f"no case matches '{arguments.only}'; see --list")

    runner = Runner(arguments.binary, arguments.timeout)
    rows: list[report.Row] = []
    failures: list[str] = []
    for case, count in chosen:
        print(f"{case.name(count)} ...", flush=True)
        try:
            rows += compare(runner, case, count, arguments.repeats)
        except Failed as failure:
            failures.append(f"{case.name(count)}: {failure}")
            print(f"  failed: {failure}", flush=True)
            continue
        for row in rows[-3:]:
            print(f"  {row.summary()}", flush=True)
        report.write(arguments.output, rows, arguments.update_docs)
    print(f"\nWrote table.md, table.csv and plot.png into {arguments.output}")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
