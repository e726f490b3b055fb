"""Cubic splines through values on a grid, and whether these hold a surface that a spline can follow."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .._rows import Array, norms, unmasked
from ..errors import InvalidArgument

_FLAT = 0.5  # of the places where a level is passed, of which no more may lie between equal values
_FEW = 300  # such places, among which numbers tell whether they are rounded
_OPEN = 3  # cells that an open border goes on for
_BLOCK = 1024  # places at a time, whose taps the processor's cache holds


def smoothed(values: Any, deviations: Array) -> Array:
    """By a Gaussian of standard deviations (d,), in spacings.

    Raises: InvalidArgument without scipy, and for values that are not finite, which would spread.
    """
    numbers = np.asarray(values, dtype=np.float64)
    insist_on_values(numbers)
    return np.asarray(_ndimage().gaussian_filter(numbers, deviations, mode="nearest"))


def insist_on_values(values: Array) -> None:
    """Raises: InvalidArgument, where some are not finite, with their place and what to do."""
    bad = ~np.isfinite(values)
    if not bad.any():
        return
    first = [int(i) for i in np.unravel_index(int(bad.argmax()), values.shape)]
    raise InvalidArgument(
        f"values on the grid have to be finite, and {np.count_nonzero(bad):,} of {values.size:,} are NaN, "
        f"infinite or masked, the first at index {first}. Where nothing was measured give them a value of the "
        "side of the surface that they lie on, such as outside: np.where(np.isfinite(values), values, "
        "outside); or cut the array to what was measured"
    )


def _ndimage() -> Any:
    try:
        from scipy import ndimage
    except ImportError:
        raise InvalidArgument(
            "values on a grid are interpolated by scipy, and there is no scipy: "
            "apt-get install python3-scipy, or pip install scipy"
        ) from None
    return ndimage


class Grid:
    """Values at evenly spaced places of a box, the first and last of each axis on its border.

    Raises: InvalidArgument, for what is no such thing.
    """

    def __init__(self, values: Any, bounding_box: Any) -> None:
        array = np.asarray(unmasked(values))
        if array.dtype.kind not in "fiub":
            raise InvalidArgument(f"values on a grid have to be real numbers, not {array.dtype}")
        self.values = np.asarray(array, dtype=np.float64)
        d = array.ndim
        if min(array.shape, default=0) < 4:
            single = (
                "; an axis of one value is none: squeeze() leaves it out"
                if 1 in array.shape
                else ""
            )
            raise InvalidArgument(
                f"a cubic spline needs 4 values an axis, and has {array.shape}{single}"
            )
        try:
            lower, upper = (np.asarray(corner, dtype=np.float64) for corner in bounding_box)
        except (TypeError, ValueError):
            lower = upper = np.empty(0)
        if lower.shape != (d,) or upper.shape != lower.shape or not (lower < upper).all():
            raise InvalidArgument(
                f"values on a grid of {d} axes need a box of R^{d}, lower < upper"
            )
        insist_on_values(self.values)
        self.lower, self.upper = lower, upper
        self.spacing = (upper - lower) / (np.array(array.shape) - 1)

    def insist_on_a_surface(self, level: float, open_border: bool) -> float:
        """That of the level: there is one, which is no stairs, and unless it may does not leave the grid.

        Returns: 1, or -1 where values are less than the level at the border.
        """
        low, high = float(self.values.min()), float(self.values.max())
        if not low < level < high:
            between = (
                f"; give level=, between them, such as {(low + high) / 2:g}" if low < high else ""
            )
            raise InvalidArgument(
                f"no set of level {level:g}: the values lie between {low:g} and {high:g}{between}"
            )
        if self._flat_share(level) > _FLAT:
            raise InvalidArgument(
                f"values are all but constant on both sides of the level {level:g}, as labels and masks "
                "are: the surface between them is stairs, and no smooth one. Smooth them: "
                f"{self._smoothed(level)}"
            )
        if self._rounded_share(level) > _FLAT:
            raise InvalidArgument(
                f"values are rounded too coarsely: where they pass the level {level:g}, most go from one of "
                "the numbers that they take to the next one, and the surface between them is terraced, as "
                f"no smooth one is. Take them as they were before, or smooth them: {self._smoothed(level)}"
            )
        above = self.values > level
        side = bool(above.flat[0])
        for axis in range(above.ndim):
            for end in (0, -1):
                other = np.argwhere(np.take(above, end, axis=axis) != side)
                if len(other) and not open_border:
                    raise InvalidArgument(self._leaves(level, axis, end, other[0]))
        return 1.0 if side else -1.0

    def _leaves(self, level: float, axis: int, end: int, index: Any) -> str:
        at = np.insert(index, axis, 0 if end == 0 else self.values.shape[axis] - 1)
        place = (self.lower + at * self.spacing).round(6).tolist()
        box = f"({self.lower.tolist()}, {self.upper.tolist()})"
        return (
            f"the surface of level {level:g} leaves the grid through its border, near {place}: it has an "
            "end there, and no smooth manifold does. Clip it to the grid: oracles.Clipped("
            'SignedDistance.of_grid(values, box, level=level, border="open"), box=box) with box = '
            f"{box}. Or, where it closes soon beyond, pad the values by more of what is outside: "
            "np.pad(values, 4, mode='linear_ramp', end_values=...), with a box 4 spacings larger"
        )

    def _flat_share(self, level: float) -> float:
        """Of the steps along the axes where the level is passed, those between values that do not change."""
        steps = flat = 0
        for axis in range(self.values.ndim):
            line = np.moveaxis(self.values, axis, 0)
            passed = (line[1:-2] > level) != (line[2:-1] > level)
            same = (line[:-3] == line[1:-2]) & (line[2:-1] == line[3:])
            steps += int(np.count_nonzero(passed))
            flat += int(np.count_nonzero(passed & same))
        return flat / steps if steps else 0.0

    def _rounded_share(self, level: float) -> float:
        """Of the same steps, those between two of the numbers there with none in between.

        Where they are few, symmetric values may be as few, too.
        """
        ends = []
        for axis in range(self.values.ndim):
            line = np.moveaxis(self.values, axis, 0)[1:-1]
            passed = (line[:-1] > level) != (line[1:] > level)
            ends.append(np.stack([line[:-1][passed], line[1:][passed]]))
        steps = np.concatenate(ends, axis=1)
        if steps.shape[1] < _FEW:
            return 0.0
        _, ranks = np.unique(steps, return_inverse=True)
        return float((np.abs(np.diff(ranks.reshape(steps.shape), axis=0)) == 1).mean())

    def _smoothed(self, level: float) -> str:
        return (
            f"SignedDistance.of_volume(values, spacing={self._short_spacing()}, "
            f"origin={self.lower.tolist()}, level={level:g}, "
            f"smooth={1.5 * float(self.spacing.max()):.4g})"
        )

    def _short_spacing(self) -> Any:
        sides = [float(f"{side:.6g}") for side in self.spacing]
        return sides[0] if len(set(sides)) == 1 else sides


class Spline:
    """A tensor product of cubic B-splines through a grid's values, in any dimension.

    Beyond the border it goes on as at the border, and `outside`, 1 or -1, says whether it grows or
    falls with the distance: as steeply as it changes anywhere. 0: it goes on straight for some cells,
    and then as it is there.
    """

    def __init__(self, grid: Grid, outside: float) -> None:
        values, self._lower, self.spacing = grid.values, grid.lower, grid.spacing
        if outside == 0:
            values = np.pad(values, _OPEN, mode="reflect", reflect_type="odd")
            self._lower = grid.lower - _OPEN * grid.spacing
        steepest = max(
            float(np.abs(np.diff(values, axis=a)).max()) / side
            for a, side in enumerate(self.spacing)
        )
        self._steepness = outside * steepest
        # Coefficients, with what mirroring says beyond the border.
        padded = np.pad(_ndimage().spline_filter(values, order=3, mode="mirror"), 2, mode="reflect")
        self._coefficients, d = padded.reshape(-1), values.ndim
        self._strides = [math.prod(padded.shape[a + 1 :]) for a in range(d)]
        self._cells = np.array(values.shape) - 1
        taps = np.zeros(1, dtype=np.intp)
        for stride in self._strides:
            taps = (taps[:, None] + stride * np.arange(1, 5)).reshape(-1)
        self._taps = taps

    def value(self, x: Array) -> Array:
        """(n, d) -> (n,)."""
        return self._in_blocks(x, False)[:, 0]

    def gradient(self, x: Array) -> Array:
        """(n, d) -> (n, d)."""
        return self._in_blocks(x, True)[:, 1:]

    def _in_blocks(self, x: Array, slopes: bool) -> Array:
        width = 1 + (x.shape[1] if slopes else 0)
        result = np.empty((len(x), width))
        for i in range(0, len(x), _BLOCK):
            result[i : i + _BLOCK] = self._sums(x[i : i + _BLOCK], slopes)
        return result

    def _sums(self, x: Array, slopes: bool) -> Array:
        """(n, 1 or 1 + d): the spline and its derivatives, all from one look at its coefficients."""
        n, d = x.shape
        places = (x - self._lower) / self.spacing
        inside = np.clip(places, 0, self._cells)
        first = np.minimum(inside.astype(np.intp), self._cells - 1)
        share = inside - first
        weights = _weights(share)
        steep = _slopes(share) if slopes else weights
        start = first[:, 0] * self._strides[0]
        for a in range(1, d):
            start = start + first[:, a] * self._strides[a]
        # By axes, the last first: what is summed with weights, and with slopes along each axis so far.
        # Taps lie in front of the places, which keeps their sums in order for any number of these.
        sums = [self._coefficients[self._taps[:, None] + start]]
        for a in reversed(range(d)):
            taps = [part.reshape(-1, 4, n) for part in sums]
            sums = [_along(part, weights[:, a]) for part in taps]
            if slopes:
                sums.insert(1, _along(taps[0], steep[:, a]))
        result = np.stack([part.reshape(n) for part in sums], axis=1)
        if slopes:
            result[:, 1:] /= self.spacing
        return self._beyond(result, (places - inside) * self.spacing, slopes)

    def _beyond(self, result: Array, beyond: Array, slopes: bool) -> Array:
        """What is added where places lie beyond the border, by so much along each axis."""
        out = np.flatnonzero((beyond != 0).any(axis=1))
        if not out.size:
            return result
        away = beyond[out]
        length = norms(away)
        result[out, 0] += self._steepness * length
        if slopes:
            outward = self._steepness * away / length[:, None]
            result[out, 1:] = np.where(away != 0, outward, result[out, 1:])
        return result


def _along(taps: Array, weights: Array) -> Array:
    """(j, 4, n), (4, n) -> (j, n), in an order of its own."""
    total = taps[:, 0] * weights[0]
    for i in (1, 2, 3):
        total += taps[:, i] * weights[i]
    return total


# By products: numpy's powers round otherwise for one number than for a column of an array.
def _weights(t: Array) -> Array:
    """Of the four splines about a place t of a cell, there: (n, d) -> (4, d, n)."""
    t = t.T
    u, t2 = 1 - t, t * t
    return np.stack(
        [u * u * u / 6, (t2 * (3 * t - 6) + 4) / 6, (((3 - 3 * t) * t + 3) * t + 1) / 6, t2 * t / 6]
    )


def _slopes(t: Array) -> Array:
    """Their derivatives."""
    t = t.T
    u = 1 - t
    return np.stack([-u * u / 2, t * (9 * t - 12) / 6, (t * (6 - 9 * t) + 3) / 6, t * t / 2])
