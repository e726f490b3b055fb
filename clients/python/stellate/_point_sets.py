"""Sets of points that were given: checked, and searched."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from ._rows import Array, unmasked
from .errors import InvalidArgument


def tree_of(points: Array) -> Any:
    """A tree of points; needs scipy.

    Raises: InvalidArgument, saying how to get it.
    """
    try:
        from scipy.spatial import cKDTree
    except ImportError:
        raise InvalidArgument(
            "points are searched with scipy's tree, and there is no scipy: "
            "apt-get install python3-scipy, or pip install scipy"
        ) from None
    return cKDTree(points)


def column_names(points: Any) -> tuple[str, ...]:
    """Of a table whose columns have names, as a pandas.DataFrame; of other points ()."""
    columns = getattr(points, "columns", None)
    return () if columns is None else tuple(map(str, columns))


def as_points(points: Any, what: str) -> Array:
    """(n, d), finite, of at least one row.

    Raises: InvalidArgument.
    """
    if isinstance(points, (str, os.PathLike)):
        raise InvalidArgument(
            f"{what} have to be an array (n, d), and are the name of a file: read it first, as by np.loadtxt"
        )
    try:
        array = np.array(unmasked(points), dtype=np.float64)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.ndim != 2 or not array.size:
        raise InvalidArgument(f"{what} have to be an array (n, d), and are {np.shape(points)}")
    bad = ~np.isfinite(array).all(axis=1)
    if bad.any():
        raise InvalidArgument(
            f"{what}: row {int(np.argmax(bad))} is not finite, or masked, and so are "
            f"{np.count_nonzero(bad):,} of {len(array):,} in all. Leave out rows that hold no point"
        )
    return array
