"""Nearest points of {F = 0}, by Lagrange-Newton, for whole batches."""

from __future__ import annotations

import numpy as np

from .._equations import Solution, System, solve
from .._rows import apply, norms, product, transposed

_CLOSE = 1e-4  # of |F| where we begin, from where steps go down to M and along it at once
_COARSE = 1e-11  # a tolerance, of the box: so far from the origin differences are not that exact
_STEPS, _CONTRACTS = 10, 0.5  # of these, each shorter than the last by that factor
_EXPECTED = 0.1  # what the second of them is to the first, until that is seen
_LEAST = 0.01  # of the distance's Hessian where they begin
_LEFT, _NOISE = 10, 1e4  # of the tolerance: what is left after the last, and steps that may grow
_TOLD = 0.1  # of a step along M, by which it has to go across for F to tell what it does there
# In shares of the box: how far x is from M where its Jacobian is of no use; a step after which the next may
# be the last, and one after which bends are others; and, squared, a distance times the step of one-sided
# differences, which turn normals so long by more than is left in the end.
_REMOTE, _LATE, _BENT, _TURNS = 1e-3, 1e-4, 1e-3, 3e-11

_LEAST_BEND = 0.1  # of the distance's Hessian, below which no step is long enough
_LONGEST = 0.1  # step along M, in shares of the box
_ARRIVED = 1e-9  # likewise; and the step squares what error is left
# Halvings of a step along M: where 1/1024 of it is too long there is a crease. So many are tried at once,
# of few points all: a call costs more than what is in it.
_HALVINGS, _ALL_HALVINGS, _FEW_POINTS = (1, 1, 8), (10,), 50
_LANDING = 20  # steps down to M from a step along it; three do, and fifteen where M bends sharply
# Ten steps along M, from the sixth on, have to become shorter by a factor of 0.7 or come nearer by a
# thousandth: what is slower, as at creases, does not arrive in a hundred. Steps that grow leave a saddle.
_FROM, _PATIENCE, _SHORTER, _NEARER, _GROWN = 5, 10, 0.7, 1e-3, 1.2


class Nearest:
    """Nearest points of {F = 0}, a manifold of dimension k = d - m, or points for k = 0.

    Most queries are near M, and few steps lead from there to the answer, each of a few values of F;
    where they do not become shorter at once, distances are watched from step to step.
    """

    def __init__(self, system: System) -> None:
        self._system = system
        self.dimension = system.shape[1] - system.shape[0]

    def find(self, x: np.ndarray, start: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """(n, d) -> the nearest points (n, d), and where they were found. `start`: not from x itself."""
        start = x if start is None else start
        if self.dimension == 0:
            landed = self._system.drive(start, normal_step)
            return landed.points, landed.converged
        if self._system.tolerance > _COARSE * self._system.scale:
            return self._watch(x, start)
        begun = self._system.drive(start, normal_step, enough=_CLOSE)
        y, found = begun.points, begun.converged
        near = np.flatnonzero(found)
        walk = _Walk(self._system, x[near], Solution(*(part[near] for part in begun)))
        walked, arrived = walk.to_its_end()
        y[near[arrived]] = walked[arrived]
        far = near[~arrived]
        y[far], found[far] = self._watch(x[far], y[far])
        return y, found

    def _watch(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """First down to M, then along it, by steps that bring it nearer to x, or are halved until they do."""
        y, values, converged = self._system.drive(y, normal_step)[:3]
        done, pace = ~converged, _Pace(len(y))
        scale = self._system.scale
        for iteration in range(self._system.max_iterations):
            active = np.flatnonzero(~done)
            if not active.size:
                return y, converged
            to, here = x[active], y[active]
            step, length, jacobian = self._newton_step_along(to, here, values[active])
            slow = pace.is_too_slow(iteration, active, length, norms(here - to))
            if slow.any():
                done[active[slow]], converged[active[slow]] = True, False
                continue
            arrived = length <= max(_ARRIVED * scale, self._system.tolerance)
            there, there_values, landed = self._system.drive(
                here + step, normal_step, jacobian, _LANDING
            )[:3]
            before, after = norms(here - to), norms(there - to)
            # Near the minimum distances no longer tell better from worse.
            hidden = length <= np.sqrt(self._system.tolerance * scale)
            slack = np.where(hidden, self._system.tolerance, 0.0)
            accept = landed & ((after < before) | (after <= before + slack) & (slack > 0))
            y[active[accept]], values[active[accept]] = there[accept], there_values[accept]
            done[active[arrived]] = True
            stuck = active[~accept & ~arrived]
            if stuck.size:
                left = ~accept & ~arrived
                y[stuck], values[stuck], moved = self._search_along_step(
                    to[left], here[left], values[stuck], step[left]
                )
                done[stuck[~moved]] = True
                converged[stuck[~moved]] = False
        return y, converged & done

    def _newton_step_along(
        self, x: np.ndarray, y: np.ndarray, values: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The tangent step at y in M towards the point nearest to x, its length, and J(y)."""
        jacobian = self._system.jacobian(y)
        tangents = null_space(jacobian)
        gradient = apply(transposed(tangents), y - x)
        multipliers = multipliers_of(jacobian, y - x)
        none = np.zeros((*values.shape, self.dimension)), np.zeros(values.shape)  # along M
        hessian = np.eye(self.dimension) + weighted(
            self._system.bends(y, values, tangents, *none), multipliers
        )
        bends, vectors = np.linalg.eigh(np.where(np.isfinite(hessian), hessian, 0.0))
        bends = np.maximum(np.abs(bends), _LEAST_BEND)  # downhill beyond the focal set, too
        along = apply(transposed(vectors), gradient) / bends
        step = -apply(tangents, apply(vectors, along))
        length = norms(step)
        longest = _LONGEST * self._system.scale
        step *= (np.minimum(length, longest) / np.maximum(length, 1e-300))[:, None]
        return step, length, jacobian

    def _search_along_step(
        self, x: np.ndarray, y: np.ndarray, values: np.ndarray, step: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Halves a tangent step that brought y no nearer to x until it does.

        Returns: y and F there, as they were where none did, and where one did.
        """
        points, at, found = y.copy(), values.copy(), np.zeros(len(y), dtype=bool)
        first = 1
        for count in _ALL_HALVINGS if len(y) <= _FEW_POINTS else _HALVINGS:
            rows = np.flatnonzero(~found)
            if not rows.size:
                break
            fractions = 0.5 ** np.arange(first, first + count)
            first += count
            along = fractions[None, :, None] * step[rows, None, :]
            there, there_values, landed = (
                part.reshape(len(rows), count, *part.shape[1:])
                for part in self._system.drive(
                    (y[rows, None, :] + along).reshape(-1, y.shape[1]), normal_step, most=_LANDING
                )[:3]
            )
            before = norms(y[rows] - x[rows])
            better = landed & (norms(there - x[rows, None, :]) < before[:, None])
            some, longest = better.any(axis=1), better.argmax(axis=1)
            moved, taken = rows[some], (np.flatnonzero(some), longest[some])
            points[moved], at[moved] = there[taken], there_values[taken]
            found[moved] = True
        return points, at, found


class _Walk:
    """Points on their way down to M and along it at once, from near it; given up unless all steps become shorter.

    F is measured along M alone, where it hardly changes, and its bends there once. The Jacobian's null
    space is known as exactly; across M the Jacobian is corrected by what steps see (Broyden).
    """

    def __init__(self, system: System, x: np.ndarray, begun: Solution) -> None:
        """`begun`: the way to each x so far, of which all are near M."""
        (m, d), n = system.shape, len(x)
        self._system, self._k, self._x = system, d - m, x
        self._y, self._values = begun.points.copy(), begun.values.copy()
        self._jacobian, self._steepness = begun.slopes.copy(), begun.steepness
        self._frames = np.empty((n, d, self._k))  # that the bends are of
        self._bends = np.empty((n, m, self._k, self._k))
        self._last = np.full(n, np.inf)  # length of a step

    def to_its_end(self) -> tuple[np.ndarray, np.ndarray]:
        """The nearest points, and where they were found."""
        arrived = np.zeros(len(self._x), dtype=bool)
        rows = np.arange(len(self._x))
        for number in range(_STEPS):
            if not rows.size:
                break
            ways = null_space(self._jacobian[rows])
            bends, sure = self._measure(rows, ways, number == 0)
            along, step, hessian = self._step(rows, ways, bends)
            length = norms(step)
            if number == 0:
                finite = np.where(np.isfinite(hessian), hessian, 0.0)
                good = np.linalg.eigvalsh(finite)[:, 0] >= _LEAST
                good &= length <= _LONGEST * self._system.scale
                left = _EXPECTED * length
            else:
                last = self._last[rows]
                good = length <= np.maximum(_CONTRACTS * last, _NOISE * self._system.tolerance)
                left = length * np.minimum(length / np.maximum(last, 1e-300), _CONTRACTS)
            # What a step across M turns the normals by is not foreseen.
            bent = np.abs(hessian - np.eye(self._k)).max(axis=(1, 2))
            left = np.maximum(left, bent * norms(step - apply(ways, along)))
            self._y[rows[good]] += step[good]
            self._last[rows] = length
            ends = good & sure & (left <= _LEFT * self._system.tolerance)
            arrived[rows[ends]] = True
            on = good & ~ends
            rows = rows[on]
            self._learn(rows, ways[on], bends[on], along[on], step[on])
        return self._land(arrived)

    def _measure(
        self, rows: np.ndarray, ways: np.ndarray, first: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """The Jacobian along the ways; the bends (n, m, k, k), and whether slopes are as exact as the end needs."""
        system, y, values = self._system, self._y[rows], self._values[rows]
        distance = norms(y - self._x[rows])
        # Of several equations all slopes matter to multipliers, and those so far were seen far from here.
        whole = (distance > _REMOTE * system.scale) & first & (system.shape[0] > 1)
        far = self._is_far(distance)
        exact = far & (self._last[rows] <= _LATE * system.scale)
        jacobian = self._jacobian[rows]
        jacobian[whole] = system.slopes(y[whole], np.eye(y.shape[1]), values[whole])
        ways[whole] = null_space(jacobian[whole])
        slopes = np.empty((len(rows), system.shape[0], self._k))
        slopes[exact] = system.slopes(y[exact], ways[exact])
        slopes[~exact] = system.slopes(y[~exact], ways[~exact], values[~exact])
        seen_over = np.where(exact[:, None], 0.0, system.seen_over)
        new = first | (self._last[rows] > _BENT * system.scale)
        if new.any():
            known = values[new], ways[new], slopes[new], seen_over[new]
            self._frames[rows[new]] = ways[new]
            self._bends[rows[new]] = system.bends(y[new], *known)
        bends = turned(self._bends[rows], product(transposed(self._frames[rows]), ways))
        slopes -= seen_over[:, :, None] / 2 * np.diagonal(bends, axis1=2, axis2=3)
        missing = slopes - product(jacobian, ways)
        self._jacobian[rows] = jacobian + product(missing, transposed(ways))
        return bends, exact | ~far

    def _is_far(self, distance: np.ndarray) -> np.ndarray:
        """Whether one-sided differences would turn normals so long by more than is left in the end."""
        seen_over = float(self._system.seen_over.max())
        return distance * seen_over > _TURNS * self._system.scale**2

    def _step(
        self, rows: np.ndarray, ways: np.ndarray, bends: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What is to be done along the ways (n, k), the whole step (n, d), the distance's Hessian."""
        jacobian, off = self._jacobian[rows], self._y[rows] - self._x[rows]
        slopes = product(jacobian, ways)
        multipliers = multipliers_of(jacobian, off)
        hessian = np.eye(self._k) + weighted(bends, multipliers)
        # Of the Lagrangian: to it ways that are not quite along M do not matter.
        gradient = apply(transposed(ways), off) + apply(transposed(slopes), multipliers)
        along = -solve(hessian, gradient[..., None])[..., 0]
        rise = self._values[rows] + apply(slopes, along)
        return along, apply(ways, along) + normal_step(jacobian, rise, rows), hessian

    def _learn(
        self,
        rows: np.ndarray,
        ways: np.ndarray,
        bends: np.ndarray,
        along: np.ndarray,
        step: np.ndarray,
    ) -> None:
        """F where a step has led, and what that says of the Jacobian across M; along it the bends do."""
        seen = self._system.values(self._y[rows])
        turns = (bends * along[:, None, None, :]).sum(axis=3)
        change = seen - self._values[rows] - apply(self._jacobian[rows], step)
        change -= apply(turns, along) / 2
        across = step - apply(ways, apply(transposed(ways), step))
        size = norms(across)
        share = np.where((size > _TOLD * norms(along))[:, None], across, 0.0)
        share /= np.maximum(size * size, 1e-300)[:, None]
        self._jacobian[rows] += product(turns, transposed(ways))
        self._jacobian[rows] += change[:, :, None] * share[:, None, :]
        self._values[rows] = seen

    def _land(self, arrived: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rows = np.flatnonzero(arrived)
        landed = self._system.drive(
            self._y[rows],
            normal_step,
            self._jacobian[rows],
            came=self._last[rows],
            steepness=self._steepness[rows],
        )
        self._y[rows], arrived[rows] = landed.points, landed.converged
        return self._y, arrived


class _Pace:
    """How the steps of a batch on its way along M become shorter, a row each."""

    def __init__(self, count: int) -> None:
        # The shortest of these ten steps and of those before, and how far x was then.
        self._shortest, self._before, self._distance = np.full((3, count), np.inf)

    def is_too_slow(
        self, iteration: int, rows: np.ndarray, length: np.ndarray, distance: np.ndarray
    ) -> np.ndarray:
        """Which of the rows have gained too little since they were last looked at, if it is time."""
        self._shortest[rows] = np.minimum(self._shortest[rows], length)
        if iteration % _PATIENCE != _FROM:
            return np.zeros(len(rows), dtype=bool)
        shortest, before = self._shortest[rows], self._before[rows]
        slow = (_SHORTER * before < shortest) & (shortest < _GROWN * before)
        slow &= distance > (1 - _NEARER) * self._distance[rows]
        self._before[rows], self._distance[rows] = shortest, distance
        self._shortest[rows] = np.inf
        return slow


def normal_step(jacobian: np.ndarray, values: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """The shortest step to where F is zero, as far as its Jacobian says."""
    gram = product(jacobian, transposed(jacobian))
    return -apply(transposed(jacobian), solve(gram, values[..., None])[..., 0])


def multipliers_of(jacobian: np.ndarray, off: np.ndarray) -> np.ndarray:
    """Lagrange's (n, m), at points y = x + off."""
    gram = product(jacobian, transposed(jacobian))
    return -solve(gram, apply(jacobian, off)[..., None])[..., 0]


def weighted(bends: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(n, m, k, k), (n, m) -> (n, k, k), the weighted sums."""
    return np.asarray((bends * weights[:, :, None, None]).sum(axis=1))


def turned(bends: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """(n, m, k, k), (n, k, k) -> R^t B R for each."""
    n, m, k, _ = bends.shape
    each = np.repeat(turn, m, axis=0)
    return product(transposed(each), product(bends.reshape(-1, k, k), each)).reshape(n, m, k, k)


def null_space(matrices: np.ndarray) -> np.ndarray:
    """Orthonormal bases (n, d, d - m) of what matrices (n, m, d) of full rank map to zero."""
    # A failed row must not sink others.
    finite = np.where(np.isfinite(matrices), matrices, 0.0)
    _, _, vt = np.linalg.svd(finite, full_matrices=True)
    return np.ascontiguousarray(transposed(vt[:, matrices.shape[1] :]))
