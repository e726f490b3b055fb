"""Manifolds where several constraints hold."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .._functions import UserFunction
from .._rows import Array, Flags, norms
from ..errors import InvalidArgument
from ._implicit import ImplicitManifold
from ._nearest import normal_step

_LOOKS = 64  # points of the box that constraints are looked at from
# What is left of a gradient across those before it, as a share, where it follows from them; and a
# gradient where it is none, as a share of what it is elsewhere. Far above what differences err by.
_DEPENDENT = 1e-6
_STEP = 6e-6  # of differences, in shares of the box: about the cube root of rounding

Function = Callable[[Array], Any]


class ConstraintSet(ImplicitManifold):
    """Where all constraints hold: a manifold of d minus as many dimensions as there are equations.

    Args:
      constraints: functions (n, d) -> (n,), or (n, m) for m equations at once; or pairs of such a
        function and its gradient, (n, d) -> (n, d) or (n, m, d). Without one, differences are taken.
      ambient_dimension: d.
      bounding_box: (lower (d,), upper (d,)) around the set.
      thread_safe: the functions may be called by several threads at once.

    Refused where one of the constraints follows from the others: as a function, or at points of the
    set.
    """

    def __init__(
        self,
        constraints: Sequence[Function | tuple[Function, Function | None]],
        *,
        ambient_dimension: int,
        bounding_box: Any,
        thread_safe: bool = False,
    ) -> None:
        pairs = [one if isinstance(one, tuple) else (one, None) for one in constraints]
        if not pairs:
            raise InvalidArgument("a constraint set needs one constraint at least")
        for number, (f, gradient) in enumerate(pairs):
            if not callable(f) or not (gradient is None or callable(gradient)):
                raise InvalidArgument(f"constraint {number} has to be a function")
        try:
            lower, upper = (np.asarray(corner, dtype=np.float64) for corner in bounding_box)
        except (TypeError, ValueError):
            lower = upper = np.empty(0)
        if lower.shape != (ambient_dimension,) or upper.shape != lower.shape:
            raise InvalidArgument(f"a constraint set needs a bounding box of R^{ambient_dimension}")
        self._pairs = [
            _named(number, *pair, ambient_dimension) for number, pair in enumerate(pairs)
        ]
        self._length = float(norms(upper - lower))
        middle = ((lower + upper) / 2)[None, :]
        counts = [f(middle).shape[1] for f, _ in self._pairs]
        self._owners = np.repeat(np.arange(len(pairs)), counts)
        if not 1 <= len(self._owners) < ambient_dimension:
            raise InvalidArgument(
                f"{len(self._owners)} equations in R^{ambient_dimension} leave no manifold"
            )
        super().__init__(
            self._all_values,
            self._all_gradients,
            ambient_dimension=ambient_dimension,
            dimension=ambient_dimension - len(self._owners),
            bounding_box=(lower, upper),
            thread_safe=thread_safe,
        )
        shares = np.random.default_rng(1).random((_LOOKS, ambient_dimension))
        self._insist_on_independence(lower + shares * (upper - lower))

    def _all_values(self, x: Array) -> Array:
        return np.concatenate([f(x) for f, _ in self._pairs], axis=1)

    def _all_gradients(self, x: Array) -> Array:
        return np.concatenate([self._gradient(*pair, x) for pair in self._pairs], axis=1)

    def _gradient(self, f: UserFunction, gradient: UserFunction | None, x: Array) -> Array:
        if gradient is not None:
            return gradient(x)
        steps = _STEP * self._length * np.eye(x.shape[1])
        columns = [(f(x + h) - f(x - h)) / (2 * h.sum()) for h in steps]
        return np.stack(columns, axis=2)

    def _insist_on_independence(self, looks: Array) -> None:
        lengths = norms(self._all_gradients(looks))
        self._usual = np.median(lengths, axis=0)
        dependent = self._dependent(looks)
        for number in range(len(self._pairs)):
            if dependent[:, self._owners == number].any(axis=1).all():
                raise InvalidArgument(
                    f"constraint {number} follows from those before it: leave it out"
                )
        points, _, found = self._equations.drive(looks, normal_step)[:3]
        if not found.any():
            raise InvalidArgument(
                f"no point was found where all constraints hold, from {_LOOKS} points of the box"
            )
        somewhere = self._dependent(points[found]).any(axis=0)
        if somewhere.any():
            raise InvalidArgument(
                f"constraint {self._owners[int(np.argmax(somewhere))]} has no gradient of its own "
                "where all constraints hold: the set is no manifold there"
            )

    def _dependent(self, x: Array) -> Flags:
        """(n, equations): whose gradient is the first in the span of those before it."""
        slopes = self._all_gradients(x)
        result = np.zeros(slopes.shape[:2], dtype=bool)
        across = np.zeros_like(slopes)
        for i in range(slopes.shape[1]):
            whole = norms(slopes[:, i])
            left = slopes[:, i] / np.maximum(whole, 1e-300)[:, None]
            for j in range(i):
                left -= (across[:, j] * left).sum(axis=1)[:, None] * across[:, j]
            length = norms(left)
            fresh = (length > _DEPENDENT) & (whole > _DEPENDENT * self._usual[i])
            result[:, i] = ~fresh & ~result.any(axis=1)
            across[:, i] = left / np.maximum(length, 1e-300)[:, None]
        return result


def _named(
    number: int, f: Function, gradient: Function | None, d: int
) -> tuple[UserFunction, UserFunction | None]:
    values = UserFunction(f, f"constraint {number}", ("m",), str(d))
    if gradient is None:
        return values, None
    return values, UserFunction(gradient, f"the gradient of constraint {number}", ("m", d), str(d))
