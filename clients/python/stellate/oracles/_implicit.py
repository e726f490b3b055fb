"""Manifolds given by equations: M = {x in R^d : F(x) = 0}, F: R^d -> R^(d-k)."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any, Callable

import numpy as np

from .._derivatives import Library, with_derivatives
from .._equations import Equations, Solution, solve
from .._rows import apply, norms, product, transposed
from ..errors import InvalidArgument, NotConverged, OracleError
from ._units import Before, SlopeBefore

_LOOKS = 64  # points that F is looked at from where none leads to M
_FEW = 0.25  # of the first batch, fewer of which find M where something is wrong with F
_ZERO = 1e-6  # of what F is usually, where solvers that find no zero come to one
_FLAT = 1e-2  # of how steep F is usually, where it is flat
# Halvings of a step along M: where 1/1024 of it is too long there is a crease. So many are tried at once,
# of few points all: a call costs more than what is in it.
_HALVINGS, _ALL_HALVINGS, _FEW_POINTS = (1, 1, 8), (10,), 50
_LANDING = 20  # steps down to M from a step along it; three do, and fifteen where M bends sharply
# Ten steps along M, from the sixth on, have to become shorter by a factor of 0.7 or come nearer by a
# thousandth: what is slower, as at creases, does not arrive in a hundred. Steps that grow leave a saddle.
_FROM, _PATIENCE, _SHORTER, _NEARER, _GROWN = 5, 10, 0.7, 1e-3, 1.2


class ImplicitManifold:
    """An oracle for the zero set of a smooth function whose Jacobian has full rank on it.

    Args:
      f: (n, d) -> (n, d-k), or (n,) for one equation, in double precision throughout. Row i of its
        value depends on row i of x alone.
      jacobian: (n, d) -> (n, d-k, d), or (n, d) for one equation; or "autograd", "jax" or "torch", if f is written for one of
        these and takes and returns its arrays; or None: differences of f, which cost some 2 d
        values of f a point, and no other answers.
      ambient_dimension: d.
      dimension: k.
      bounding_box: (lower (d,), upper (d,)) around M. Its size is the length scale of the solvers.
      seeds: (m, d) points near M, instead of random points of the box.
      local_size: (n, d) -> (n,), at points of M; see stellate.Oracle.
      inequalities: functions g, (n, d) -> (n,), of which M = {F = 0, all g >= 0} has its boundary:
        the walls of oracles.Clipped. They take `jacobian`, where that names a library, as f does.
      max_iterations: of each solver.
      thread_safe: f and jacobian may be called by several threads at once.
    """

    def __init__(
        self,
        f: Callable[[Any], Any],
        jacobian: Callable[[np.ndarray], np.ndarray] | Library | None = None,
        *,
        ambient_dimension: int,
        dimension: int,
        bounding_box: Sequence[Any],
        seeds: np.ndarray | None = None,
        local_size: Callable[[np.ndarray], np.ndarray] | None = None,
        inequalities: Sequence[Callable[[Any], Any]] = (),
        max_iterations: int = 100,
        thread_safe: bool = False,
    ) -> None:
        for name, function in (("f", f), ("jacobian", jacobian)):
            named = name == "jacobian" and isinstance(function, (str, type(None)))
            if not callable(function) and not named:
                raise InvalidArgument(f"{name} has to be a function, and is {function!r}")
        sizes = np.asarray([dimension, ambient_dimension])
        if sizes.dtype.kind not in "iu" or not 1 <= dimension < ambient_dimension:
            raise InvalidArgument(
                "an implicit manifold needs whole numbers 1 <= dimension < ambient_dimension, and "
                f"has dimension {dimension!r}, ambient_dimension {ambient_dimension!r}"
            )
        try:
            lower, upper = (np.asarray(corner, dtype=float) for corner in bounding_box)
        except (TypeError, ValueError):
            raise InvalidArgument(
                f"bounding_box has to be a pair of corners (lower, upper), and is {bounding_box!r}"
            ) from None
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
        self._max_iterations, self._looked = max_iterations, False
        self._clipped: Any = None  # this manifold within its inequalities
        self._scale = float(np.linalg.norm(upper - lower))
        library = jacobian if isinstance(jacobian, str) else None
        if isinstance(jacobian, str):
            f, jacobian = with_derivatives(f, jacobian)
        shape = ambient_dimension - dimension, ambient_dimension
        box = lower, upper
        self._equations = Equations(f, jacobian, shape, self._scale, box, max_iterations, seeds)
        if len(inequalities) > 0:
            self._bound(inequalities, library)

    def _bound(self, inequalities: Sequence[Callable[[Any], Any]], library: Library | None) -> None:
        """Becomes the manifold with boundary that the inequalities leave."""
        from ._walls import Clipped  # which imports what is made of this one

        self._clipped = clipped = Clipped(copy.copy(self), inequalities, gradients=library)
        self.walls: int = clipped.walls
        self.face_point = clipped.face_point
        self.clearances = clipped.clearances
        self.conormals = clipped.conormals

    # The oracle.

    def closest_point(self, points: np.ndarray) -> np.ndarray:
        """The points of M nearest to `points`, (n, d) -> (n, d), by Lagrange-Newton.

        First down to M, then along it: Newton's method on the distance to x as a function on M,
        whose Hessian in the tangent space at y is I + sum_i l_i T^t (d^2 F_i) T, with l Lagrange's
        multipliers. A minimum is a local one when M bends away and back.

        Raises: NotConverged with what did converge.
        """
        target = np.asarray(points, dtype=float)
        y, values, converged = self._descend_to_manifold(target)
        done, pace = ~converged, _Pace(len(y))
        for iteration in range(self._max_iterations):
            active = np.flatnonzero(~done)
            if not active.size:
                return self._all_or_raise(y, converged)
            x, here = target[active], y[active]
            step, length, jacobian = self._newton_step_along(x, here, values[active])
            slow = pace.is_too_slow(iteration, active, length, norms(here - x))
            if slow.any():
                done[active[slow]], converged[active[slow]] = True, False
                continue
            arrived = length <= 1e-9 * self._scale  # and the step squares what error is left
            there, there_values, landed = self._descend_to_manifold(here + step, jacobian, _LANDING)
            before, after = norms(here - x), norms(there - x)
            # Near the minimum distances no longer tell better from worse.
            slack = np.where(length <= 1e-6 * self._scale, self._equations.tolerance, 0.0)
            accept = landed & ((after < before) | (after <= before + slack) & (slack > 0))
            y[active[accept]], values[active[accept]] = there[accept], there_values[accept]
            done[active[arrived]] = True
            stuck = active[~accept & ~arrived]
            if stuck.size:
                left = ~accept & ~arrived
                y[stuck], values[stuck], moved = self._search_along_step(
                    x[left], here[left], values[stuck], step[left]
                )
                done[stuck[~moved]] = True
                converged[stuck[~moved]] = False
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
        found &= norms(y - centers) <= radii
        lost = np.flatnonzero(~found)
        if lost.size:
            c, basis = centers[lost], bases[lost]
            try:
                near, usable = self.closest_point(c), np.ones(lost.size, dtype=bool)
            except NotConverged as error:
                near, usable = error.points, error.converged
            again, found_again = self._newton_in_flat(c + _off(basis, near - c), c, basis)
            found_again &= usable & (norms(again - c) <= radii[lost])
            y[lost], found[lost] = again, found_again
        return y, found

    def jacobian(self, points: np.ndarray) -> np.ndarray:
        """F's Jacobian (n, d-k, d) at points (n, d), for stellate.check to see where it loses rank."""
        return self._equations.jacobian(np.asarray(points, dtype=float))

    def tangent_basis(self, points: np.ndarray) -> np.ndarray:
        """Orthonormal bases (n, d, k) of the null space of the Jacobian at points of M."""
        return self._null_space(self._equations.jacobian(np.asarray(points, dtype=float)))

    def in_units(self, scale: np.ndarray) -> Any:
        """The oracle of {x / scale : x in M}; see oracles.in_units."""
        if self._clipped is not None:
            return self._clipped.in_units(scale)
        f, jacobian = self._equations.functions
        lower, upper = self.bounding_box
        return ImplicitManifold(
            Before(f, scale),
            None if jacobian is None else SlopeBefore(jacobian, scale),
            ambient_dimension=self.ambient_dimension,
            dimension=self.dimension,
            bounding_box=(lower / scale, upper / scale),
            seeds=None if self.seeds is None else np.asarray(self.seeds) / scale,
            local_size=None if self.local_size is None else Before(self.local_size, scale),
            max_iterations=self._max_iterations,
            thread_safe=self.thread_safe,
        )

    # Pieces.

    def _all_or_raise(self, y: np.ndarray, converged: np.ndarray) -> np.ndarray:
        if len(y) and not self._looked:
            if converged.mean() < _FEW:
                self._insist_on_a_change_of_sign()
            self._looked = True
        if not converged.all():
            raise NotConverged(y, converged)
        return y

    def _insist_on_a_change_of_sign(self) -> None:
        """Raises: OracleError where F comes down to zero from wherever it begins, and is flat there."""
        lower, upper = self.bounding_box
        random = np.random.default_rng(1)
        starts = lower + random.random((_LOOKS, self.ambient_dimension)) * (upper - lower)
        before = np.abs(self._equations.values(starts))
        if not np.isfinite(before).all(axis=1).any():
            raise OracleError(
                f"f is not finite at any of {_LOOKS} places of its box, nor of its seeds: at "
                f"{starts[0].tolist()} it is {self._equations.values(starts[:1])[0].tolist()}. Is the box "
                "where f is defined, and in its unit?",
                "ORACLE_NOT_FINITE",
            )
        y, values, _ = self._descend_to_manifold(starts)
        usable = np.isfinite(values).all(axis=1)
        least = np.abs(values) <= _ZERO * np.nanmedian(before, axis=0)
        if not usable.any() or not least[usable].all(axis=1).mean() > 0.5:
            return  # where F is zero is found, or it is zero nowhere
        row = int(np.flatnonzero(usable & least.all(axis=1))[0])
        around = y[row] + 1e-3 * self._scale * random.standard_normal((_LOOKS, y.shape[1]))
        signs = np.sign(self._equations.values(around))
        for number, side in enumerate(signs.T):
            if (side >= 0).all() or (side <= 0).all():
                which = "f" if signs.shape[1] == 1 else f"f's value {number}"
                raise OracleError(
                    f"{which} touches zero without changing its sign, as near {y[row].tolist()}: |f| is "
                    "least there, as a square is, or a distance without a sign, and its gradient is zero "
                    "or has none. Give what is squared, or a signed distance",
                    "ORACLE_TOUCHES_ZERO",
                )
        steep = [np.abs(self._equations.jacobian(x)).max(axis=(1, 2)) for x in (starts, y)]
        if not np.nanmedian(steep[1]) <= _FLAT * np.nanmedian(steep[0]):
            return
        raise OracleError(
            f"f is flat where it is zero, as near {y[row].tolist()}: its gradient vanishes with it, as a "
            "cube's does. Give what is raised to a power",
            "ORACLE_TOUCHES_ZERO",
        )

    def _null_space(self, jacobian: np.ndarray) -> np.ndarray:
        jacobian = np.where(
            np.isfinite(jacobian), jacobian, 0.0
        )  # a failed row must not sink others
        _, _, vt = np.linalg.svd(jacobian, full_matrices=True)
        return np.ascontiguousarray(
            vt[:, self.ambient_dimension - self.dimension :].transpose(0, 2, 1)
        )

    def _descend_to_manifold(
        self, start: np.ndarray, jacobian: np.ndarray | None = None, most: int | None = None
    ) -> Solution:
        """Gauss-Newton with halved steps from `start` down to M, straight towards it at the end."""
        return self._equations.drive(start, _normal_step, jacobian, most)

    def _newton_in_flat(
        self, start: np.ndarray, centers: np.ndarray, bases: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        def step_in_flat(
            jacobian: np.ndarray, values: np.ndarray, x: np.ndarray, rows: np.ndarray
        ) -> np.ndarray:
            basis = bases[rows]
            system = np.concatenate([jacobian, basis.transpose(0, 2, 1)], axis=1)
            back = apply(transposed(basis), x - centers[rows])
            return -solve(system, np.concatenate([values, back], axis=1)[..., None])[..., 0]

        y, _, converged = self._equations.drive(start, step_in_flat)
        return y, converged

    def _newton_step_along(
        self, x: np.ndarray, y: np.ndarray, values: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The tangent step at y in M towards the point nearest to x, its length, and J(y)."""
        jacobian = self._equations.jacobian(y)
        tangents = self._null_space(jacobian)
        gram = product(jacobian, transposed(jacobian))
        offset = y - x
        multipliers = -solve(gram, apply(jacobian, offset)[..., None])[..., 0]
        gradient = apply(transposed(tangents), offset)
        hessian = np.eye(self.dimension) + self._equations.curvature(
            y, values, multipliers, tangents
        )
        hessian = (hessian + hessian.transpose(0, 2, 1)) / 2
        hessian = np.where(np.isfinite(hessian), hessian, 0.0)
        bends, vectors = np.linalg.eigh(hessian)
        bends = np.maximum(np.abs(bends), 0.1)  # always downhill, also beyond the focal set
        along = apply(transposed(vectors), gradient) / bends
        step = -apply(tangents, apply(vectors, along))
        length = norms(step)
        step *= (np.minimum(length, 0.1 * self._scale) / np.maximum(length, 1e-300))[:, None]
        return step, length, jacobian

    def _search_along_step(
        self, x: np.ndarray, y: np.ndarray, values: np.ndarray, step: np.ndarray
    ) -> Solution:
        """Halves a tangent step that brought y no nearer to x until it does.

        Returns: `converged` where it did, and y as it was elsewhere.
        """
        best = Solution(y.copy(), values.copy(), np.zeros(len(y), dtype=bool))
        first = 1
        for count in _ALL_HALVINGS if len(y) <= _FEW_POINTS else _HALVINGS:
            rows = np.flatnonzero(~best.converged)
            if not rows.size:
                break
            fractions = 0.5 ** np.arange(first, first + count)
            first += count
            along = fractions[None, :, None] * step[rows, None, :]
            there, there_values, landed = (
                part.reshape(len(rows), count, *part.shape[1:])
                for part in self._descend_to_manifold(
                    (y[rows, None, :] + along).reshape(-1, y.shape[1]), most=_LANDING
                )
            )
            before = norms(y[rows] - x[rows])
            better = landed & (norms(there - x[rows, None, :]) < before[:, None])
            some, longest = better.any(axis=1), better.argmax(axis=1)
            moved, taken = rows[some], (np.flatnonzero(some), longest[some])
            best.points[moved], best.values[moved] = there[taken], there_values[taken]
            best.converged[moved] = True
        return best


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


def _normal_step(
    jacobian: np.ndarray, values: np.ndarray, x: np.ndarray, rows: np.ndarray
) -> np.ndarray:
    gram = product(jacobian, transposed(jacobian))
    return -apply(transposed(jacobian), solve(gram, values[..., None])[..., 0])


def _off(bases: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """The vectors without their components along the orthonormal columns of the bases."""
    return vectors - apply(bases, apply(transposed(bases), vectors))
