"""Meshes of arrangements whose regions are known: what is certified of them, and whether it is so.

    tests/truth/arrangements/run [--runs N] [--seed S] [--family NAME]... [--case N] [--log FILE]

Run n is of family n modulo their number, turned, moved, enlarged and of a size of its own; a third of
those that fill space as their boundary alone. Prints a table by family. Fails when a certificate was
false, or when fewer than 99 in 100 were certified.
"""

from __future__ import annotations

import collections
import dataclasses
import sys
import time

import command
import numpy as np
import stellate
from families import FAMILIES, Case
from judge import Finding, judge, judge_surface

_LATE = ("cut four-torus in R^8, two labels",)  # half a minute each: asked for by name
_MOST_VERTICES = 60_000


@dataclasses.dataclass
class Run:
    """What became of one.

    Attributes:
      outcome: "right", "false", "refused" or an error's reason.
    """

    family: str
    number: int
    outcome: str
    words: str = ""
    alone: bool = False
    share: float = 0.0  # epsilon, in the truth's coordinates
    vertices: int = 0
    queries: int = 0
    seconds: float = 0.0
    angle: float = 180.0
    radius: float = 0.0  # the largest circumradius, in epsilons
    off_walls: float = 0.0
    volume_error: float = 0.0


def one(family: str, number: int, seed: int, server: stellate.Server) -> Run:
    rng = np.random.default_rng([seed, number])
    case = FAMILIES[family](rng)
    share = float(np.exp(rng.uniform(np.log(case.finest), np.log(case.coarsest))))
    alone = case.alone and rng.random() < 1 / 3
    run = Run(family, number, "right", alone=alone, share=share)
    began = time.monotonic()
    try:
        mesh = stellate.mesh(
            case.oracle,
            share * case.motion.scale,
            server=server,
            random_seed=int(rng.integers(1, 1 << 30)),
            boundary_only=alone or None,
            max_vertices=_MOST_VERTICES,
        )
    except stellate.StellateError as error:
        run.outcome, run.words = error.reason, str(error)
        return run
    run.seconds = time.monotonic() - began
    run.vertices, run.queries = len(mesh.points), mesh.report.counts.queries
    run.radius = mesh.report.certificate.max_circumradius / (share * case.motion.scale)
    if not mesh.certified:
        run.outcome, run.words = "refused", mesh.report.certificate.verdict
        return run
    found = _judged(mesh, case, share, alone)
    run.angle, run.off_walls = found.least_angle, found.off_walls
    run.volume_error = found.volume_error
    if found.wrong:
        run.outcome, run.words = "false", "; ".join(found.wrong)
    return run


def _judged(mesh: stellate.Mesh, case: Case, share: float, alone: bool) -> Finding:
    points, labels = case.motion.back(mesh.points), mesh.labels
    told = {region.label: region for region in mesh.report.certificate.regions}
    if alone:
        sides = np.array(mesh.labels)
        if np.linalg.det(case.motion.turn) < 0:
            sides = sides[:, ::-1]  # a mirror turns normals round
        found = judge_surface(points, mesh.simplices, sides, case.truth, share)
    else:
        if labels is None:  # an intersection of half-walls
            labels = np.ones(len(mesh.simplices), dtype=int)
        found = judge(points, mesh.simplices, labels, case.truth, share)
        told_chi = {label: region.euler_characteristic for label, region in told.items()}
        if told and told_chi != found.euler:
            found.wrong.append(f"the certificate says chi {told_chi}, and there is {found.euler}")
    return found


def table(runs: list[Run]) -> str:
    by_family = collections.defaultdict(list)
    for run in runs:
        by_family[run.family].append(run)
    lines = [
        "family                          runs right false refused failed  vertices  us/vertex"
        "  queries/vertex  least angle  radius  off walls  volume"
    ]
    for family, own in [*by_family.items(), ("all", runs)]:
        done = [run for run in own if run.vertices]
        counts = collections.Counter(run.outcome for run in own)
        failed = len(own) - sum(counts[word] for word in ("right", "false", "refused"))
        vertices = sum(run.vertices for run in done) or 1
        lines.append(
            f"{family:31s} {len(own):4d} {counts['right']:5d} {counts['false']:5d} "
            f"{counts['refused']:7d} {failed:6d} {vertices / max(len(done), 1):9.0f} "
            f"{1e6 * sum(run.seconds for run in done) / vertices:10.0f} "
            f"{sum(run.queries for run in done) / vertices:15.2f} "
            f"{min((run.angle for run in done), default=0):12.1f} "
            f"{max((run.radius for run in done), default=0):7.3f} "
            f"{max((run.off_walls for run in done), default=0):10.1e} "
            f"{max((run.volume_error for run in done), default=0):7.2f}"
        )
    return "\n".join(lines)


def main() -> int:
    parser = command.parser(__doc__, 300, "how many (300)")
    parser.add_argument("--family", action="append", choices=FAMILIES, help="these alone")
    parser.add_argument("--verbose", action="store_true", help="a line for each run")
    given = parser.parse_args()
    families = given.family or [name for name in FAMILIES if name not in _LATE]
    numbers = range(given.runs) if given.case is None else [given.case]

    def mesh(number: int, server: stellate.Server) -> Run:
        return one(families[number % len(families)], number, given.seed, server)

    def show(number: int, run: Run) -> None:
        if run.outcome == "right" and not given.verbose and given.case is None:
            return
        only = "".join(f" --family {name!r}" for name in given.family or ())
        print(
            f"{run.family}: {run.outcome}{', boundary alone' if run.alone else ''}, epsilon "
            f"{run.share:.3f}, {run.seconds:.1f} s (--seed {given.seed}{only} --case {number})"
            f"{': ' if run.words else ''}{run.words}",
            flush=True,
        )

    runs = command.run_all(numbers, mesh, show)
    print(table(runs))
    right = sum(run.outcome == "right" for run in runs)
    false = sum(run.outcome == "false" for run in runs)
    return 0 if not false and right >= 0.99 * len(runs) else 1


if __name__ == "__main__":
    sys.exit(main())
