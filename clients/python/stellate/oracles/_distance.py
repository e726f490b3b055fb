"""Hypersurfaces given by a signed distance: a function, or its values on a grid."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import InvalidArgument
from ..implicit import ImplicitManifold
from ._common import Array, norms


class SignedDistance(ImplicitManifold):
    """The zero set of a signed distance, or of any smooth function with a gradient that is not zero
    there.

    Args:
      f: (n, d) -> (n,).
      gradient: (n, d) -> (n, d), or None for differences of f.
      bounding_box: (lower (d,), upper (d,)) around the set.
      level: the value whose set is meant.

    A distance has kinks on the medial axis: the solvers begin at points of the box and go down the
    gradient, which they survive. See `of_grid` for sampled distances.
    """

    resolution: float | None = None  # the spacing of the grid, where there is one

    def __init__(
        self,
        f: Callable[[Array], Any],
        gradient: Callable[[Array], Any] | None = None,
        *,
        bounding_box: Any,
        level: float = 0.0,
        thread_safe: bool = False,
    ) -> None:
        try:
            d = len(bounding_box[0])
        except (TypeError, IndexError):
            raise InvalidArgument(
                f"bounding_box has to be a pair of corners, and is {bounding_box!r}"
            ) from None

        def column(x: Array) -> Array:
            return np.asarray(f(x), dtype=np.float64).reshape(len(x), 1) - level

        def slopes(x: Array) -> Array:
            assert gradient is not None
            return np.asarray(gradient(x), dtype=np.float64).reshape(len(x), 1, d)

        super().__init__(
            column,
            None if gradient is None else slopes,
            ambient_dimension=d,
            dimension=d - 1,
            bounding_box=bounding_box,
            thread_safe=thread_safe,
        )

    @classmethod
    def of_grid(cls, values: Any, bounding_box: Any, *, level: float = 0.0) -> SignedDistance:
        """The zero set of the cubic spline through values on a grid; needs scipy.

        Args:
          values: (n_1, ..., n_d), at evenly spaced places; the first and last of each axis lie on
            the box.
          bounding_box: (lower (d,), upper (d,)).

        The spline is smooth (C^2) and reproduces the values. What the grid does not resolve it cannot
        know: thin parts and gaps of fewer than some three spacings come out otherwise or not at all,
        and the set is within about spacing^2 times the curvature of the one that was sampled. An
        epsilon below the `resolution` meshes the spline ever better, and not what was sampled.
        """
        spline = _Spline(values, bounding_box)
        if not np.min(values) < level < np.max(values):
            raise InvalidArgument(
                f"no set of level {level:g}: the values lie between {np.min(values):g} and "
                f"{np.max(values):g}"
            )
        oracle = cls(
            spline.value, spline.gradient, bounding_box=bounding_box, level=level, thread_safe=True
        )
        oracle.resolution = float(spline.spacing.max())
        return oracle


class _Spline:
    """A tensor product of cubic B-splines through values on a grid, in any dimension."""

    def __init__(self, values: Any, bounding_box: Any) -> None:
        try:
            from scipy.ndimage import spline_filter
        except ImportError:
            raise InvalidArgument(
                "a sampled distance is interpolated by scipy, and there is no scipy: "
                "apt-get install python3-scipy, or pip install scipy"
            ) from None
        array = np.asarray(values, dtype=np.float64)
        lower, upper = (np.asarray(corner, dtype=np.float64) for corner in bounding_box)
        if lower.shape != (array.ndim,) or upper.shape != lower.shape or not (lower < upper).all():
            raise InvalidArgument(
                f"values on a grid of {array.ndim} axes need a box of R^{array.ndim}, lower < upper"
            )
        if min(array.shape) < 4:
            raise InvalidArgument(f"a cubic spline needs 4 values an axis, and has {array.shape}")
        if not np.isfinite(array).all():
            raise InvalidArgument("values on the grid have to be finite")
        # Coefficients, with what mirroring says beyond the border.
        self._coefficients = np.pad(spline_filter(array, order=3, mode="mirror"), 2, mode="reflect")
        self._lower, self.spacing = lower, (upper - lower) / (np.array(array.shape) - 1)
        self._cells = np.array(array.shape) - 1

    def value(self, x: Array) -> Array:
        """(n, d) -> (n,)."""
        return self._sum(x, None)

    def gradient(self, x: Array) -> Array:
        """(n, d) -> (n, d)."""
        return np.stack([self._sum(x, a) / self.spacing[a] for a in range(x.shape[1])], axis=1)

    def _sum(self, x: Array, derived: int | None) -> Array:
        """The spline, or its derivative along one axis of the grid, with lengths in cells."""
        places = (x - self._lower) / self.spacing
        # Beyond the border it goes on as at the border, and grows with the distance.
        inside = np.clip(places, 0, self._cells)
        first = np.minimum(inside.astype(np.intp), self._cells - 1)
        share = inside - first
        total = np.zeros(len(x))
        d = x.shape[1]
        weights = [
            _slopes(share[:, a]) if a == derived else _weights(share[:, a]) for a in range(d)
        ]
        for corner in np.ndindex(*(4,) * d):
            term = self._coefficients[tuple(first[:, a] + corner[a] + 1 for a in range(d))].copy()
            for a in range(d):
                term *= weights[a][corner[a]]
            total += term
        beyond = places - inside
        if derived is None:
            return np.asarray(total + norms(beyond * self.spacing))
        length = norms(beyond * self.spacing)
        out = length > 0
        outward = np.divide(
            beyond[:, derived] * self.spacing[derived], length, where=out, out=np.zeros(len(x))
        )
        total = np.where(beyond[:, derived] != 0, 0.0, total)
        return np.asarray(total + outward * self.spacing[derived])


# By products: numpy's powers round otherwise for one number than for a column of an array.
def _weights(t: Array) -> list[Array]:
    """Of the four splines about a place t of a cell, there."""
    u, t2 = 1 - t, t * t
    return [
        u * u * u / 6,
        (t2 * (3 * t - 6) + 4) / 6,
        (((3 - 3 * t) * t + 3) * t + 1) / 6,
        t2 * t / 6,
    ]


def _slopes(t: Array) -> list[Array]:
    """Their derivatives."""
    u = 1 - t
    return [-u * u / 2, t * (9 * t - 12) / 6, (t * (6 - 9 * t) + 3) / 6, t * t / 2]
