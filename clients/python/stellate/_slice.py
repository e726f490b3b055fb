"""Cutting a complex with a hyperplane."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from .errors import InvalidArgument


def as_normal(normal: Any, d: int) -> np.ndarray:
    """An axis's number, or a vector (d,), as a vector. Raises: InvalidArgument."""
    if isinstance(normal, (int, np.integer)):
        if not 0 <= normal < d:
            raise InvalidArgument(f"there is no axis {normal}: the space has {d}, from 0 on")
        return np.eye(d)[int(normal)]
    vector = np.asarray(normal, dtype=float)
    if vector.shape != (d,) or not np.isfinite(vector).all() or not vector.any():
        raise InvalidArgument(
            f"a hyperplane's normal is the number of an axis or {d} finite numbers, not all zero; "
            f"it is {normal!r}"
        )
    return vector


def cut(
    points: np.ndarray, simplices: np.ndarray, heights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where k-simplices meet the zero set of a function that is linear on each of them.

    A simplex with p vertices above and q below is cut in a product of two simplices, of dimensions
    p - 1 and q - 1. Its staircase triangulation by ascending ids agrees with its neighbours', so
    that the cut of a closed complex is closed.

    Args:
      heights: (n,), at the points; a zero counts as above.

    Returns: points (n', d), one for each edge that is cut, and simplices (m', k), rows ascending
      and in lexicographic order.
    """
    above = heights >= 0
    count = above[simplices].sum(axis=1)
    width = simplices.shape[1]
    pairs = [np.empty((0, width - 1, 2), dtype=np.int64)]
    for p in range(1, width):
        rows = simplices[count == p]
        order = np.argsort(~above[rows], axis=1, kind="stable")
        rows = np.take_along_axis(rows, order, axis=1)
        for path in _staircases(p, width - p):
            pairs.append(np.stack([rows[:, path[:, 0]], rows[:, p + path[:, 1]]], axis=2))
    edges, ids = np.unique(np.concatenate(pairs).reshape(-1, 2), axis=0, return_inverse=True)
    a, b = edges[:, 0], edges[:, 1]
    share = (heights[a] / (heights[a] - heights[b]))[:, None]
    cells = np.sort(ids.reshape(-1, width - 1), axis=1)
    return (1 - share) * points[a] + share * points[b], cells[np.lexsort(cells.T[::-1])]


def _staircases(p: int, q: int) -> list[np.ndarray]:
    """The monotone lattice paths from (0, 0) to (p - 1, q - 1), (p + q - 1, 2) each."""
    paths = []
    for rights in itertools.combinations(range(p + q - 2), p - 1):
        steps = np.zeros((p + q - 1, 2), dtype=np.int64)
        steps[1:, 1] = 1
        for i in rights:
            steps[i + 1] = 1, 0
        paths.append(np.cumsum(steps, axis=0))
    return paths
