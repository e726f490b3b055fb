"""How far the neighbours of each point of a cloud should reach, for quadrics to be fitted to them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from .._point_sets import tree_of
from .._rows import Array, product, transposed
from ..errors import InvalidArgument

_ROUNDS = 12  # of bandwidths from noise, and noise from fits of these bandwidths
_SETTLED = 0.02  # a share: no round that changes them by less is followed by another
# Of the curvature, what noise may make of it: tangents and reach are as good then as of exact points.
_NOISE_SHARE = 0.1
_LEAST = 0.1  # of the curvature that is seen: no less is left of it by the noise
_GROWTH = 1.5  # of a bandwidth in a round
_WIDEST = 0.5  # of the smallest radius of curvature: a quadric follows no more of a surface

_PLACES = 100  # where it is looked at whether the cloud is flat
_NEAR = 40  # points about each of them
_SHARE = 10  # of so many at least: a larger part of a closed curve is not flat
# Of the spread along, the spread across at the best of all scales. Points without order have .80 to .90
# by these numbers, a sphere with noise of a fifth of its radius .65 to .71.
_ROUND = 0.75


class Fits(NamedTuple):
    """Of the quadrics at some points of the cloud, all (n,)."""

    bend: Array  # their largest curvature
    bend_error: Array  # what the noise makes of it, a standard deviation


def insist_on_flatness(points: Array, dimension: int) -> None:
    """That there is a scale at which the points spread less across k directions than along them.

    Else noise, which is what all that lies across is taken for, would widen the neighbourhoods until
    each has all points. Scales are those of the nearest of all points, of every second, and so on.

    Raises: InvalidArgument.
    """
    order = np.random.default_rng(1).permutation(len(points))
    some, sample, flattest = points[order[:_PLACES]], points[order], np.inf
    while len(sample) >= _SHARE * _NEAR:
        about = sample[tree_of(sample).query(some, k=_NEAR)[1]]
        about = about - about.mean(axis=1, keepdims=True)
        spreads = np.linalg.eigvalsh(product(transposed(about), about))
        across, along = spreads[:, -dimension - 1], np.maximum(spreads[:, -dimension], 1e-300)
        flattest = min(flattest, float(np.median(np.sqrt(np.maximum(across, 0) / along))))
        if flattest <= _ROUND:
            return
        sample = sample[: len(sample) // 2]
    if np.isfinite(flattest):
        raise InvalidArgument(
            f"the points lie near no manifold of dimension {dimension}: at every scale they spread across it "
            f"nearly as far as along it, by {flattest:.2f} at the least. Is the dimension right? Are all "
            "columns coordinates, and not colours or times? Noise has to be far below the radius of "
            "curvature, and so has the distance between points. If all is so, give a bandwidth"
        )


def by_density(distinct: Array, which: Any, dimension: int) -> Array:
    """(n,): twice the distance within which a point, and those about it, have 2 k + 3 others.

    Scans that were put together have points several times, which are no others.

    Args:
      distinct: (m, d), each point once.
      which: (n,), of each point its row there.
    """
    count = min(len(distinct), 2 * dimension + 4)
    away, near = tree_of(distinct).query(distinct, k=count)
    return np.asarray(2.0 * away[:, -1][near].max(axis=1))[which]


def noise_aware(widths: Array, dimension: int, fit: Callable[[Array], Fits]) -> Array:
    """The bandwidths (n,) by density, wider where noise would make the surface bend more than it does.

    The error of a curvature falls with the width w as w^-(2 + k/2), for there are w^k more points.

    Args:
      fit: what quadrics of given bandwidths are like.
    """
    wider = widths
    fall = 2 + dimension / 2
    for _ in range(_ROUNDS):
        seen = fit(wider)
        if not len(seen.bend):  # nowhere are neighbours enough
            break
        # What is left of the curvatures that are seen without what noise adds to them.
        true = np.sqrt(np.maximum(seen.bend**2 - seen.bend_error**2, 0))
        bend = max(float(np.median(true)), _LEAST * float(np.median(seen.bend)), 1e-300)
        # What the error is at each point: as of the usual one, but for how many neighbours it has there.
        relative = float(np.median(seen.bend_error)) / (_NOISE_SHARE * bend)
        usual = float(np.median(wider))
        at = (
            relative
            * (usual / wider) ** 2
            * (usual / wider * widths / np.median(widths)) ** (dimension / 2)
        )
        wished = np.maximum(wider * at ** (1 / fall), widths)
        # What is bent more than the noise can have made it, by two deviations.
        surely = np.sqrt(np.maximum(seen.bend**2 - 4 * seen.bend_error**2, 0))
        most = np.minimum(_GROWTH * wider, _WIDEST / max(float(np.quantile(surely, 0.9)), bend))
        wished = np.maximum(np.minimum(wished, most), widths)
        change = float(np.abs(wished / wider - 1).max())
        wider = wished
        if change < _SETTLED:
            break
    return wider
