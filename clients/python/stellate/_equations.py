"""Equations F(x) = 0, F: R^d -> R^m, solved for whole batches of points.

Each point's course is its own: how a batch is cut never changes an answer, not even by a rounding
error.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Callable, NamedTuple

import numpy as np

from ._functions import Exactness, UserFunction
from ._rows import apply, norms, product, transposed

_MAX_VALUES = 4_000_000  # numbers in one call for differences
_CENTRAL_STEP = 6e-6  # of central differences: about the cube root of the rounding unit
_SECOND_STEP = 1e-4  # of second differences: about its fourth root
_HALVED = 12  # times at most, as a step is
_SLOW = 0.25  # a Jacobian that lowers |F| by less than that is too old
_FAR = (
    0.02  # of the box: a step so long leads where the Jacobian is another, or to another way down
)
_STILL, _STOPS = 0.99, 2  # so many steps that leave more than that of |F|, and it is least there
_SHRINKS = 1e-3  # of a step, at the least what the next one is taken to be
_AHEAD = 1e-3  # of the tolerance: so short, that one need not be looked for
# What F may be, in its steepness times the step that is to make it zero: corrections of a Jacobian without
# full rank, as of walls that never meet, grow beyond all bounds, and steps by them shrink to nothing.
_OUT_OF_STEP = 10

Batched = Callable[[np.ndarray], np.ndarray]
# (jacobian (n, m, r), values (n, m), rows (n,) of the batch) -> steps (n, r), in what is solved for
StepFrom = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


class Solution(NamedTuple):
    points: np.ndarray  # (n, d), meaningful where converged
    values: np.ndarray  # (n, m), of F there; 0 where that goes without saying
    converged: np.ndarray  # (n,)
    slopes: np.ndarray  # (n, m, d), the Jacobian as far as it is known on the way
    steepness: np.ndarray  # (n, m), the lengths of its rows where it was last computed


class System:
    """F with its derivatives, however they are had, and the solver that drives it to zero.

    Attributes:
      difference: the step of one-sided differences, which err by rounding over it, and by half of it
        times the bend.
      seen_over: (m,), that step, or 0 where derivatives are given.

    Args:
      shape: (m, d).
      scale: a length, of the solvers' steps and differences.
      largest: coordinate; far from the origin its rounding is what a step can reach.
    """

    def __init__(
        self, shape: tuple[int, int], scale: float, largest: float, max_iterations: int
    ) -> None:
        self.shape, self.scale, self.max_iterations = shape, scale, max_iterations
        self.largest = largest
        rounding = float(np.finfo(float).eps)
        # Of a Newton step, a length: a step moves a point by no less than its coordinates round to,
        # and what F makes of that is a small multiple.
        self.tolerance = max(1e-12 * scale, 16 * rounding * largest)
        self.difference = 2 * scale * float(np.sqrt(rounding * max(1.0, largest / scale)))

    seen_over: np.ndarray

    def values(self, x: np.ndarray) -> np.ndarray:
        """F at the rows of x."""
        raise NotImplementedError

    def slopes(
        self, x: np.ndarray, ways: np.ndarray, values: np.ndarray | None = None
    ) -> np.ndarray:
        """(n, m, r): the Jacobian along the columns of ways (n, d, r), or (d, r) for all.

        As given, or by central differences; by one-sided ones from the values (n, m) at x, where these
        are there.
        """
        raise NotImplementedError

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """(n, m, d), as given or by central differences."""
        return self.slopes(x, np.eye(x.shape[1]))

    def bends(
        self,
        y: np.ndarray,
        values: np.ndarray,
        ways: np.ndarray,
        slopes: np.ndarray,
        seen_over: np.ndarray,
    ) -> np.ndarray:
        """T^t (d^2 F_i) T at y, for ways T (n, d, k): (n, m, k, k).

        From F at y + h t_a and y + h (t_a + t_b), k (k + 1) / 2 values: what is left of their change
        after the slopes (n, m, k) along T, which are differences over steps (n, m), or 0 for exact ones.
        """
        k, m = ways.shape[2], self.shape[0]
        bends = np.empty((len(y), m, k, k))
        for part in _blocks(len(y), k * max(m, k) * self.shape[1]):
            known = values[part], ways[part], slopes[part], seen_over[part]
            bends[part] = self._bends(y[part], *known)
        return bends

    def _bends(
        self,
        y: np.ndarray,
        values: np.ndarray,
        ways: np.ndarray,
        slopes: np.ndarray,
        seen_over: np.ndarray,
    ) -> np.ndarray:
        n, d, k = ways.shape
        h = _SECOND_STEP * self.scale
        first, second = np.triu_indices(k, 1)
        t, climb = transposed(ways), transposed(slopes)
        steps = h * np.concatenate([t, t[:, first] + t[:, second]], axis=1)
        around = (y[:, None, :] + steps).reshape(-1, d)
        change = self.values(around).reshape(n, steps.shape[1], -1) - values[:, None, :]
        change -= h * np.concatenate([climb, climb[:, first] + climb[:, second]], axis=1)
        bend = transposed(2 / h**2 * change)
        bends = np.empty((n, self.shape[0], k, k))
        diagonal = np.arange(k)
        # Slopes that were seen over a step have half of its bend in them.
        bends[:, :, diagonal, diagonal] = bend[:, :, :k] / (1 - seen_over / h)[:, :, None]
        mixed = (bend[:, :, k:] - bend[:, :, first] - bend[:, :, second]) / 2
        bends[:, :, first, second] = bends[:, :, second, first] = mixed
        return bends

    def drive(
        self,
        start: np.ndarray,
        step_from: StepFrom,
        slopes: np.ndarray | None = None,
        most: int | None = None,
        ways: np.ndarray | None = None,
        enough: float = 0.0,
        came: np.ndarray | None = None,
        steepness: np.ndarray | None = None,
    ) -> Solution:
        """Drives F to zero from each row of `start`; steps are halved until |F| falls.

        Jacobians are expensive, so that steps share them: each corrects the last by what it has seen
        (Broyden).

        Args:
          slopes: Jacobians (n, m, d) of points near `start`, to begin with.
          most: steps, if fewer than max_iterations are to do.
          ways: (n, d, r), the directions to move in; None: all.
          enough: of |F| at the start, where less than that will do.
          came: (n,), how long the step to `start` was, if these are the last ones of a way.
          steepness: that of a Solution which `slopes` come from; None: theirs.
        """
        y = np.array(start, dtype=float)
        values = self.values(y)
        alive = np.isfinite(values).all(axis=1)
        converged = np.zeros(len(y), dtype=bool)
        last = np.full(len(y), np.nan) if came is None else came.copy()
        near, stills = enough * norms(values), np.zeros(len(y), dtype=int)
        shared = _Shared(self, y, values, slopes, ways, steepness)
        for _ in range(min(most or self.max_iterations, self.max_iterations)):
            rows = np.flatnonzero(alive & ~converged)
            if not rows.size:
                break
            step = step_from(shared.at(rows), values[rows], rows)
            usable = np.isfinite(step).all(axis=1)
            shared.renew_or_kill(rows[~usable], alive)
            rows, step = rows[usable], step[usable]
            length = norms(step)
            # A step this short lands on M to rounding; halving could only see noise.
            short = length <= self.tolerance * 1e4
            led = short & ~shared.explains(rows, length)
            shared.renew_or_kill(rows[led], alive)
            rows, step, length, short = rows[~led], step[~led], length[~led], short[~led]
            with np.errstate(invalid="ignore", divide="ignore"):
                shrinks = length / last[rows]
                ahead = length * np.maximum(shrinks, _SHRINKS) <= _AHEAD * self.tolerance
            arrived = (length <= self.tolerance) | short & ahead
            shared.forget(rows[short & (shrinks > _SLOW)])
            last[rows] = length
            y[rows[short]] += shared.across(rows[short], step[short])
            converged[rows[arrived]] = True
            values[rows[arrived]] = 0.0
            on = rows[short & ~arrived]
            values[on] = self.values(y[on])
            step *= (np.minimum(length, 0.25 * self.scale) / np.maximum(length, 1e-300))[:, None]
            rows, step = rows[~short], step[~short]
            before = norms(values[rows])
            self._halve_until_better(y, values, shared, alive, rows, step)
            stills[rows] = (stills[rows] + 1) * (norms(values[rows]) > _STILL * before)
            alive &= stills < _STOPS
            if enough > 0:
                converged |= alive & (norms(values) <= near)
        return Solution(y, values, converged, shared.slopes, shared.steepness)

    def _halve_until_better(
        self,
        y: np.ndarray,
        values: np.ndarray,
        shared: _Shared,
        alive: np.ndarray,
        rows: np.ndarray,
        step: np.ndarray,
    ) -> None:
        """Takes, in place, the longest of step, step/2, ... that lowers |F|; kills if none does."""
        fraction = 1.0
        for _ in range(_HALVED):
            if not rows.size:
                return
            trial = y[rows] + shared.across(rows, fraction * step)
            trial_values = self.values(trial)
            with np.errstate(invalid="ignore"):
                size, trial_size = norms(values[rows]), norms(trial_values)
                better = trial_size <= (1 - 1e-4 * fraction) * size
            taken = rows[better]
            slow = (trial_size > _SLOW * size)[better]
            slow |= norms(fraction * step[better]) > _FAR * self.scale
            change = trial_values[better] - values[taken]
            shared.moved(taken, fraction * step[better], change, slow)
            y[taken], values[taken] = trial[better], trial_values[better]
            rows, step = rows[~better], step[~better]
            fraction /= 2
        shared.renew_or_kill(rows, alive)


class Equations(System):
    """F as a user gives it.

    Args:
      f: (n, d) -> (n, m), or (n,) for m = 1.
      jacobian: (n, d) -> (n, m, d), or (n, d) for m = 1; None for differences of f.
      box: (lower (d,), upper (d,)), where it is looked at.
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
        super().__init__(
            shape, scale, float(max(np.abs(corner).max() for corner in box)), max_iterations
        )
        (m, size), d = shape, str(shape[1])
        why = f"; a manifold of dimension {size - m} in R^{d} is given by {d} - {size - m} = {m} equations"
        self._f = UserFunction(f, "f", shape[:1], d, why)
        self._given = None if jacobian is None else UserFunction(jacobian, "jacobian", shape, d)
        self.seen_over = np.full(m, self.difference if jacobian is None else 0.0)
        self._exactness = Exactness(about, *box)

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

    def slopes(
        self, x: np.ndarray, ways: np.ndarray, values: np.ndarray | None = None
    ) -> np.ndarray:
        """The Jacobian along ways, see System; in one call for as many rows as fit."""
        if self._given is not None:
            return along(self._given(x), ways)
        return differences(self, x, ways, values)


def along(jacobian: np.ndarray, ways: np.ndarray) -> np.ndarray:
    """(n, m, d) -> (n, m, r), of ways (n, d, r), or the unit vectors (d, d)."""
    return jacobian if ways.ndim == 2 else product(jacobian, ways)


class Together(System):
    """Several systems in one space as one, all of whose equations are to hold."""

    def __init__(self, parts: Sequence[System]) -> None:
        first, counts = parts[0], [part.shape[0] for part in parts]
        shape = sum(counts), first.shape[1]
        super().__init__(shape, first.scale, first.largest, first.max_iterations)
        self.seen_over = np.concatenate([part.seen_over for part in parts])
        self._parts, self._ends = parts, np.cumsum(counts)[:-1]

    def values(self, x: np.ndarray) -> np.ndarray:
        """All of them at the rows of x."""
        return np.concatenate([part.values(x) for part in self._parts], axis=1)

    def slopes(
        self, x: np.ndarray, ways: np.ndarray, values: np.ndarray | None = None
    ) -> np.ndarray:
        """The Jacobian along ways, see System."""
        known: Sequence[np.ndarray | None] = [None] * len(self._parts)
        if values is not None:
            known = np.split(values, self._ends, axis=1)
        both = zip(self._parts, known)
        return np.concatenate([part.slopes(x, ways, here) for part, here in both], axis=1)


def differences(
    system: System, x: np.ndarray, ways: np.ndarray, here: np.ndarray | None = None
) -> np.ndarray:
    """The Jacobian (n, m, r) along ways (n, d, r) or (d, r): from the values `here` (n, m) at x, or central."""
    (n, d), m, r = x.shape, system.shape[0], ways.shape[-1]
    h = system.difference if here is not None else _CENTRAL_STEP * system.scale
    slopes = np.empty((n, m, r))
    for part in _blocks(n, (1 if here is not None else 2) * r * max(d, m)):
        at = x[part, None, :]
        way = np.swapaxes(ways if ways.ndim == 2 else ways[part], -1, -2)
        ahead = at + h * way
        behind = at if here is not None else at - h * way
        asked = ahead if here is not None else np.concatenate([ahead, behind])
        seen = system.values(asked.reshape(-1, d)).reshape(-1, r, m)
        count = len(ahead)
        change = seen[:count] - (here[part, None, :] if here is not None else seen[count:])
        # As long as steps have come out, along the ways, which are unit vectors.
        change /= ((ahead - behind) * way).sum(axis=2)[:, :, None]
        slopes[part] = transposed(change)
    return slopes


class _Shared:
    """The Jacobians of a batch on its way, each at its point or taken along to the next ones."""

    def __init__(
        self,
        system: System,
        y: np.ndarray,
        values: np.ndarray,
        near: np.ndarray | None,
        ways: np.ndarray | None,
        steepness: np.ndarray | None,
    ) -> None:
        self._system, self._y, self._values, self._ways = system, y, values, ways
        m, d = system.shape
        self._old = np.full(len(y), near is None)  # has to be computed
        self._fresh = np.zeros(len(y), dtype=bool)  # is of the very point
        self.slopes = np.zeros((len(y), m, d if ways is None else ways.shape[2]))
        if near is not None:
            self.slopes[:] = near
        self.steepness = norms(self.slopes) if steepness is None else steepness.copy()

    def at(self, rows: np.ndarray) -> np.ndarray:
        old = rows[self._old[rows]]
        if old.size:
            ways = np.eye(self._y.shape[1]) if self._ways is None else self._ways[old]
            self.slopes[old] = self._system.slopes(self._y[old], ways, self._values[old])
            self._old[old], self._fresh[old] = False, True
            self.steepness[old] = norms(self.slopes[old])
        return self.slopes[rows]

    def explains(self, rows: np.ndarray, length: np.ndarray) -> np.ndarray:
        """Whether steps as short as that may lead to zero, if F is as steep as it was seen to be."""
        most = _OUT_OF_STEP * self.steepness[rows] * length[:, None]
        return (np.abs(self._values[rows]) <= most).all(axis=1)

    def across(self, rows: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Steps (n, r) in the ways that are open, as vectors (n, d)."""
        return step if self._ways is None else apply(self._ways[rows], step)

    def moved(
        self, rows: np.ndarray, step: np.ndarray, change: np.ndarray, slow: np.ndarray
    ) -> None:
        """After a step the Jacobian is made to map it to what it has changed in F."""
        self._fresh[rows] = False
        self._old[rows[slow]] = True
        rows, step, change = rows[~slow], step[~slow], change[~slow]
        missing = change - apply(self.slopes[rows], step)
        share = step / (step * step).sum(axis=1)[:, None]
        self.slopes[rows] += missing[:, :, None] * share[:, None, :]

    def forget(self, rows: np.ndarray) -> None:
        """Has them computed where the next step begins."""
        self._old[rows], self._fresh[rows] = True, False

    def renew_or_kill(self, rows: np.ndarray, alive: np.ndarray) -> None:
        """Where no step helps: with a Jacobian of another point that is no verdict yet."""
        alive[rows[self._fresh[rows]]] = False
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
