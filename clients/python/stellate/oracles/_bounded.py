"""A manifold with boundary that is known by two oracles: its own, and its boundary's."""

from __future__ import annotations

from typing import Any, Callable

import numpy as np

from .._functions import UserFunction
from .._rows import Array, apply, norms, product, transposed
from ..errors import InvalidArgument, OracleError
from ..oracle import CheckedOracle
from ._common import about_of, all_or_raise, refuse_walls

_STEP = 1e-4  # of differences of closest points, in shares of where M is
_ONE_SIDED = 0.1  # of what a step outwards loses at the boundary, at least
_MARGIN = 3  # of the tolerance that is advised: elsewhere the two may differ by more


class ManifoldWithBoundary:
    """A manifold with boundary, from nearest points of it and nearest points of its boundary.

    Nothing else is needed: tangent spaces, where an oracle has none, and the boundary's outward
    normals come from differences of nearest points. Where the boundary has corners, or where there
    are equations for it, take Clipped.

    Args:
      oracle: of M, of dimension k. It answers with nearest points of M itself, so on the boundary
        where it is asked from beyond that; or, with `clearance`, of a manifold that M is a part of.
      boundary: of the boundary, of dimension k - 1, which is closed.
      clearance: (n, d) -> (n,), positive in M, zero on its boundary and negative beyond it.
      tolerance: of M's size: a nearest point so near the boundary is on it. The two oracles may
        disagree by as much about where M ends.
    """

    walls = 1

    def __init__(
        self,
        oracle: Any,
        boundary: Any,
        *,
        clearance: Callable[[Array], Any] | None = None,
        tolerance: float = 1e-6,
    ) -> None:
        self._inner, self._rim = CheckedOracle(oracle), CheckedOracle(boundary)
        for part in (self._inner, self._rim):
            refuse_walls(part, "ManifoldWithBoundary")
        self.about = about_of(self._inner, self._rim)
        self.dimension = k = self._inner.dimension
        self.ambient_dimension = d = self._inner.ambient_dimension
        if (self._rim.dimension, self._rim.ambient_dimension) != (k - 1, d):
            raise InvalidArgument(
                f"the boundary of a manifold of dimension {k} in R^{d} has dimension {k - 1} there, "
                f"and this has {self._rim.dimension} in R^{self._rim.ambient_dimension}"
            )
        if not (clearance is None or callable(clearance)):
            raise InvalidArgument("clearance has to be a function or None")
        self._clearance = None
        if clearance is not None:
            self._clearance = UserFunction(clearance, "clearance", (1,), str(d))
        box = self._inner.bounding_box or self._rim.bounding_box
        seeds = self._inner.seeds if self._inner.seeds is not None else self._rim.seeds
        if seeds is not None:
            self.seeds, spread = seeds, np.ptp(seeds, axis=0)
        if box is not None:
            self.bounding_box, spread = box, box[1] - box[0]
        if box is None and seeds is None:
            raise InvalidArgument("neither oracle has a bounding_box or seeds")
        self._scale = float(norms(spread)) or 1.0
        self._tolerance = float(tolerance) * self._scale
        if self._inner.has_local_size:
            self.local_size = oracle.local_size
        self.thread_safe = all(getattr(o, "thread_safe", False) for o in (oracle, boundary))

    def closest_point(self, points: Array) -> Array:
        """(n, d) -> (n, d): of M, straight on beyond its boundary.

        Raises: NotConverged, with what was found.
        """
        points = np.ascontiguousarray(points, dtype=np.float64)
        nearest, found = self._inner.closest_points(points)
        if self._clearance is None:
            nearest = nearest.copy()
            rows = np.flatnonzero(found & (self._to_rim(nearest) <= self._tolerance))
            if rows.size:
                rim = np.ascontiguousarray(nearest[rows])
                outward = self._outward(rim, self._tangents(self._inner, rim))
                beyond = np.maximum(((points[rows] - rim) * outward).sum(axis=1), 0.0)
                nearest[rows] += beyond[:, None] * outward
        return all_or_raise(nearest, found)

    def tangent_basis(self, points: Array) -> Array:
        """(n, d) -> (n, d, k), at points of M and beyond."""
        points = np.ascontiguousarray(points, dtype=np.float64)
        if self._clearance is None:
            points = self._inner.closest_points(points)[0]
        return self._tangents(self._inner, points)

    def face_point(self, points: Array, face: tuple[int, ...]) -> Array:
        """(n, d) -> (n, d): of the boundary. Raises: NotConverged, with what was found."""
        return all_or_raise(
            *self._rim.closest_points(np.ascontiguousarray(points, dtype=np.float64))
        )

    def clearances(self, points: Array) -> Array:
        """(n, d) -> (n, 1): distances to the boundary, below zero beyond it."""
        points = np.ascontiguousarray(points, dtype=np.float64)
        if self._clearance is not None:
            return self._clearance(points)
        back, found = self._inner.closest_points(points)
        beyond, rim = np.where(found, norms(points - back), 0.0), self._to_rim(points)
        return np.where(beyond > rim / 2, -beyond, rim)[:, None]  # beyond it they are the same

    def conormals(self, points: Array, face: tuple[int, ...]) -> Array:
        """(n, d) -> (n, 1, d): the outward unit normals of the boundary within M."""
        points = np.ascontiguousarray(points, dtype=np.float64)
        off = self._check_on(points)
        outward = self._outward(points, self.tangent_basis(points))
        if self._clearance is None:
            self._check_ends(points, outward, off)
        return np.asarray(outward[:, None, :])

    def _outward(self, points: Array, bases: Array) -> Array:
        """(n, d), at points of the boundary with these tangent bases of M."""
        if self._clearance is not None:
            inwards = self._climb(points, bases)
        else:
            inwards = apply(transposed(bases), self._steps(self._inner, points).sum(axis=1))
        # Of M's directions, the one across the boundary's: exactly, whatever the differences are.
        rim = product(transposed(bases), self._tangents(self._rim, points))
        across = np.linalg.svd(rim, full_matrices=True)[0][:, :, -1]
        side = (across * inwards).sum(axis=1)
        least = _ONE_SIDED * _STEP * self._scale
        if self._clearance is None and not (np.abs(side) > least).all():
            place = points[int(np.argmin(np.abs(side)))].tolist()
            raise OracleError(
                f"nearest points do not end at the boundary, at {place}: the oracle of a manifold "
                "with boundary has to answer with points of M alone, or clearance= has to say where "
                "M ends",
                "ORACLE_BAD_CONORMAL",
            )
        return apply(bases, np.where(side > 0, -1.0, 1.0)[:, None] * across)

    def _to_rim(self, points: Array) -> Array:
        nearest, found = self._rim.closest_points(np.ascontiguousarray(points))
        return np.where(found, norms(points - nearest), self._scale)

    def _check_on(self, points: Array) -> Array:
        """How far points of the boundary are from M, (n,)."""
        nearest, found = self._inner.closest_points(points)
        off = np.where(found, norms(nearest - points), 0.0)
        worst = int(np.argmax(off)) if len(off) else 0
        if len(off) and off[worst] > _STEP * self._scale:
            raise OracleError(
                f"{points[worst].tolist()} is of the boundary, and {off[worst]:.3g} away from the "
                "manifold: the two oracles have to be of one manifold",
                "ORACLE_BAD_CONORMAL",
            )
        return np.asarray(off)

    def _check_ends(self, points: Array, outward: Array, off: Array) -> None:
        """That M ends where its boundary is said to be, to within the tolerance: `off` before that,
        or, as a step outwards shows, beyond it. Else M would not go on beyond its end."""
        back, found = self._inner.closest_points(points + _STEP * self._scale * outward)
        past = np.where(found, ((back - points) * outward).sum(axis=1), 0.0)
        apart = np.maximum(off, past)
        worst = int(np.argmax(apart)) if len(apart) else 0
        if len(apart) and apart[worst] > self._tolerance:
            raise OracleError(
                f"the two oracles disagree by {apart[worst]:.3g} about where the manifold ends, at "
                f"{points[worst].tolist()}, and by no more than {self._tolerance:.3g} they may: take "
                f"tolerance={_MARGIN * apart[worst] / self._scale:.1g}, or solve for nearest points "
                "more exactly",
                "ORACLE_BAD_CONORMAL",
            )

    def _climb(self, points: Array, bases: Array) -> Array:
        """How the clearance grows along the tangent directions, (n, k)."""
        assert self._clearance is not None
        h = _STEP * self._scale
        columns = []
        for a in range(self.dimension):
            step = h * bases[:, :, a]
            ahead, behind = (self._clearance(points + s)[:, 0] for s in (step, -step))
            columns.append((ahead - behind) / (2 * h))
        return np.stack(columns, axis=1)

    def _tangents(self, of: CheckedOracle, points: Array) -> Array:
        points = np.ascontiguousarray(points, dtype=np.float64)
        if of.has_tangent_basis:
            return of.tangents(points, np.ones(len(points), dtype=bool))
        if of.dimension == self.ambient_dimension:
            whole = np.eye(self.ambient_dimension)
            return np.broadcast_to(whole, (len(points), *whole.shape)).copy()
        if of.dimension == 0:
            return np.zeros((len(points), self.ambient_dimension, 0))
        # Steps in all directions come back to M along its tangent space, or along half of it.
        directions = np.linalg.svd(self._steps(of, points), full_matrices=True)[2]
        return np.ascontiguousarray(transposed(directions[:, : of.dimension]))

    def _steps(self, of: CheckedOracle, points: Array) -> Array:
        """(n, 2 d, d): where steps along all axes, back and forth, are brought back to."""
        n, d = points.shape
        h = _STEP * self._scale * np.concatenate([np.eye(d), -np.eye(d)])
        asked = np.ascontiguousarray((points[:, None, :] + h).reshape(-1, d))
        there, found = of.closest_points(asked)
        steps = there.reshape(n, 2 * d, d) - points[:, None, :]
        return np.where(found.reshape(n, 2 * d)[:, :, None], steps, 0.0)
