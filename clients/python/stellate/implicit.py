"""Manifolds given by equations: M = {x in R^d : F(x) = 0}, F: R^d -> R^(d-k).

All solvers work on whole batches, and each point's course is its own: how a batch is cut never
changes an answer, not even by a rounding error.
"""

from __future__ import annotations

from typing import Any, Callable, Sequence

import numpy as np

from .errors import InvalidArgument, NotConverged, OracleError

_MAX_DIFFERENCE_VALUES = 4_000_000  # numbers in one call of f for a difference Jacobian


class ImplicitManifold:
    """An oracle for the zero set of a smooth function whose Jacobian has full rank on it.

    Args:
      f: (n, d) -> (n, d-k).
      jacobian: (n, d) -> (n, d-k, d); by central differences of f when not given.
      ambient_dimension: d.
      dimension: k.
      bounding_box: (lower (d,), upper (d,)) around M. Its size is the length scale of the solvers.
      seeds: (m, d) points near M, instead of random points of the box.
      local_size: (n, d) -> (n,), at points of M; see stellate.Oracle.
      max_iterations: of each solver.
      thread_safe: f and jacobian may be called by several threads at once.
    """

    def __init__(
        self,
        f: Callable[[np.ndarray], np.ndarray],
        jacobian: Callable[[np.ndarray], np.ndarray] | None = None,
        *,
        ambient_dimension: int,
        dimension: int,
        bounding_box: Sequence[Any],
        seeds: np.ndarray | None = None,
        local_size: Callable[[np.ndarray], np.ndarray] | None = None,
        max_iterations: int = 100,
        thread_safe: bool = False,
    ) -> None:
        if not 1 <= dimension < ambient_dimension:
            raise InvalidArgument(
                "an implicit manifold needs 1 <= dimension < ambient_dimension, and has "
                f"dimension {dimension}, ambient_dimension {ambient_dimension}"
            )
        lower, upper = (np.asarray(corner, dtype=float) for corner in bounding_box)
        if lower.shape != (ambient_dimension,) or upper.shape != lower.shape:
            raise InvalidArgument(
                f"bounding_box has corners of shapes {lower.shape} and {upper.shape}; both have to "
                f"be ({ambient_dimension},)"
            )
        if not (lower < upper).all():
            raise InvalidArgument(f"bounding_box is empty: lower {lower}, upper {upper}")
        self.dimension = dimension
        self.ambient_dimension = ambient_dimension
        self.bounding_box = lower, upper
        self.seeds = seeds
        self.local_size = local_size
        self.thread_safe = thread_safe
        self._f = f
        self._given_jacobian = jacobian
        self._max_iterations = max_iterations
        self._scale = float(np.linalg.norm(upper - lower))
        self._tolerance = 1e-12 * self._scale  # of a Newton step, a length

    # The oracle.

    def closest_point(self, points: np.ndarray) -> np.ndarray:
        """The points of M nearest to `points`, (n, d) -> (n, d), by Lagrange-Newton.

        First down to M, then along it: Newton's method on the distance to x as a function on M,
        whose Hessian in the tangent space at y is I + sum_i l_i T^t (d^2 F_i) T, with l Lagrange's
        multipliers. A minimum is a local one when M bends away and back.

        Raises: NotConverged with what did converge.
        """
        target = np.asarray(points, dtype=float)
        y, converged = self._descend_to_manifold(target)
        done = ~converged
        for _ in range(self._max_iterations):
            active = np.flatnonzero(~done)
            if not active.size:
                return self._all_or_raise(y, converged)
            x, here = target[active], y[active]
            step, length = self._newton_step_along(x, here)
            arrived = length <= 1e-9 * self._scale  # and the step squares what error is left
            there, landed = self._descend_to_manifold(here + step)
            before, after = _norms(here - x), _norms(there - x)
            # Near the minimum distances no longer tell better from worse.
            slack = np.where(length <= 1e-6 * self._scale, self._tolerance, 0.0)
            accept = landed & ((after < before) | (after <= before + slack) & (slack > 0))
            y[active[accept]] = there[accept]
            done[active[arrived]] = True
            stuck = active[~accept & ~arrived]
            if stuck.size:
                moved = self._search_along_step(target[stuck], y[stuck], step[~accept & ~arrived])
                done[stuck[~moved[1]]] = True
                converged[stuck[~moved[1]]] = False
                y[stuck] = moved[0]
        converged &= done
        return self._all_or_raise(y, converged)

    def intersect_flat(
        self, centers: np.ndarray, bases: np.ndarray, radii: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Where M meets the flats {c + v : basis^T v = 0}: (points (n, d), found (n,)).

        Newton's method inside each flat from its center; where that fails, again from the flat's
        point nearest to the center's closest point on M.
        """
        centers = np.asarray(centers, dtype=float)
        bases = np.asarray(bases, dtype=float)
        radii = np.asarray(radii, dtype=float)
        y, found = self._newton_in_flat(centers, centers, bases)
        found &= _norms(y - centers) <= radii
        lost = np.flatnonzero(~found)
        if lost.size:
            c, basis = centers[lost], bases[lost]
            try:
                near, usable = self.closest_point(c), np.ones(lost.size, dtype=bool)
            except NotConverged as error:
                near, usable = error.points, error.converged
            again, found_again = self._newton_in_flat(c + _off(basis, near - c), c, basis)
            found_again &= usable & (_norms(again - c) <= radii[lost])
            y[lost], found[lost] = again, found_again
        return y, found

    def tangent_basis(self, points: np.ndarray) -> np.ndarray:
        """Orthonormal bases (n, d, k) of the null space of the Jacobian at points of M."""
        return self._null_space(self._jacobian(np.asarray(points, dtype=float)))

    # Pieces.

    def _all_or_raise(self, y: np.ndarray, converged: np.ndarray) -> np.ndarray:
        if not converged.all():
            raise NotConverged(y, converged)
        return y

    def _values(self, x: np.ndarray) -> np.ndarray:
        values = np.asarray(self._f(x), dtype=float)
        expected = (len(x), self.ambient_dimension - self.dimension)
        if values.shape != expected:
            raise OracleError(
                f"f returned shape {values.shape}; it has to be {expected}", "ORACLE_SHAPE"
            )
        return values

    def _jacobian(self, x: np.ndarray) -> np.ndarray:
        expected = (len(x), self.ambient_dimension - self.dimension, self.ambient_dimension)
        if self._given_jacobian is None:
            return self._difference_jacobian(x)
        jacobian = np.asarray(self._given_jacobian(x), dtype=float)
        if jacobian.shape != expected:
            raise OracleError(
                f"jacobian returned shape {jacobian.shape}; it has to be {expected}", "ORACLE_SHAPE"
            )
        return jacobian

    def _difference_jacobian(self, x: np.ndarray) -> np.ndarray:
        n, d = x.shape
        jacobian = np.empty((n, d - self.dimension, d))
        h = 6e-6 * self._scale  # about the cube root of the rounding unit
        block = max(1, _MAX_DIFFERENCE_VALUES // (2 * d * d))
        for first in range(0, n, block):
            part = x[first : first + block]
            ahead = (part[:, None, :] + h * np.eye(d)).reshape(-1, d)
            behind = (part[:, None, :] - h * np.eye(d)).reshape(-1, d)
            change = self._values(ahead) - self._values(behind)
            change = change.reshape(len(part), d, -1) / (ahead - behind).sum(axis=1).reshape(
                -1, d, 1
            )
            jacobian[first : first + block] = change.transpose(0, 2, 1)
        return jacobian

    def _null_space(self, jacobian: np.ndarray) -> np.ndarray:
        jacobian = np.where(
            np.isfinite(jacobian), jacobian, 0.0
        )  # a failed row must not sink others
        _, _, vt = np.linalg.svd(jacobian, full_matrices=True)
        return np.ascontiguousarray(
            vt[:, self.ambient_dimension - self.dimension :].transpose(0, 2, 1)
        )

    def _descend_to_manifold(self, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gauss-Newton with halved steps from `start` down to M, straight towards it at the end."""
        return self._damped_newton(start, self._normal_step)

    def _normal_step(self, x: np.ndarray, values: np.ndarray, rows: np.ndarray) -> np.ndarray:
        jacobian = self._jacobian(x)
        gram = jacobian @ jacobian.transpose(0, 2, 1)
        return -(jacobian.transpose(0, 2, 1) @ _solve(gram, values[..., None]))[..., 0]

    def _newton_in_flat(
        self, start: np.ndarray, centers: np.ndarray, bases: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        def step_in_flat(x: np.ndarray, values: np.ndarray, rows: np.ndarray) -> np.ndarray:
            basis = bases[rows]
            system = np.concatenate([self._jacobian(x), basis.transpose(0, 2, 1)], axis=1)
            back = (basis.transpose(0, 2, 1) @ (x - centers[rows])[..., None])[..., 0]
            return -_solve(system, np.concatenate([values, back], axis=1)[..., None])[..., 0]

        return self._damped_newton(start, step_in_flat)

    def _damped_newton(
        self,
        start: np.ndarray,
        step_at: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray],
    ) -> tuple[np.ndarray, np.ndarray]:
        """Drives F to zero from each row of `start`; steps are halved until |F| falls."""
        y = np.array(start, dtype=float)
        values = self._values(y)
        alive = np.isfinite(values).all(axis=1)
        converged = np.zeros(len(y), dtype=bool)
        for _ in range(self._max_iterations):
            rows = np.flatnonzero(alive & ~converged)
            if not rows.size:
                break
            step = step_at(y[rows], values[rows], rows)
            usable = np.isfinite(step).all(axis=1)
            alive[rows[~usable]] = False
            rows, step = rows[usable], step[usable]
            length = _norms(step)
            step *= np.minimum(1.0, 0.25 * self._scale / np.maximum(length, 1e-300))[:, None]
            # A step this short lands on M to rounding; halving could only see noise.
            short = length <= self._tolerance * 1e4
            y[rows[short]] += step[short]
            converged[rows[length <= self._tolerance]] = True
            values[rows[short]] = self._values(y[rows[short]])
            self._halve_until_better(y, values, alive, rows[~short], step[~short])
        return y, converged

    def _halve_until_better(
        self,
        y: np.ndarray,
        values: np.ndarray,
        alive: np.ndarray,
        rows: np.ndarray,
        step: np.ndarray,
    ) -> None:
        """Takes, in place, the longest of step, step/2, ... that lowers |F|; kills if none does."""
        fraction = 1.0
        for _ in range(30):
            if not rows.size:
                return
            trial = y[rows] + fraction * step
            trial_values = self._values(trial)
            with np.errstate(invalid="ignore"):
                better = _norms(trial_values) <= (1 - 1e-4 * fraction) * _norms(values[rows])
            y[rows[better]], values[rows[better]] = trial[better], trial_values[better]
            rows, step = rows[~better], step[~better]
            fraction /= 2
        alive[rows] = False

    def _newton_step_along(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The tangent step at y in M towards the nearest point to x, and the gradient's length."""
        jacobian = self._jacobian(y)
        tangents = self._null_space(jacobian)
        gram = jacobian @ jacobian.transpose(0, 2, 1)
        offset = y - x
        multipliers = -_solve(gram, jacobian @ offset[..., None])[..., 0]
        gradient = (tangents.transpose(0, 2, 1) @ offset[..., None])[..., 0]
        k = self.dimension
        hessian = np.broadcast_to(np.eye(k), (len(y), k, k)).copy()
        h = 1e-5 * self._scale
        for a in range(k):  # how J^t l changes along each tangent direction
            ahead = self._jacobian(y + h * tangents[:, :, a])
            behind = self._jacobian(y - h * tangents[:, :, a])
            change = (multipliers[:, None, :] @ ((ahead - behind) / (2 * h)))[:, 0, :]
            hessian[:, :, a] += (tangents.transpose(0, 2, 1) @ change[..., None])[..., 0]
        hessian = (hessian + hessian.transpose(0, 2, 1)) / 2
        hessian = np.where(np.isfinite(hessian), hessian, 0.0)
        values, vectors = np.linalg.eigh(hessian)
        values = np.maximum(np.abs(values), 0.1)  # always downhill, also beyond the focal set
        along = (vectors.transpose(0, 2, 1) @ gradient[..., None])[..., 0] / values
        step = -(tangents @ (vectors @ along[..., None]))[..., 0]
        length = _norms(step)
        step *= np.minimum(1.0, 0.1 * self._scale / np.maximum(length, 1e-300))[:, None]
        return step, length

    def _search_along_step(
        self, x: np.ndarray, y: np.ndarray, step: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Halves a tangent step that brought y no nearer to x until it does."""
        best, moved = y.copy(), np.zeros(len(y), dtype=bool)
        fraction = 0.5
        for _ in range(20):
            rows = np.flatnonzero(~moved)
            if not rows.size:
                break
            there, landed = self._descend_to_manifold(y[rows] + fraction * step[rows])
            better = landed & (_norms(there - x[rows]) < _norms(y[rows] - x[rows]))
            best[rows[better]] = there[better]
            moved[rows[better]] = True
            fraction /= 2
        return best, moved


def _norms(rows: np.ndarray) -> np.ndarray:
    return np.sqrt((rows * rows).sum(axis=1))


def _off(bases: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """The vectors without their components along the orthonormal columns of the bases."""
    return vectors - (bases @ (bases.transpose(0, 2, 1) @ vectors[..., None]))[..., 0]


def _solve(systems: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solves each system; NaN for one that is singular, as it has to be alone with its failure."""
    try:
        return np.linalg.solve(systems, right)
    except np.linalg.LinAlgError:
        solution = np.full(right.shape, np.nan)
        for i, (system, b) in enumerate(zip(systems, right)):
            try:
                solution[i] = np.linalg.solve(system, b)
            except np.linalg.LinAlgError:
                continue
        return solution
