"""Manifolds given by equations: M = {x in R^d : F(x) = 0}, F: R^d -> R^(d-k)."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any, Callable

import numpy as np

from .._derivatives import Library, with_derivatives
from .._equations import Equations, System, Together, solve
from .._rows import apply, norms, transposed
from ..errors import InvalidArgument, NotConverged, OracleError
from ._nearest import Nearest, null_space
from ._units import Before, SlopeBefore
from ._zeros import Doubts

# Of where M's tangents were last asked for, that M is looked at for an end; and of the box, how far around.
_LATELY, _BESIDE = 256, 1e-5

_WHERE_F_ENDS = (
    "Write the equation so that f is smooth around M, without roots, logarithms or quotients that end on "
    "it: z^2 = 1 - x^2 in place of z = sqrt(1 - x^2). If M has a boundary there, cut it by a wall a little "
    "before: inequalities=[g]"
)


class ImplicitManifold:
    """An oracle for the zero set of a smooth function whose Jacobian has full rank on it.

    Args:
      f: (n, d) -> (n, d-k), or (n,) for one equation, in double precision throughout. Row i of its
        value depends on row i of x alone.
      jacobian: (n, d) -> (n, d-k, d), or (n, d) for one equation; or "autograd", "jax" or "torch", if f is written for one of
        these and takes and returns its arrays; or None: differences of f, which cost two to
        three times as many values of f, and no other answers.
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
                "bounding_box has to be a pair of corners (lower, upper), as ([-1, -1, -1], [1, 1, 1]), "
                f"and is {bounding_box!r}"
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
        self._max_iterations = max_iterations
        self._clipped: Any = None  # this manifold within its inequalities
        self._lately = np.empty((0, ambient_dimension))  # where tangents were last asked for
        self._scale = float(np.linalg.norm(upper - lower))
        library = jacobian if isinstance(jacobian, str) else None
        if isinstance(jacobian, str):
            f, jacobian = with_derivatives(f, jacobian)
        shape = ambient_dimension - dimension, ambient_dimension
        box = lower, upper
        self._equations = Equations(f, jacobian, shape, self._scale, box, max_iterations, seeds)
        self._nearest = Nearest(self._equations)
        self._doubts = Doubts(self._equations, lower, upper)
        if callable(inequalities):
            inequalities = [inequalities]
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
        """The points of M nearest to `points`, (n, d) -> (n, d). A minimum is a local one when M bends
        away and back.

        Raises: NotConverged with what did converge.
        """
        return self._all_or_raise(*self._nearest.find(np.asarray(points, dtype=float)))

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
        y, found = self._meet_flats(centers, bases)
        found &= norms(y - centers) <= radii
        lost = np.flatnonzero(~found)
        if lost.size:
            c, basis = centers[lost], bases[lost]
            try:
                near, usable = self.closest_point(c), np.ones(lost.size, dtype=bool)
            except NotConverged as error:
                near, usable = error.points, error.converged
            again, found_again = self._meet_flats(c + _off(basis, near - c), basis)
            found_again &= usable & (norms(again - c) <= radii[lost])
            y[lost], found[lost] = again, found_again
        return y, found

    def jacobian(self, points: np.ndarray) -> np.ndarray:
        """F's Jacobian (n, d-k, d) at points (n, d), for stellate.check to see where it loses rank."""
        return self._equations.jacobian(np.asarray(points, dtype=float))

    def tangent_basis(self, points: np.ndarray) -> np.ndarray:
        """Orthonormal bases (n, d, k) of the null space of the Jacobian at points of M.

        Raises: OracleError at a point where it has none, as the Jacobian is not finite.
        """
        points = np.asarray(points, dtype=float)
        jacobian = self._equations.jacobian(points)
        finite = np.isfinite(jacobian).all(axis=(1, 2))
        if not finite.all():
            raise OracleError(
                f"the manifold ends where f does, near {points[~finite][0].tolist()}: the derivatives of "
                f"f are not finite there. {_WHERE_F_ENDS}",
                "ORACLE_NOT_FINITE",
            )
        self._lately = np.concatenate([self._lately, points])[-_LATELY:]
        return null_space(jacobian)

    def where_it_ends(self) -> str:
        """A point of M beside which f is not finite, and what to do; "" if none is known.

        Looks around the points where tangent spaces were last asked for: a mesh that does not end gathers
        them there. Takes 512 d values of f at most.
        """
        d = self.ambient_dimension
        steps = _BESIDE * self._scale * np.concatenate([np.eye(d), -np.eye(d)])
        around = self._lately[:, None, :] + steps
        values = self._equations.values(around.reshape(-1, d)).reshape(*around.shape[:2], -1)
        lost = np.argwhere(~np.isfinite(values).all(axis=2))
        if not len(lost):
            return ""
        row, step = lost[0]
        return (
            f"the manifold ends where f does, near {self._lately[row].tolist()}: at "
            f"{around[row, step].tolist()}, beside it, f is {values[row, step].tolist()}. {_WHERE_F_ENDS}"
        )

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
        self._doubts.consider(y, converged)
        if not converged.all():
            raise NotConverged(y, converged)
        return y

    def _meet_flats(self, start: np.ndarray, bases: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """By Newton's method from points of the flats, within them."""
        across = null_space(transposed(bases))

        def step_in_flat(slopes: np.ndarray, values: np.ndarray, rows: np.ndarray) -> np.ndarray:
            return -solve(slopes, values[..., None])[..., 0]

        met = self._equations.drive(start, step_in_flat, ways=across)
        return met.points, met.converged


class OnWalls:
    """Nearest points of a manifold where walls are zero, too: all are equations of one system.

    Args:
      walls: made for the manifold's equations, with their scale.
    """

    def __init__(
        self, manifold: ImplicitManifold, walls: Callable[[System], Sequence[System]]
    ) -> None:
        self._whole = manifold._nearest
        equations = manifold._equations
        more = walls(equations)
        if len(more) > manifold.dimension:
            raise InvalidArgument(
                f"{len(more)} equations on a manifold of dimension {manifold.dimension} leave none"
            )
        self._nearest = Nearest(Together([equations, *more]))

    def find(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n, d) -> the nearest points (n, d), and where they were found."""
        y, found = self._nearest.find(x)
        lost = np.flatnonzero(~found)
        if lost.size:  # on the way: once more, from M
            start, usable = self._whole.find(x[lost])
            y[lost], again = self._nearest.find(x[lost], start)
            found[lost] = again & usable
        return y, found


def _off(bases: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """The vectors without their components along the orthonormal columns of the bases."""
    return vectors - apply(bases, apply(transposed(bases), vectors))
