"""Probes an oracle for its contract, before a mesh is made of its answers."""

from __future__ import annotations

import functools
import numbers
import time
from collections.abc import Mapping
from typing import Any, Callable

import numpy as np

from .._shared import table
from ..errors import InvalidArgument, OracleError
from .equations import examine_rank
from .findings import CheckReport, Finding
from .probe import Probe, Stop, norms
from .walls import WallProbe

_K: Mapping[str, Any] = table("doctor.toml")
_ORDER = ("error", "warning", "note")


def check(oracle: Any, epsilon: float | None = None, *, seed: int = 1) -> CheckReport:
    """Probes an oracle: is it what stellate.Oracle says an oracle is?

    Shapes, finiteness and determinism; closest points that are closest, on M and met at right
    angles; the dimension; tangent bases; walls, where there are any; intersections with flats; smoothness; the reach and
    whether `epsilon` suits it; the components seen; speed.

    Args:
      oracle: see stellate.Oracle.
      epsilon: that a mesh is planned with.
      seed: of the random queries.

    Returns:
      All that was found, `ok` if no error is among it. Exceptions of the oracle are findings too.
    """
    if epsilon is not None and not isinstance(epsilon, numbers.Real):
        raise InvalidArgument(f"epsilon has to be a length, and is {epsilon!r}")
    examination = _Examination(epsilon, seed)
    try:
        examination.run(oracle)
    except Stop as stop:
        examination.add(stop.finding)
    return examination.report()


class _Examination:
    def __init__(self, epsilon: float | None, seed: int) -> None:
        self._epsilon, self._seed = epsilon, seed
        self._findings: dict[str, Finding] = {}
        self._probe: Probe | None = None
        self._walls: WallProbe | None = None
        self._reach: float | None = None
        self._pieces: int | None = None
        self._rates: dict[int, float] = {}
        self._best: int | None = None

    def add(self, finding: Finding) -> None:
        """The first finding of each kind is kept."""
        self._findings.setdefault(finding.code, finding)

    def run(self, oracle: Any) -> None:
        try:
            probe = self._probe = Probe(oracle, self._seed)
        except (InvalidArgument, OracleError) as error:
            raise Stop(Finding.of("WRONG_SHAPE", what=str(error))) from None
        probe.find_points(self.add)
        for line in _K["laws"]:
            name, *passed_over = line.split()  # "unless" and codes
            if probe.fills_space and name in _K["of_normals"]:
                continue
            if not any(code in self._findings for code in passed_over):
                getattr(self, f"_{name}")(probe)

    def report(self) -> CheckReport:
        ordered = sorted(self._findings.values(), key=lambda f: _ORDER.index(f.severity))
        probe = self._probe
        return CheckReport(
            findings=tuple(ordered),
            samples=0 if probe is None else len(probe.points),
            queries=0 if probe is None else probe.queries,
            reach=self._reach,
            pieces=self._pieces,
            rates=self._rates,
            best_batch=self._best,
        )

    # Laws of closest points.

    def _answers_repeat(self, probe: Probe) -> None:
        x = probe.starts
        first, second = probe.closest(x)[0], probe.closest(x)[0]
        row = _first(norms(first - second) > 0)
        if row is not None:
            self.add(
                Finding.of("NOT_DETERMINISTIC", query=x[row], answer=first[row], other=second[row])
            )
            return
        halves = np.concatenate([probe.closest(part)[0] for part in np.array_split(x[::-1], 3)])
        alone = np.concatenate([probe.closest(row[None])[0] for row in x[: _K["single_questions"]]])
        for rows, other in ((np.arange(len(x)), halves[::-1]), (np.arange(len(alone)), alone)):
            row = _first(norms(first[rows] - other) > _K["batch_slack"] * probe.size)
            if row is not None:
                self.add(
                    Finding.of("BATCH_DEPENDENT", query=x[row], answer=first[row], other=other[row])
                )

    def _answers_stay(self, probe: Probe) -> None:
        p = probe.points
        again, found = probe.closest(p)
        moved = np.where(found, norms(again - p), np.inf)
        worst = int(moved.argmax())
        if moved[worst] > _K["slack"] * probe.size:
            self.add(
                Finding.of(
                    "NOT_IDEMPOTENT", query=p[worst], answer=again[worst], moved=moved[worst]
                )
            )
        elif moved[worst] > _K["noise"] * probe.size:
            self.add(Finding.of("NOISY", query=p[worst], moved=moved[worst]))

    def _answers_are_closest(self, probe: Probe) -> None:
        """Far from M a nearer answer is a warning only: solvers find local minima there."""
        self._compare(probe, probe.starts, probe.points, "NOT_CLOSEST_FAR")

    def _compare(self, probe: Probe, x: np.ndarray, y: np.ndarray, code: str) -> None:
        """Adds `code` where another point of M that was seen is nearer to a row of x than of y."""
        own = norms(x - y)
        for row in range(len(x)):
            others = norms(probe.points - x[row])
            nearest = int(others.argmin())
            if own[row] > others[nearest] + _K["slack"] * probe.size:
                other = probe.points[nearest]
                self.add(
                    Finding.of(
                        code,
                        query=x[row],
                        answer=y[row],
                        own=own[row],
                        other=other,
                        seen=others[nearest],
                    )
                )
                return

    def _near_points_come_back(self, probe: Probe) -> None:
        """Off M along a normal by a part of the reach, and back: closest, and at right angles."""
        p, t = probe.some, probe.moved_tangents
        for share in _K["offsets"]:
            x = p + share * self._near * probe.normals(t)
            y, found = probe.closest(x)
            keep = np.flatnonzero(found)
            if not keep.size:
                continue
            self._compare(probe, x[keep], y[keep], "NOT_CLOSEST")
            away = x[keep] - y[keep]
            lengths = norms(away)
            keep = keep[lengths > _K["least_offset"] * share * self._near]
            away = x[keep] - y[keep]
            sine = norms(probe.along(probe.tangents_at(y[keep]), away)) / norms(away)
            leaning = np.degrees(np.arcsin(np.minimum(1.0, sine)))
            row = _first(leaning > _K["tolerated_degrees"])
            if row is not None:
                self.add(
                    Finding.of(
                        "NOT_NORMAL", query=x[keep[row]], answer=y[keep[row]], degrees=leaning[row]
                    )
                )

    # Dimension, tangents, smoothness.

    def _dimension_is_right(self, probe: Probe) -> None:
        probe.find_tangents()
        self._judge_ranks(probe, _K["wrong_ranks"])

    def _few_ranks_are_wrong(self, probe: Probe) -> None:
        self._judge_ranks(probe, _K["few_wrong_ranks"])

    def _judge_ranks(self, probe: Probe, share: float) -> None:
        """Samples on an edge are odd ones out, which the smoothness test names better."""
        wrong = probe.ranks != probe.dimension
        if np.count_nonzero(wrong) > share * len(wrong):
            row = _first(wrong)
            self.add(
                Finding.of(
                    "WRONG_DIMENSION",
                    query=probe.some[row],
                    rank=int(probe.ranks[row]),
                    k=probe.dimension,
                )
            )

    def _sizes_are_lengths(self, probe: Probe) -> None:
        if not probe.has_local_size:
            return
        p = probe.some
        sizes = probe.sizes(p)
        row = _first(~((sizes >= _K["least_size"]) & (sizes <= 1 / _K["least_size"])))
        if row is not None:
            self.add(Finding.of("SIZE_WRONG", query=p[row], size=sizes[row]))
            return
        alone = np.concatenate([probe.sizes(one[None]) for one in p])
        row = _first(np.abs(sizes - alone) > _K["size_slack"] * sizes)
        if row is not None:
            self.add(Finding.of("SIZE_CHANGES", query=p[row], size=sizes[row], other=alone[row]))

    def _tangents_are_right(self, probe: Probe) -> None:
        if not probe.has_tangent_basis:
            self.add(Finding.of("NO_TANGENTS", extra=2 * probe.dimension))
            return
        bases, k = probe.given_tangents, probe.dimension
        off = np.abs(bases.transpose(0, 2, 1) @ bases - np.eye(k)).max(axis=(1, 2))
        row = _first(off > _K["orthonormal_slack"])
        if row is not None:
            self.add(Finding.of("TANGENT_NOT_ORTHONORMAL", query=probe.some[row], off=off[row]))
        if "WRONG_DIMENSION" in self._findings:
            return
        usable = (probe.ranks == k) & (off <= _K["usable_tangents"])
        turned = np.degrees(probe.turn(np.linalg.qr(bases)[0], probe.moved_tangents))
        row = _first(usable & (turned > _K["tolerated_degrees"]))
        if row is not None:
            self.add(Finding.of("TANGENT_WRONG", query=probe.some[row], degrees=turned[row]))
        probe.trusts_given = row is None and "TANGENT_NOT_ORTHONORMAL" not in self._findings

    def _equations_have_rank(self, probe: Probe) -> None:
        if probe.has_jacobian and probe.size > 0:
            examine_rank(probe, self.add)

    def _walls_are_right(self, probe: Probe) -> None:
        if probe.walls:
            self._walls = WallProbe(probe, self.add)
            self._walls.examine()

    def _reach_is_estimated(self, probe: Probe) -> None:
        p, t = probe.some, probe.moved_tangents
        difference = probe.points[None] - p[:, None]
        reach = probe.reach_from(difference, t)
        step = _K["reach_step"] * min(reach, probe.size)
        for a in range(probe.dimension):
            q, found = probe.closest(p + step * t[:, :, a])
            if found.any():
                reach = min(reach, probe.reach_from((q - p)[found][:, None], t[found]))
        if self._walls is not None:
            reach = min(reach, self._walls.reach(), _K["flat_reach"] * probe.size)
        self._reach = reach
        advised = _K["safe_ratio"] * reach
        self.add(Finding.of("REACH", reach=reach, advised=advised))
        if self._epsilon is not None and self._epsilon > advised:
            ratio = self._epsilon / reach
            self.add(
                Finding.of(
                    "COARSE_EPSILON",
                    epsilon=self._epsilon,
                    ratio=ratio,
                    reach=reach,
                    advised=advised,
                )
            )

    @property
    def _near(self) -> float:
        """A length within which M should look like its tangent spaces."""
        assert self._reach is not None
        return (
            self._reach
            if self._epsilon is None
            else min(self._reach, _K["near_epsilons"] * self._epsilon)
        )

    def _surface_is_smooth(self, probe: Probe) -> None:
        """Where tangents turn between two points, halving the way halves the turn: not at corners.

        Ways start at the neighbouring samples that turn most; of two halves the one that turns more
        is kept.
        """
        a, b = probe.most_turned_neighbours()
        for _ in range(_K["halvings"]):
            middle, found = probe.closest((a + b) / 2)
            a, b, middle = a[found], b[found], middle[found]
            if not len(a):
                return
            ta, tm, tb = (probe.tangents_at(x) for x in (a, middle, b))
            first = (probe.turn(ta, tm) >= probe.turn(tm, tb))[:, None]
            a, b = np.where(first, a, middle), np.where(first, middle, b)
        turned = np.degrees(probe.turn(probe.tangents_at(a), probe.tangents_at(b)))
        lengths = norms(a - b)
        row = _first((turned > _K["corner_degrees"]) & (lengths < _K["corner_length"] * probe.size))
        if row is not None:
            self.add(
                Finding.of("ROUGH", query=a[row], degrees=turned[row], length=float(lengths[row]))
            )

    # Flats, components, speed.

    def _flats_are_met(self, probe: Probe) -> None:
        if not probe.has_intersect_flat:
            return
        p, d, k = probe.some, probe.ambient_dimension, probe.dimension
        for tilt in _K["tilts"]:
            lean = tilt * probe.random.uniform(-1, 1, (len(p), d, k)) / np.sqrt(d)
            bases = np.linalg.qr(probe.moved_tangents + lean)[0]
            centers = p + _K["flat_offset"] * self._near * probe.normals(bases)
            self._meet(probe, centers, bases, p)

    def _meet(self, probe: Probe, c: np.ndarray, t: np.ndarray, p: np.ndarray) -> None:
        """Each flat through a row of c meets M in the row of p, and perhaps nearer."""
        radii = np.full(len(c), _K["flat_radius"] * self._near)
        m, found = probe.intersect(c, t, radii)
        seen = norms(p - c)
        row = _first(~found)
        if row is not None:
            self.add(Finding.of("FLAT_MISSED", query=c[row], answer=p[row], radius=radii[row]))
        c, t, m, p, seen = c[found], t[found], m[found], p[found], seen[found]
        if not len(c):
            return
        own, off = norms(m - c), norms(probe.along(t, m - c))
        again, there = probe.closest(m)
        moved = np.where(there, norms(again - m), np.inf)
        slack = _K["slack"] * probe.size
        for code, wrong, more in (
            ("FLAT_OFF", off > slack, {"off": off}),
            ("FLAT_OFF_MANIFOLD", moved > slack, {"moved": moved}),
            ("FLAT_NOT_NEAREST", own > seen + slack, {"own": own, "seen": seen, "other": p}),
        ):
            row = _first(wrong)
            if row is not None:
                values = {name: value[row] for name, value in more.items()}
                self.add(Finding.of(code, query=c[row], answer=m[row], **values))
        short = _K["short_radius"] * own
        m, found = probe.intersect(c, t, short)
        row = _first(found & (norms(m - c) > short + slack))
        if row is not None:
            self.add(
                Finding.of(
                    "FLAT_OUTSIDE_RADIUS",
                    query=c[row],
                    answer=m[row],
                    own=float(norms(m - c)[row]),
                    radius=short[row],
                )
            )

    def _pieces_are_counted(self, probe: Probe) -> None:
        self._pieces = probe.pieces()
        self.add(Finding.of("PIECES", n=len(probe.points), pieces=self._pieces))

    def _speed_is_measured(self, probe: Probe) -> None:
        asked = probe.queries
        for batch in _K["batches"]:
            x = probe.starts[np.arange(batch) % len(probe.starts)]
            seconds = _seconds(functools.partial(probe.closest, x))
            self._rates[batch] = batch / seconds
            if seconds > 10 * _K["speed_seconds"]:
                break
        probe.queries = asked  # that was no examination
        best = max(self._rates.values())
        self._best = next(n for n, rate in self._rates.items() if rate >= _K["good_rate"] * best)
        rates = {"rate": _rounded(best), "batch": self._best}
        self.add(Finding.of("SPEED", **rates, single=_rounded(self._rates[1])))
        if best < _K["slow_rate"]:
            self.add(Finding.of("SLOW", **rates, minutes=_K["mesh_queries"] / best / 60))


def _rounded(rate: float) -> int:
    """To two digits, as it is measured."""
    return int(float(f"{rate:.2g}"))


def _first(where: np.ndarray) -> int | None:
    rows = np.flatnonzero(where)
    return int(rows[0]) if rows.size else None


def _seconds(call: Callable[[], object]) -> float:
    """The least time that one call took, of as many as fit."""
    best, deadline = np.inf, time.perf_counter() + _K["speed_seconds"]
    while True:
        begin = time.perf_counter()
        call()
        end = time.perf_counter()
        best = min(best, end - begin)
        if end > deadline:
            return max(best, 1e-9)
