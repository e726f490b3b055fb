"""A smooth map of a box of parameters: its values and derivatives."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, Callable

import numpy as np

from .._functions import Exactness, UserFunction
from .._rows import Array
from ..errors import InvalidArgument
from ._units import After

_STEP = 1e-4  # of second differences, in shares of the box: about the fourth root of rounding
_FIRST_STEP = 6e-6  # of first differences: about its cube root

Map = Callable[[Array], Any]


@dataclasses.dataclass
class Chart:
    """A smooth map of a box of R^k into R^d, an immersion on all of it.

    Args:
      x: (n, k) -> (n, d). Row i of its value depends on row i of the parameters alone.
      derivative: (n, k) -> (n, d, k), or None: differences of x, some 2 k values a point.
      lower, upper: (k,), the box.
      periodic: whether a parameter comes back to where it was at the end of its interval, for all
        parameters or for each.
    """

    x: Map
    derivative: Map | None
    lower: Any
    upper: Any
    periodic: bool | Sequence[bool] = False

    def __post_init__(self) -> None:
        self.lower = np.array(self.lower, dtype=np.float64).reshape(-1)
        self.upper = np.array(self.upper, dtype=np.float64).reshape(-1)
        if self.lower.shape != self.upper.shape or not (self.lower < self.upper).all():
            raise InvalidArgument(
                f"a chart needs corners lower < upper, and has {self.lower} and {self.upper}"
            )
        if not np.isfinite(self.upper - self.lower).all():
            raise InvalidArgument(f"a chart's box has to be finite: {self.lower}, {self.upper}")
        self.wraps = np.broadcast_to(np.array(self.periodic, dtype=bool), self.lower.shape)
        k = len(self.lower)
        self._values = UserFunction(self.x, "a chart's x", ("d",), str(k))
        self._exactness = Exactness(None, self.lower, self.upper)
        if self.derivative is not None:
            self._slopes = UserFunction(self.derivative, "a chart's derivative", ("d", k), str(k))

    def in_units(self, scale: Array) -> Chart:
        """The map into the coordinates x / scale."""
        slopes = None if self.derivative is None else After(self._slopes, scale, slopes=True)
        return Chart(After(self._values, scale), slopes, self.lower, self.upper, self.periodic)

    @property
    def extent(self) -> Array:
        """The box's sides, (k,)."""
        return np.asarray(self.upper - self.lower)

    def points(self, u: Array) -> Array:
        """X at the rows of u, checked."""
        return self._values(u)

    def insist_on_exactness(self) -> None:
        """Raises: OracleError, of what is as inexact as single precision."""
        self._exactness.insist(self._values)

    def inside(self, u: Array) -> Array:
        """The parameters, periodic ones wrapped, others held in the box."""
        wrapped = self.lower + np.mod(u - self.lower, self.extent)
        return np.where(self.wraps, wrapped, np.clip(u, self.lower, self.upper))

    def jacobian(self, u: Array) -> Array:
        """(n, d, k), as given or by central differences within the box."""
        if self.derivative is not None:
            return self._slopes(u)
        columns = []
        for a, side in enumerate(self.extent):
            h = np.zeros_like(self.lower)
            h[a] = _FIRST_STEP * side
            ahead, behind = self._beside(u, h)
            columns.append(
                (self.points(ahead) - self.points(behind)) / (ahead - behind)[:, a : a + 1]
            )
        return np.stack(columns, axis=2)

    def bend(self, u: Array, r: Array) -> Array:
        """The second derivative of r . X at the rows of u, (n, k, k)."""
        k = len(self.lower)
        bend = np.empty((len(u), k, k))
        steps = _STEP * np.diag(self.extent)
        # About a place from which all differences stay in the box: no second difference is one-sided.
        reach = np.where(self.wraps, 0.0, steps.sum(axis=0))
        u = np.clip(u, self.lower + reach, self.upper - reach) if not self.wraps.all() else u
        here = self.points(u)

        def second(v: Array) -> Array:
            across = self.points(u + v) - 2 * here + self.points(u - v)
            return np.asarray((across * r).sum(axis=1))

        for a in range(k):
            bend[:, a, a] = second(steps[a]) / steps[a, a] ** 2
        for a in range(k):
            for b in range(a):
                plus, minus = second(steps[a] + steps[b]), second(steps[a] - steps[b])
                bend[:, a, b] = bend[:, b, a] = (plus - minus) / (4 * steps[a, a] * steps[b, b])
        return bend

    def _beside(self, u: Array, h: Array) -> tuple[Array, Array]:
        ahead, behind = u + h, u - h
        held = ~self.wraps
        ahead = np.where(held, np.minimum(ahead, self.upper), ahead)
        return ahead, np.where(held, np.maximum(behind, self.lower), behind)
