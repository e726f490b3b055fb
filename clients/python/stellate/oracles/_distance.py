"""Hypersurfaces given by a signed distance: a function, or its values on a grid."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, get_args

import numpy as np

from .._functions import UserFunction
from .._rows import Array, unmasked
from ..errors import InvalidArgument
from ._grid import Grid, Spline, smoothed
from ._implicit import ImplicitManifold

Border = Literal["closed", "open"]

_MOST_LABELS = 16  # whole numbers that are taken for labels
_MOST_LABELS = 16  # whole numbers that are taken for labels
_MANY_VOXELS = 2  # a standard deviation that is most likely a length in another unit


class SignedDistance(ImplicitManifold):
    """The zero set of a signed distance, or of any smooth function with a gradient that is not zero
    there.

    Args:
      f: (n, d) -> (n,).
      gradient: (n, d) -> (n, d), or None for differences of f.
      bounding_box: (lower (d,), upper (d,)) around the set.
      level: the value whose set is meant.

    A distance has kinks on the medial axis: the solvers begin at points of the box and go down the
    gradient, which they survive. See `of_grid` for sampled distances, `of_volume` for voxels.
    """

    resolution: float | None = None  # the spacing of the grid, where there is one
    about: str = ""  # of a grid, its values and their spacing

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

        self._level = float(level)
        self._distance = UserFunction(f, "f", (1,), str(d))
        self._slope = (
            None if gradient is None else UserFunction(gradient, "gradient", (1, d), str(d))
        )
        super().__init__(
            self._above_level,
            self._slope,
            ambient_dimension=d,
            dimension=d - 1,
            bounding_box=bounding_box,
            thread_safe=thread_safe,
        )

    def _above_level(self, x: Array) -> Array:
        return self._distance(x) - self._level

    @classmethod
    def of_grid(
        cls, values: Any, bounding_box: Any, *, level: float = 0.0, border: Border = "closed"
    ) -> SignedDistance:
        """The zero set of the cubic spline through values on a grid; needs scipy.

        Args:
          values: (n_1, ..., n_d), at evenly spaced places; the first and last of each axis lie on
            the box. Any smooth function's: distances, densities, either sign inside.
          bounding_box: (lower (d,), upper (d,)).
          border: "closed": the set does not reach the box's sides. "open": it may, and goes on beyond
            them; to be clipped, by Clipped(oracle, box=bounding_box).

        The spline is smooth (C^2) and reproduces the values. What the grid does not resolve it cannot
        know: thin parts and gaps of fewer than some three spacings come out otherwise or not at all,
        and the set is within about spacing^2 times the curvature of the one that was sampled. An
        epsilon below the `resolution` meshes the spline ever better, and not what was sampled.

        Raises: InvalidArgument where there is no such set, where it leaves the grid, and where values
          are those of labels or a mask: what to do about it is said.
        """
        if border not in get_args(Border):
            raise InvalidArgument(f"border has to be 'closed' or 'open', and is {border!r}")
        grid = Grid(values, bounding_box)
        outside = grid.insist_on_a_surface(level, border == "open")
        spline = Spline(grid, 0.0 if border == "open" else outside)
        oracle = cls(
            spline.value,
            spline.gradient,
            bounding_box=bounding_box,
            level=level,
            thread_safe=True,
        )
        oracle.resolution = float(grid.spacing.max())
        shape = " x ".join(map(str, grid.values.shape))
        oracle.about = f"a spline through {shape} values on a grid, spacing {oracle.resolution:.6g}"
        return oracle

    @classmethod
    def of_volume(
        cls,
        array: Any,
        *,
        spacing: Any = 1.0,
        origin: Any = 0.0,
        level: float | None = None,
        smooth: float = 0.0,
        border: Border = "closed",
    ) -> SignedDistance:
        """The surface of a level in a volume of voxels, as scanners and simulations write them.

        Args:
          array: (n_1, ..., n_d). Its axes are the coordinates in their order: of an array of
            slices, (z, y, x), give array.transpose(2, 1, 0).
          spacing: between voxels, one length or (d,).
          origin: where the first voxel's middle is, (d,).
          level: by default 0; 1/2 of a mask (an array of bool), such as `labels == 3`.
          smooth: a length: the array is smoothed first, by a Gaussian of this standard deviation. A
            mask takes some 1.5 spacings; noise takes a spacing or more. A surface moves inwards by
            smooth^2 over its radius.
          border: as in `of_grid`.
        """
        volume = np.asarray(unmasked(array))
        mask = volume.dtype.kind == "b"
        if not mask and (level is None or smooth > 0):
            _insist_on_one_label(volume)
        if mask and volume.size and volume.all() == volume.any():
            raise InvalidArgument(
                f"the mask is {bool(volume.all())} everywhere: is the label among np.unique(labels)?"
            )
        if level is None:
            level = 0.5 if mask else 0.0
        d = volume.ndim
        if np.ndim(smooth) != 0:
            raise InvalidArgument(
                "smooth is one length, in spacing's unit, which spacing turns into voxels of each axis: some 1.5 "
                f"of the largest spacing; it is {smooth!r}"
            )
        try:
            sides = np.broadcast_to(np.asarray(spacing, dtype=np.float64), (d,))
            lower = np.broadcast_to(np.asarray(origin, dtype=np.float64), (d,))
        except ValueError:
            skew = (
                "; voxels whose axes are not square to each other, as a crystal's, have no spacing: see the .cube "
                "file on the documentation's page on Fermi surfaces"
                if np.shape(spacing) == (d, d)
                else ""
            )
            raise InvalidArgument(
                f"spacing and origin have to be one number or {d}, and are {spacing!r} and {origin!r}{skew}"
            ) from None
        if not (
            np.isfinite(sides).all() and (sides > 0).all() and np.isfinite(smooth) and smooth >= 0
        ):
            raise InvalidArgument(
                f"spacing has to be positive, and smooth not negative: {spacing!r} and {smooth!r}"
            )
        if smooth > 0:
            sharp, volume = volume, smoothed(volume, smooth / sides)
            if sharp.min() < level < sharp.max() and not volume.min() < level < volume.max():
                raise InvalidArgument(_leaves_nothing(smooth, sides, volume, level))
        box = lower, lower + sides * (np.array(volume.shape) - 1)
        oracle = cls.of_grid(volume, box, level=level, border=border)
        if smooth > 0:
            oracle.about += f", smoothed by {smooth:.6g}"
        return oracle


def _insist_on_one_label(volume: Array) -> None:
    """Raises: InvalidArgument, of the labels of a segmentation, which no level tells apart."""
    if volume.dtype.kind not in "iuf" or not volume.size:
        return
    found = np.unique(volume)
    if not 2 < len(found) <= _MOST_LABELS or (found != np.round(found)).any():
        return
    names = ", ".join(f"{label:g}" for label in found)
    raise InvalidArgument(
        f"the volume holds the {len(found)} numbers {names} alone, as labels of a segmentation do, and between two "
        "labels that are no neighbours smoothing makes up the others. Take one, of_volume(labels == "
        f"{found[1]:g}, spacing=..., smooth=...), or all in one mesh: solids.Phases.of_labels(labels, spacing=..., smooth=...)"
    )


def _leaves_nothing(smooth: float, sides: Array, smoothed: Array, level: float) -> str:
    """That smoothing a volume of that spacing (d,) leaves no set of the level, and what to do."""
    voxels = float((smooth / sides).max())
    text = f"smooth={smooth:g} leaves nothing of the level {level:g}: it is "
    if voxels > _MANY_VOXELS:
        return text + (
            f"a length, in the unit of spacing, and here {voxels:.3g} voxels. Some 1.5 voxels, "
            f"smooth={1.5 * float(sides.max()):.4g}, do for a mask"
        )
    least, most = float(smoothed.min()), float(smoothed.max())
    return text + (
        f"{voxels:.3g} voxels, and what the level bounds is thinner than some three of them. Smoothed values lie "
        f"between {least:.3g} and {most:.3g}: take a level between these, as level={(least + most) / 2:.3g}, which "
        "bounds a thicker part, or a volume of finer voxels"
    )
