"""Equations F(x) = 0, F: R^d -> R^m, solved for whole batches of points.

Each point's course is its own: how a batch is cut never changes an answer, not even by a rounding
error.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Callable, NamedTuple

import numpy as np

from ._functions import Exactness, UserFunction
from ._rows import apply, norms, transposed

_MAX_VALUES = 4_000_000  # numbers in one call for differences
_FIRST_STEP = 6e-6  # of central differences: about the cube root of the rounding unit
_SECOND_STEP = 1e-4  # of second differences: about its fourth root
_SLOW = 0.25  # a Jacobian that lowers |F| by less than that is too old

Batched = Callable[[np.ndarray], np.ndarray]
# (jacobian (n, m, d), values (n, m), x (n, d), rows (n,) of the batch) -> steps (n, d)
StepFrom = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray]


class Solution(NamedTuple):
    points: np.ndarray  # (n, d), meaningful where converged
    values: np.ndarray  # (n, m), of F there
    converged: np.ndarray  # (n,)


class Equations:
    """F with its derivatives.

    Args:
      f: (n, d) -> (n, m), or (n,) for m = 1.
      jacobian: (n, d) -> (n, m, d), or (n, d) for m = 1; None for differences of f. Differences are expensive, so that
        steps share them: each corrects the Jacobian by what it has seen (Broyden).
      scale: a length, of the solvers' steps and differences.
      box: (lower (d,), upper (d,)); far from the origin the rounding of its coordinates is what a step
        can reach.
      about: (s, d) points near the zeros, where f is looked at first; None: random ones of the box.
    """

    def __init__(
        self,
        f: Batched,
        jacobian: Batched | None,
        shape: tuple[int, int],
        scale: float,
        box: tuple[np.ndarray, np.ndarray],
        max_iterations: int,
        about: Any = None,
    ) -> None:
        """`shape`: (m, d)."""
        self.shape, d = shape, str(shape[1])
        why = f"; a manifold of dimension {shape[1] - shape[0]} in R^{d} is given by {d} - {shape[1] - shape[0]} = {shape[0]} equations"
        self._f = UserFunction(f, "f", shape[:1], d, why)
        self._given = None if jacobian is None else UserFunction(jacobian, "jacobian", shape, d)
        self._exactness = Exactness(about, *box)
        largest = float(max(np.abs(corner).max() for corner in box))
        self._scale, self._max_iterations = scale, max_iterations
        # Of a Newton step, a length: a step moves a point by no less than its coordinates round to,
        # and what F makes of that is a small multiple.
        self.tolerance = max(1e-12 * scale, 16 * float(np.finfo(float).eps) * largest)

    @property
    def functions(self) -> tuple[UserFunction, UserFunction | None]:
        """F, and its Jacobian where it was given."""
        return self._f, self._given

    def values(self, x: np.ndarray) -> np.ndarray:
        """F at the rows of x."""
        if not len(x):
            return np.empty((0, self.shape[0]))
        self._exactness.insist(self._f)
        return self._f(x)

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """(n, m, d), as given or by differences, in one call for as many rows as fit."""
        m, d = self.shape
        if self._given is None:
            jacobian = np.empty((len(x), m, d))
            for part in _blocks(len(x), 2 * d * d):
                jacobian[part] = self._differences(x[part])
            return jacobian
        return self._given(x)

    def _differences(self, x: np.ndarray) -> np.ndarray:
        (m, d), n = self.shape, len(x)
        h = _FIRST_STEP * self._scale * np.eye(d)
        ahead = (x[:, None, :] + h).reshape(-1, d)
        behind = (x[:, None, :] - h).reshape(-1, d)
        values = self.values(np.concatenate([ahead, behind]))
        change = (values[: n * d] - values[n * d :]).reshape(n, d, m)
        change /= (ahead - behind).sum(axis=1).reshape(n, d, 1)
        return change.transpose(0, 2, 1)

    def curvature(
        self, y: np.ndarray, values: np.ndarray, multipliers: np.ndarray, tangents: np.ndarray
    ) -> np.ndarray:
        """sum_i l_i T^t (d^2 F_i) T at y, for l (n, m) and T (n, d, k): (n, k, k)."""
        k = tangents.shape[2]
        curvature = np.empty((len(y), k, k))
        m, d = self.shape
        step = self._second_differences if self._given is None else self._jacobian_differences
        for part in _blocks(len(y), 2 * k * max(m, k) * d):
            curvature[part] = step(y[part], values[part], multipliers[part], tangents[part])
        return curvature

    def _jacobian_differences(
        self, y: np.ndarray, values: np.ndarray, multipliers: np.ndarray, tangents: np.ndarray
    ) -> np.ndarray:
        """From how J^t l changes along each tangent direction."""
        n, d, k = tangents.shape
        h = 1e-5 * self._scale
        along = h * tangents.transpose(0, 2, 1)
        around = np.concatenate([y[:, None, :] + along, y[:, None, :] - along], axis=1)
        jacobian = self.jacobian(around.reshape(-1, d)).reshape(n, 2 * k, *self.shape)
        curvature = np.empty((n, k, k))
        for a in range(k):
            change = (jacobian[:, a] - jacobian[:, k + a]) / (2 * h)
            change = apply(transposed(change), multipliers)
            curvature[:, :, a] = apply(transposed(tangents), change)
        return curvature

    def _second_differences(
        self, y: np.ndarray, values: np.ndarray, multipliers: np.ndarray, tangents: np.ndarray
    ) -> np.ndarray:
        """From l F at y + h t_a and y + h (t_a + t_b) and across from there: k^2 + k values."""
        n, d, k = tangents.shape
        h = _SECOND_STEP * self._scale
        t = tangents.transpose(0, 2, 1)
        first, second = np.triu_indices(k, 1)
        along = h * np.concatenate([t, t[:, first] + t[:, second]], axis=1)
        count = along.shape[1]
        around = np.concatenate([y[:, None, :] + along, y[:, None, :] - along], axis=1)
        seen = self.values(around.reshape(-1, d)).reshape(n, 2, count, -1).sum(axis=1)
        # l F(y + v) - 2 l F(y) + l F(y - v), over h^2
        bend = ((seen - 2 * values[:, None, :]) * multipliers[:, None, :]).sum(axis=2) / h**2
        curvature = np.empty((n, k, k))
        diagonal = np.arange(k)
        curvature[:, diagonal, diagonal] = bend[:, :k]
        mixed = (bend[:, k:] - bend[:, first] - bend[:, second]) / 2
        curvature[:, first, second] = curvature[:, second, first] = mixed
        return curvature

    def drive(
        self,
        start: np.ndarray,
        step_from: StepFrom,
        jacobian: np.ndarray | None = None,
        most: int | None = None,
    ) -> Solution:
        """Drives F to zero from each row of `start`; steps are halved until |F| falls.

        `jacobian`: of points near `start`, which saves computing it where Jacobians are shared.
        `most`: steps, if fewer than max_iterations are to do.
        """
        y = np.array(start, dtype=float)
        values = self.values(y)
        alive = np.isfinite(values).all(axis=1)
        converged = np.zeros(len(y), dtype=bool)
        jacobians = _Shared(self, y, jacobian)
        for _ in range(min(most or self._max_iterations, self._max_iterations)):
            rows = np.flatnonzero(alive & ~converged)
            if not rows.size:
                break
            step = step_from(jacobians.at(rows), values[rows], y[rows], rows)
            usable = np.isfinite(step).all(axis=1)
            jacobians.renew_or_kill(rows[~usable], alive)
            rows, step = rows[usable], step[usable]
            length = norms(step)
            step *= (np.minimum(length, 0.25 * self._scale) / np.maximum(length, 1e-300))[:, None]
            # A step this short lands on M to rounding; halving could only see noise.
            short = length <= self.tolerance * 1e4
            y[rows[short]] += step[short]
            converged[rows[length <= self.tolerance]] = True
            values[rows[short]] = self.values(y[rows[short]])
            self._halve_until_better(y, values, jacobians, alive, rows[~short], step[~short])
        return Solution(y, values, converged)

    def _halve_until_better(
        self,
        y: np.ndarray,
        values: np.ndarray,
        jacobians: _Shared,
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
            trial_values = self.values(trial)
            with np.errstate(invalid="ignore"):
                size, trial_size = norms(values[rows]), norms(trial_values)
                better = trial_size <= (1 - 1e-4 * fraction) * size
            taken = rows[better]
            slow = (trial_size > _SLOW * size)[better]
            change = trial_values[better] - values[taken]
            jacobians.moved(taken, fraction * step[better], change, slow)
            y[taken], values[taken] = trial[better], trial_values[better]
            rows, step = rows[~better], step[~better]
            fraction /= 2
        jacobians.renew_or_kill(rows, alive)


class _Shared:
    """The Jacobians of a batch on its way, each at its point or taken along to the next ones."""

    def __init__(self, equations: Equations, y: np.ndarray, near: np.ndarray | None) -> None:
        self._equations, self._y = equations, y
        self._shares = equations._given is None
        self._old = np.ones(len(y), dtype=bool)  # has to be computed
        self._exact = np.zeros(len(y), dtype=bool)  # is of the very point
        self._now = np.empty((len(y), *equations.shape))
        if near is not None and self._shares:
            self._now[:], self._old[:] = near, False

    def at(self, rows: np.ndarray) -> np.ndarray:
        old = rows[self._old[rows]]
        if old.size:
            self._now[old] = self._equations.jacobian(self._y[old])
            self._old[old], self._exact[old] = not self._shares, True
        return self._now[rows]

    def moved(
        self, rows: np.ndarray, step: np.ndarray, change: np.ndarray, slow: np.ndarray
    ) -> None:
        """After a step the Jacobian is made to map it to what it has changed in F."""
        self._exact[rows] = False
        if not self._shares:
            return
        self._old[rows[slow]] = True
        rows, step, change = rows[~slow], step[~slow], change[~slow]
        missing = change - apply(self._now[rows], step)
        along = step / (step * step).sum(axis=1)[:, None]
        self._now[rows] += missing[:, :, None] * along[:, None, :]

    def renew_or_kill(self, rows: np.ndarray, alive: np.ndarray) -> None:
        """Where no step helps: with a Jacobian of another point that is no verdict yet."""
        alive[rows[self._exact[rows]]] = False
        self._old[rows] = True


def solve(systems: np.ndarray, right: np.ndarray) -> np.ndarray:
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


def _blocks(count: int, numbers: int) -> Iterator[slice]:
    """Slices of rows, by how many numbers each row takes."""
    size = max(1, _MAX_VALUES // numbers)
    for first in range(0, count, size):
        yield slice(first, first + size)
