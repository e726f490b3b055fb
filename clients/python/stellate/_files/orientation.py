"""Turning the simplices of a complex to agree with their neighbours."""

from __future__ import annotations

import numpy as np


def exchanged(simplices: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """A copy, with the last two vertices exchanged in these rows."""
    turned = simplices.copy()
    turned[rows, -2:] = simplices[rows][:, [-1, -2]]
    return turned


def oriented(points: np.ndarray, simplices: np.ndarray) -> np.ndarray | None:
    """Simplices that agree, as orient has them; None if not orientable.

    The normals of a hypersurface point outwards, and simplices that fill space have positive volumes.
    """
    turned = orient(simplices)
    if turned is None:
        return None
    agreeing, component = turned
    k, d = simplices.shape[1] - 1, points.shape[1]
    if k == d - 1:
        turn_outwards(points, agreeing, component)
    elif k == d:
        turn_positive(points, agreeing)
    return agreeing


def orient(simplices: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """The same simplices, some with their last two vertices exchanged, so that all agree.

    Simplices agree when they induce opposite orientations on the facet they share; in each
    component the first one stays as it is. Rows have to be ascending. Cost O(m log m).

    Returns: the simplices, and for each the first simplex of its component, where components hang
      together by facets. None if that cannot be: the complex is not orientable, or a facet is in
      more than two simplices.
    """
    count = len(simplices)
    neighbours = _neighbours(simplices)
    if neighbours is None:
        return None
    a, b, agree = neighbours
    # Each simplex s is there twice, as it is (2 s) and turned (2 s + 1). What agrees is joined: the
    # two halves of an orientable component stay apart.
    b_like_a = 2 * b + ~agree
    label = _components(
        2 * count, np.concatenate([2 * a, 2 * a + 1]), np.concatenate([b_like_a, b_like_a ^ 1])
    )
    stays, turned = label[0::2], label[1::2]
    if (stays == turned).any():
        return None
    rows = np.flatnonzero(stays > turned)  # joined with their component's first one turned
    return exchanged(simplices, rows), stays // 2


def _neighbours(simplices: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
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
    return owner[first], owner[first + 1], sign[first] != sign[first + 1]


def _components(count: int, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """For each node of a graph with edges a[i], b[i] the least node of its component.

    Boruvka's algorithm: every tree takes its first edge that leaves it, so that each round at least
    halves the number of trees that have one.
    """
    tree = np.arange(count)
    trees = count
    while a.size:
        nodes = np.arange(trees)
        parent = nodes.copy()
        # Of several values assigned to one place the last one stays: here the first edge's.
        ends, others = np.stack([a, b], axis=1).ravel(), np.stack([b, a], axis=1).ravel()
        parent[ends[::-1]] = others[::-1]
        mutual = (parent[parent] == nodes) & (nodes < parent)  # both took the same edge
        parent[mutual] = nodes[mutual]
        while True:
            above = parent[parent]
            if (above == parent).all():
                break
            parent = above
        roots, of_root = np.unique(parent, return_inverse=True)
        trees, tree, a, b = len(roots), of_root[tree], of_root[a], of_root[b]
        apart = a != b
        a, b = a[apart], b[apart]
    least = np.empty(trees, dtype=np.int64)
    least[tree[::-1]] = np.arange(count)[::-1]
    return least[tree]


def turn_outwards(points: np.ndarray, oriented: np.ndarray, component: np.ndarray) -> None:
    """Turns, in place, the components of a hypersurface whose normals point inwards.

    `component`: of each simplex, a row of `oriented`.
    """
    volumes = np.linalg.det(points[oriented])  # (k+1)! times those of the cones from the origin
    inwards = np.bincount(component, weights=volumes)[component] < 0
    oriented[inwards, -2:] = oriented[inwards][:, [-1, -2]]


def turn_positive(points: np.ndarray, oriented: np.ndarray) -> None:
    """Turns, in place, the simplices that fill space (k = d) with a negative volume."""
    corners = points[oriented]
    negative = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0
    oriented[negative, -2:] = oriented[negative][:, [-1, -2]]
