"""Smooth functions of the labels of a segmentation, for Phases."""

from __future__ import annotations

from typing import Any, Callable

import numpy as np

from .._rows import Array, unmasked
from ..errors import InvalidArgument
from ..oracles._grid import Grid, Spline, smoothed

_FEWEST, _MOST = 2, 6  # labels beside 0
_BORDER = 1e-3  # of a mask: more of it at the border of the volume is a part that leaves it

Value = Callable[[Array], Array]
Body = tuple[Value, Value, tuple[Array, Array]]  # half of all masks, its gradient and its box


class _Mask:
    """Where a label is, from 0 to 1, smooth."""

    def __init__(self, spline: Spline) -> None:
        self._spline, self.gradient = spline, spline.gradient

    def __call__(self, points: Array) -> Array:
        return self._spline.value(points)


def splines_of_labels(
    labels: Any, spacing: Any, origin: Any, smooth: float
) -> tuple[list[_Mask], list[int], Body]:
    """Of each number beside 0 its mask, the numbers, and of all of them together what is inside."""
    volume = np.asarray(unmasked(labels))
    if volume.dtype.kind not in "iub":
        raise InvalidArgument(
            f"labels are whole numbers, one for each voxel, and these are {volume.dtype}: of what was read as "
            "floating point say labels.round().astype(int)"
        )
    numbers = [int(number) for number in np.unique(volume) if number != 0]
    if not _FEWEST <= len(numbers) <= _MOST:
        raise InvalidArgument(
            f"there are {_FEWEST} to {_MOST} labels beside 0, and here are {numbers[:10]}: set others to 0, or to "
            "that which they are a part of; of one alone take oracles.SignedDistance.of_volume(labels == 3)"
        )
    d = volume.ndim
    try:
        sides = np.broadcast_to(np.asarray(spacing, dtype=np.float64), (d,))
        lower = np.broadcast_to(np.asarray(origin, dtype=np.float64), (d,))
    except ValueError:
        raise InvalidArgument(
            f"spacing and origin have to be one number or {d}, and are {spacing!r} and {origin!r}"
        ) from None
    if not (np.isfinite(sides).all() and (sides > 0).all()):
        raise InvalidArgument(f"spacing has to be positive, and is {spacing!r}")
    if np.ndim(smooth) != 0 or not 0 < smooth < np.inf:
        raise InvalidArgument(
            f"smooth has to be one length, some {1.5 * float(sides.max()):.4g} here, and is {smooth!r}"
        )
    box = lower, lower + sides * (np.array(volume.shape) - 1)

    def mask_of(where: Array) -> _Mask:
        values = smoothed(where, smooth / sides)
        return _Mask(Spline(Grid(values, box), 0.0))

    inside = smoothed(volume != 0, smooth / sides)
    sides_of_it = [np.take(inside, end, axis=axis).max() for axis in range(d) for end in (0, -1)]
    if max(sides_of_it) > 0.5 - _BORDER:
        raise InvalidArgument(
            "a label reaches the border of the volume: put a layer of 0 around it, "
            "np.pad(labels, 3), and take origin less 3 spacings"
        )
    body = Spline(Grid(inside, box), 0.0)
    return (
        [mask_of(volume == number) for number in numbers],
        numbers,
        (lambda points: body.value(points) - 0.5, body.gradient, box),
    )
