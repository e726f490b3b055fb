"""What check() asks of the walls of a manifold with boundary."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any, Callable

import numpy as np

from .._shared import table
from .findings import Finding
from .probe import Probe, norms

_K: Mapping[str, Any] = table("doctor.toml")


class WallProbe:
    """The walls of an oracle under examination.

    Attributes:
      points: (n, d) of each wall, those of its face that lie in M.
    """

    def __init__(self, probe: Probe, add: Callable[[Finding], None]) -> None:
        self._probe, self._add = probe, add
        self._slack = _K["clearance_slack"] * probe.size
        self.points: list[np.ndarray] = []

    def examine(self) -> None:
        probe = self._probe
        stride = len(probe.points) // max(_K["some"], _K["starts"] // probe.walls)
        questions = probe.points[:: max(1, stride)]
        unseen = set()
        for wall in range(probe.walls):
            y, found = probe.face(questions, (wall,))
            self.points.append(self._one(wall, y[found]) if found.any() else y[:0])
            if not found.any() and self._crosses(wall):
                unseen.add(wall)
        if not unseen and not any(map(len, self.points)):
            self._anything_left()
        elif any(map(len, self.points)) and probe.dimension > 1:
            pairs = itertools.combinations(range(probe.walls), 2)
            for pair in itertools.islice(pairs, _K["face_pairs"]):
                y, found = probe.face(probe.some, pair)
                self._two(pair, y[found])
        for wall, points in enumerate(self.points):
            if not len(points) and wall not in unseen:
                self._add(Finding.of("WALL_CUTS_NOTHING", wall=wall))

    def reach(self) -> float:
        """Of the boundary, by Federer's quotient on each wall."""
        least = np.inf
        for wall, points in enumerate(self.points):
            if not len(points):
                continue
            normals = self._probe.conormals(points, (wall,))[:, 0]
            bases = self._probe.bases(points)
            across = self._probe.along(bases, normals)[:, :, None]
            rim = bases @ np.linalg.svd(across, full_matrices=True)[0][:, :, 1:]
            differences = points[None] - points[:, None]
            least = min(least, self._probe.reach_from(differences, rim))
        return least

    def _say(self, code: str, where: np.ndarray, **values: Any) -> None:
        """Adds the finding for the first row of `where`, if any; arrays are of values by rows."""
        rows = np.flatnonzero(where)
        if rows.size:
            row = int(rows[0])
            of_row = {k: v[row] if isinstance(v, np.ndarray) else v for k, v in values.items()}
            self._add(Finding.of(code, **of_row))

    def _one(self, wall: int, y: np.ndarray) -> np.ndarray:
        """The laws of one wall at points of its face; gives those of them that lie in M."""
        probe = self._probe
        again, there = probe.closest(y)
        moved = np.where(there, norms(again - y), np.inf)
        self._say("FACE_OFF_MANIFOLD", moved > self._slack, wall=wall, query=y, moved=moved)
        y = np.ascontiguousarray(y[moved <= self._slack])
        if not len(y):
            return y
        bases, normals = probe.bases(y), probe.conormals(y, (wall,))[:, 0]
        slopes = self._slopes(wall, y, bases)
        steep = norms(slopes)
        touches = steep <= _K["least_steepness"] * np.median(steep)
        self._say("WALL_TOUCHES", touches, wall=wall, query=y)
        clearances = probe.clearances(y)
        value = clearances[:, wall]
        off = np.abs(value) / np.where(touches, np.inf, np.maximum(steep, 1e-300))
        self._say("FACE_CLEARANCE", off > self._slack, wall=wall, query=y, clearance=value, off=off)
        self._conormals(wall, y, bases, normals, np.where(touches[:, None], 0.0, slopes))
        self._closest(wall, y)
        others = np.delete(clearances, wall, axis=1)
        return np.ascontiguousarray(y[(others >= -self._slack).all(axis=1)])

    def _conormals(
        self, wall: int, y: np.ndarray, bases: np.ndarray, n: np.ndarray, slopes: np.ndarray
    ) -> None:
        lengths = norms(n)
        unit = n / np.maximum(lengths, 1e-300)[:, None]
        along = self._probe.along(bases, unit)
        out = np.minimum(1.0, norms(unit - (bases @ along[..., None])[..., 0]))
        wrong = np.abs(lengths - 1) > _K["conormal_slack"]
        self._say("CONORMAL_NOT_UNIT", wrong, wall=wall, query=y, length=lengths)
        leans = out > _K["conormal_slack"]
        degrees = np.degrees(np.arcsin(out))
        self._say("CONORMAL_NOT_TANGENT", leans, wall=wall, query=y, degrees=degrees)
        steep, within = norms(slopes), np.maximum(norms(along), 1e-300)
        cosine = -(along * slopes).sum(axis=1) / (within * np.where(steep > 0, steep, 1.0))
        turned = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        inward = (steep > 0) & (turned > 90)
        self._say("CONORMAL_INWARD", inward, wall=wall, query=y)
        wrong = (steep > 0) & ~inward & (turned > _K["tolerated_degrees"])
        self._say("CONORMAL_WRONG", wrong, wall=wall, query=y, degrees=turned)

    def _crosses(self, wall: int) -> bool:
        """Looks between samples on both sides for where a wall of which no point is found is zero."""
        probe = self._probe
        value = probe.clearances(probe.points)[:, wall]
        inside, outside = probe.points[value > 0], probe.points[value < 0]
        if not len(inside) or not len(outside):
            return False
        ways = norms((inside[:, None] - outside[None]).reshape(-1, probe.points.shape[1]))
        pair = np.unravel_index(ways.argmin(), (len(inside), len(outside)))
        ends = np.stack([inside[pair[0]], outside[pair[1]]])
        while (way := float(norms(ends[:1] - ends[1:])[0])) > self._slack:
            middle, found = probe.closest(ends.mean(axis=0, keepdims=True))
            if not found[0] or norms(ends - middle).max() > _K["farthest_middle"] * way:
                return False  # they are on two components
            ends[int(probe.clearances(middle)[0, wall] <= 0)] = middle[0]
        self._add(Finding.of("FACE_NOT_FOUND", wall=wall, query=ends[0]))
        return True

    def _slopes(self, wall: int, y: np.ndarray, bases: np.ndarray) -> np.ndarray:
        """How the wall's value changes along M, (n, k)."""
        h = _K["differential_step"] * self._probe.size
        columns = []
        for a in range(self._probe.dimension):
            ends = [self._probe.closest(y + sign * h * bases[:, :, a])[0] for sign in (1, -1)]
            ahead, behind = (self._probe.clearances(end)[:, wall] for end in ends)
            columns.append((ahead - behind) / (2 * h))
        return np.stack(columns, axis=1)

    def _closest(self, wall: int, y: np.ndarray) -> None:
        """From near a point of the face that, or a nearer one, is the nearest."""
        units = self._probe.random.standard_normal(y.shape)
        away = _K["face_offset"] * self._probe.size
        x = y + away * units / norms(units)[:, None]
        answers, found = self._probe.face(x, (wall,))
        own = np.where(found, norms(answers - x), np.inf)
        far = own > away + self._slack
        values = {"query": x, "answer": answers, "own": own, "other": y, "seen": away}
        self._say("FACE_NOT_CLOSEST", far, wall=wall, **values)

    def _two(self, pair: tuple[int, int], y: np.ndarray) -> None:
        """The laws of two walls where they meet inside the others."""
        if len(y):
            y = np.ascontiguousarray(y[(self._probe.clearances(y) >= -self._slack).all(axis=1)])
        if not len(y):
            return
        n = self._probe.conormals(y, pair)
        cosine = -(n[:, 0] * n[:, 1]).sum(axis=1)
        degrees = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        named = {"wall": pair[0], "other": pair[1], "query": y, "degrees": degrees}
        tangential = 1 - np.abs(cosine) < _K["least_transversality"]
        self._say("WALLS_TANGENTIAL", tangential, **named)
        least = _K["acute_degrees"]
        acute = ~tangential & (degrees < least) & (self._probe.dimension > 2)
        self._say("ACUTE_EDGE", acute, **named, least=least)

    def _anything_left(self) -> None:
        p = self._probe.points
        clearances = self._probe.clearances(p)
        if (clearances.min(axis=1) < 0).all():
            wall = int(clearances[0].argmin())
            self._add(Finding.of("NOTHING_LEFT", n=len(p), query=p[0], wall=wall))
