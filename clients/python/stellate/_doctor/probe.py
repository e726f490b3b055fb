"""The questions that check() asks, and the geometry it draws from the answers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Callable

import numpy as np

from .._shared import table
from ..errors import OracleError
from ..oracle import CheckedOracle
from .findings import Finding

_K: Mapping[str, Any] = table("doctor.toml")


# What an oracle's own complaints are found as; others are of what it answered.
_CODES = {
    "ORACLE_NOT_FINITE": "NOT_FINITE",
    "ORACLE_PRECISION": "INEXACT",
    "ORACLE_TOUCHES_ZERO": "TOUCHES_ZERO",
}


class Stop(Exception):
    """A finding that leaves nothing to go on with."""

    def __init__(self, finding: Finding) -> None:
        super().__init__(finding.code)
        self.finding = finding


def norms(rows: np.ndarray) -> np.ndarray:
    return np.sqrt((rows * rows).sum(axis=-1))


class Probe:
    """An oracle under examination, with the points of M that it has given away.

    Attributes:
      starts: (n, d) questions, and points: (n, d) their answers, points of M.
      some: (m, d), a part of the points; ranks (m,) of the differential of the closest point map
        there, moved_tangents (m, d, k) that span its image, given_tangents the oracle's own.
      size: the diagonal of the points' bounding box.
      trusts_given: the oracle's own tangent bases have proved right.
    """

    def __init__(self, oracle: Any, seed: int) -> None:
        self._oracle = checked = CheckedOracle(oracle)
        self.dimension, self.ambient_dimension = checked.dimension, checked.ambient_dimension
        self.has_tangent_basis = checked.has_tangent_basis
        self.has_intersect_flat = checked.has_intersect_flat
        self.has_local_size = checked.has_local_size
        self.has_jacobian = checked.has_jacobian
        self.walls = checked.walls
        self.fills_space = self.dimension == self.ambient_dimension
        self.random = np.random.default_rng(seed)
        self.queries = 0
        self.starts = self.points = self.some = np.empty((0, self.ambient_dimension))
        self.size = 0.0
        self.trusts_given = False

    # Questions.

    def closest(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self._ask("closest_point", self._oracle.closest_points, x)

    def intersect(self, c: np.ndarray, t: np.ndarray, radii: np.ndarray) -> tuple[Any, Any]:
        return self._ask("intersect_flat", self._oracle.intersections, c, t, radii)

    def _given_at(self, p: np.ndarray) -> np.ndarray:
        everywhere = np.ones(len(p), dtype=bool)
        return self._ask("tangent_basis", self._oracle.tangents, p, everywhere)

    def sizes(self, p: np.ndarray) -> np.ndarray:
        everywhere = np.ones(len(p), dtype=bool)
        return self._ask("local_size", self._oracle.sizes, p, everywhere)

    def jacobian(self, p: np.ndarray) -> np.ndarray:
        return self._ask("jacobian", self._oracle.jacobians, p)

    def face(self, x: np.ndarray, face: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
        return self._ask("face_point", lambda at: self._oracle.face_points(at, face), x)

    def clearances(self, p: np.ndarray) -> np.ndarray:
        everywhere = np.ones(len(p), dtype=bool)
        return self._ask("clearances", self._oracle.clearances, p, everywhere)

    def conormals(self, p: np.ndarray, face: tuple[int, ...]) -> np.ndarray:
        everywhere = np.ones(len(p), dtype=bool)
        return self._ask(
            "conormals", lambda a, f: self._oracle.conormals(a, f, face), p, everywhere
        )

    def _ask(self, method: str, ask: Callable[..., Any], *arrays: np.ndarray) -> Any:
        self.queries += len(arrays[0])
        arguments = [np.array(array) for array in arrays]  # whatever is done to them
        try:
            return ask(*arguments)
        except OracleError as error:
            code = _CODES.get(error.reason, "WRONG_SHAPE")
            raise Stop(Finding.of(code, what=str(error))) from error
        except Exception as error:
            what = f"{type(error).__name__}: {error}"
            raise Stop(Finding.of("RAISED", method=method, n=len(arrays[0]), what=what)) from error

    # What is drawn from them.

    def find_points(self, add: Callable[[Finding], None]) -> None:
        k, d = self.dimension, self.ambient_dimension
        if not (1 <= k < d or (k == d and self.walls)):
            raise Stop(Finding.of("BAD_DIMENSIONS", k=k, d=d))
        starts = self._starting_points()
        answers, found = self.closest(starts)
        lost = np.flatnonzero(~found)
        if not found.any():
            raise Stop(Finding.of("NOTHING_FOUND", n=len(starts), query=starts[0]))
        if len(lost) > len(starts) / 2:
            add(
                Finding.of("MOSTLY_NOT_FOUND", lost=len(lost), n=len(starts), query=starts[lost[0]])
            )
        self.starts, self.points = starts[found], answers[found]
        self.size = float(norms(np.ptp(self.points, axis=0)))
        box = self._oracle.bounding_box
        if box is not None and not self.walls:
            slack = _K["box_slack"] * norms(box[1] - box[0])
            outside = ((self.points < box[0] - slack) | (self.points > box[1] + slack)).any(axis=1)
            if outside.any():
                add(Finding.of("OUTSIDE_BOX", answer=self.points[outside][0]))

    def _starting_points(self) -> np.ndarray:
        d, box, seeds = self.ambient_dimension, self._oracle.bounding_box, self._oracle.seeds
        parts = []
        points = seeds is not None and seeds.ndim == 2 and seeds.shape[1] == d
        if seeds is not None and points and np.isfinite(seeds).all():
            parts.append(seeds[: _K["starts"]])
            if len(seeds) and box is None:
                # About them, so that there is more than one point to look at.
                spread = float(norms(np.ptp(seeds, axis=0))) or float(norms(seeds[0])) or 1.0
                near = seeds[np.arange(_K["starts"]) % len(seeds)]
                parts.append(near + _K["seed_spread"] * spread * self._random_units(len(near)))
        if box is not None:
            lower, upper = box
            ordered = lower.shape == upper.shape == (d,) and (lower < upper).all()
            if ordered and np.isfinite(upper - lower).all():
                parts.append(lower + (upper - lower) * self.random.random((_K["starts"], d)))
        if not sum(map(len, parts)):
            raise Stop(Finding.of("NO_WHEREABOUTS", d=d))
        return np.concatenate(parts)

    def _random_units(self, count: int) -> np.ndarray:
        v = self.random.standard_normal((count, self.ambient_dimension))
        return v / norms(v)[:, None]

    def bases(self, p: np.ndarray) -> np.ndarray:
        """The oracle's own bases, which one with walls has."""
        return self._given_at(p)

    def find_tangents(self) -> None:
        self.some = self.points[:: max(1, len(self.points) // _K["some"])][: _K["some"]]
        self.moved_tangents, self.ranks = self._differential(self.some)
        if self.has_tangent_basis:
            self.given_tangents = self._given_at(self.some)

    def _differential(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """At points of M: an orthonormal basis of the image of the closest point map's derivative.

        That derivative is the projection on the tangent space; its rank comes second.
        """
        k, d = self.dimension, self.ambient_dimension
        count = min(d, max(_K["max_directions"], 2 * k + 6))
        directions = np.eye(d)
        if count < d:
            directions = np.linalg.qr(self.random.standard_normal((d, count)))[0]
        h = _K["differential_step"] * self.size
        steps = h * directions.T[:count]
        ahead = self.closest((p[:, None] + steps).reshape(-1, d))[0]
        behind = self.closest((p[:, None] - steps).reshape(-1, d))[0]
        columns = ((ahead - behind) / (2 * h)).reshape(len(p), count, d).transpose(0, 2, 1)
        u, s, _ = np.linalg.svd(columns, full_matrices=False)
        ranks = np.count_nonzero(s > _K["rank_share"] * np.maximum(s[:, :1], 1e-300), axis=1)
        return u[:, :, :k], np.where(s[:, 0] > _K["least_singular"], ranks, 0)

    def tangents_at(self, p: np.ndarray) -> np.ndarray:
        """The oracle's own bases where they have proved right, else from closest points."""
        return self._given_at(p) if self.trusts_given else self._differential(p)[0]

    def along(self, t: np.ndarray, v: np.ndarray) -> np.ndarray:
        """The coordinates of the rows of v along the orthonormal columns of the bases t."""
        return (t.transpose(0, 2, 1) @ v[..., None])[..., 0]

    def normals(self, t: np.ndarray) -> np.ndarray:
        """Random unit vectors at right angles to the bases' columns."""
        v = self._random_units(len(t))
        for _ in range(2):
            v = v - (t @ self.along(t, v)[..., None])[..., 0]
            v /= norms(v)[:, None]
        return v

    @staticmethod
    def turn(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """The largest angle between the spaces that orthonormal bases span, in radians."""
        rest = b - a @ (a.transpose(0, 2, 1) @ b)
        return np.arcsin(np.minimum(1.0, np.linalg.svd(rest, compute_uv=False)[:, 0]))

    def reach_from(self, difference: np.ndarray, t: np.ndarray) -> float:
        """Federer's |q - p|^2 / (2 dist(q - p, T_p)), the least over (m, n, d) pairs."""
        along = difference @ t
        squares = (difference * difference).sum(axis=-1)
        off = np.sqrt(np.maximum(squares - (along * along).sum(axis=-1), 0.0))
        shortest = _K["shortest_way"] * self.size
        usable = squares > shortest**2
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = np.where(
                usable, squares / (2 * np.maximum(off, _K["least_height"] * shortest)), np.inf
            )
        return float(reach.min(initial=np.inf))

    def most_turned_neighbours(self) -> tuple[np.ndarray, np.ndarray]:
        """Of all pairs of a sample and one of its nearest, those whose tangent spaces differ most."""
        a, b = self._neighbours(_K["neighbours"])
        tangents = self.tangents_at(self.points)
        turned = self.turn(tangents[a], tangents[b])
        most = np.argsort(-turned, kind="stable")[: _K["some"]]
        return self.points[a[most]], self.points[b[most]]

    def _neighbours(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Pairs a < b of samples, one of which is among the nearest of the other's."""
        n = len(self.points)
        distance = norms(self.points[None] - self.points[:, None])
        near = distance.argsort(axis=1, kind="stable")[:, 1 : 1 + min(count, n - 1)]
        a, b = np.repeat(np.arange(n), near.shape[1]), near.reshape(-1)
        pairs = np.unique(np.stack([np.minimum(a, b), np.maximum(a, b)], axis=1), axis=0)
        return pairs[:, 0], pairs[:, 1]

    def pieces(self) -> int:
        """How many components the samples lie on, as far as ways between neighbours show it.

        A way leads along M where the closest points of a segment's points advance without a leap.
        """
        a, b = self._neighbours(_K["piece_neighbours"])
        steps = _K["piece_steps"]
        share = np.arange(1, steps)[None, :, None] / steps
        ways = (1 - share) * self.points[a][:, None] + share * self.points[b][:, None]
        inner, found = self.closest(ways.reshape(-1, self.ambient_dimension))
        inner = inner.reshape(ways.shape)
        path = np.concatenate([self.points[a][:, None], inner, self.points[b][:, None]], axis=1)
        leaps = norms(np.diff(path, axis=1)).max(axis=1, initial=0.0)
        length = norms(self.points[a] - self.points[b])
        walked = found.reshape(ways.shape[:2]).all(axis=1) & (leaps <= _K["leap"] * length)
        label = np.arange(len(self.points))
        for i, j in zip(a[walked], b[walked]):
            label[label == label[j]] = label[i]
        return len(np.unique(label))
