"""Turning the simplices of a complex to agree with their neighbours."""

from __future__ import annotations

import numpy as np


def orient(simplices: np.ndarray) -> np.ndarray | None:
    """The same simplices, some with their first two vertices exchanged, so that all agree.

    In each component the first simplex stays as it is. Simplices agree when they induce opposite
    orientations on the facet they share. None if that cannot be: the complex is not orientable, or
    a facet is in more than two simplices. Rows have to be ascending. Cost O(m log m).
    """
    count = len(simplices)
    neighbours = _neighbours(simplices)
    if neighbours is None:
        return None
    pairs, agree = neighbours
    source = np.concatenate([pairs[:, 0], pairs[:, 1]])
    order = np.argsort(source, kind="stable")
    target = np.concatenate([pairs[:, 1], pairs[:, 0]])[order]
    relation = np.where(np.concatenate([agree, agree])[order], 1, -1).astype(np.int8)
    start = np.searchsorted(source[order], np.arange(count + 1))
    side = np.zeros(count, dtype=np.int8)  # 1: stays, -1: turned, 0: not reached yet
    for seed in range(count):
        if side[seed]:
            continue
        side[seed] = 1
        front = np.array([seed])
        while front.size:
            lengths = start[front + 1] - start[front]
            ends = np.cumsum(lengths)
            edges = np.arange(ends[-1]) + np.repeat(start[front] - (ends - lengths), lengths)
            reached = target[edges]
            wanted = np.repeat(side[front], lengths) * relation[edges]
            fresh = side[reached] == 0
            side[reached[fresh]] = wanted[fresh]
            if (side[reached] != wanted).any():
                return None
            front = np.unique(reached[fresh])
    oriented = simplices.copy()
    oriented[side < 0, :2] = simplices[side < 0][:, [1, 0]]
    return oriented


def _neighbours(simplices: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Pairs of simplices that share a facet, and whether they agree; None if three share one."""
    count, width = simplices.shape
    facets = np.concatenate([np.delete(simplices, i, axis=1) for i in range(width)])
    owner = np.tile(np.arange(count), width)
    sign = np.repeat((-1) ** np.arange(width), count)  # of the orientation induced on the facet
    order = np.lexsort(facets.T[::-1])
    facets, owner, sign = facets[order], owner[order], sign[order]
    equal = (facets[1:] == facets[:-1]).all(axis=1)
    if (equal[1:] & equal[:-1]).any():
        return None
    first = np.flatnonzero(equal)
    return np.stack([owner[first], owner[first + 1]], axis=1), sign[first] != sign[first + 1]


def signed_volume(points: np.ndarray, simplices: np.ndarray) -> float:
    """d! times the volume that oriented (d-1)-simplices enclose in R^d; > 0: normals outwards."""
    return float(np.linalg.det(points[simplices]).sum())


def components(simplices: np.ndarray, vertex_count: int) -> np.ndarray:
    """For each simplex the least vertex of its component."""
    label = np.arange(vertex_count)
    while True:
        least = label[simplices].min(axis=1)
        lower = label.copy()
        np.minimum.at(lower, simplices, least[:, None])
        lower = lower[lower]
        if (lower == label).all():
            return label[simplices[:, 0]]
        label = lower
