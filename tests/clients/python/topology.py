"""What kind of space a simplicial complex is: independent of the server, from the definitions."""

from __future__ import annotations

import collections
import itertools

import numpy as np


def faces(simplices: np.ndarray, dimension: int) -> np.ndarray:
    """All distinct faces of one dimension, ids ascending."""
    corners = itertools.combinations(range(simplices.shape[1]), dimension + 1)
    return np.unique(
        np.concatenate([np.sort(simplices[:, list(c)], axis=1) for c in corners]), axis=0
    )


def euler_characteristic(simplices: np.ndarray) -> int:
    return sum((-1) ** j * len(faces(simplices, j)) for j in range(simplices.shape[1]))


def is_closed(simplices: np.ndarray) -> bool:
    """Every facet is in exactly two simplices, and no simplex is there twice."""
    width = simplices.shape[1]
    facets = np.concatenate([np.delete(simplices, i, axis=1) for i in range(width)])
    _, count = np.unique(np.sort(facets, axis=1), axis=0, return_counts=True)
    once = len(np.unique(np.sort(simplices, axis=1), axis=0)) == len(simplices)
    return once and bool((count == 2).all())


def rim(simplices: np.ndarray) -> np.ndarray:
    """The facets in one simplex; no facet is in three."""
    facets = np.concatenate([np.delete(simplices, i, axis=1) for i in range(simplices.shape[1])])
    rows, counts = np.unique(facets, axis=0, return_counts=True)
    assert counts.max() <= 2
    return rows[counts == 1]


def component_count(simplices: np.ndarray) -> int:
    parent = {int(v): int(v) for v in np.unique(simplices)}

    def root(v: int) -> int:
        while parent[v] != v:
            parent[v] = parent[parent[v]]
            v = parent[v]
        return v

    for row in simplices.tolist():
        for v in row[1:]:
            parent[root(row[0])] = root(v)
    return sum(root(v) == v for v in parent)


def _is_polygon(edges: list[tuple[int, ...]]) -> bool:
    """Whether the edges are one closed cycle."""
    neighbours = collections.defaultdict(list)
    for a, b in edges:
        neighbours[a].append(b)
        neighbours[b].append(a)
    if not edges or any(len(ends) != 2 for ends in neighbours.values()):
        return False
    start = before = edges[0][0]
    at, length = edges[0][1], 1
    while at != start:
        before, at = at, neighbours[at][neighbours[at][0] == before]
        length += 1
    return length == len(edges)


def _links(simplices: list[tuple[int, ...]]) -> dict[int, list[tuple[int, ...]]]:
    links = collections.defaultdict(list)
    for row in simplices:
        for i, v in enumerate(row):
            links[v].append(row[:i] + row[i + 1 :])
    return links


def _is_sphere(link: list[tuple[int, ...]]) -> bool:
    """Whether a complex of dimension 0, 1 or 2 is a sphere."""
    width = len(link[0])
    if width == 1:
        return len(link) == len(set(link)) == 2
    if width == 2:
        return _is_polygon(link)
    corners = {v for row in link for v in row}
    edges = {pair for row in link for pair in itertools.combinations(row, 2)}
    if len(corners) - len(edges) + len(link) != 2 or len(edges) * 2 != len(link) * 3:
        return False
    if not all(_is_polygon(around) for around in _links(link).values()):
        return False
    return component_count(np.array(link)) == 1


def is_manifold(simplices: np.ndarray) -> bool:
    """Whether every vertex's link is a sphere; for k <= 3, where that can be read off."""
    rows = [tuple(row) for row in np.sort(simplices, axis=1).tolist()]
    return all(_is_sphere(link) for link in _links(rows).values())


def betti_numbers(simplices: np.ndarray) -> list[int]:
    """Over the field of two elements, by reduction of the boundary matrices, top down."""
    k = simplices.shape[1] - 1
    layers = [[tuple(face) for face in faces(simplices, j).tolist()] for j in range(k + 1)]
    index = [{face: i for i, face in enumerate(layer)} for layer in layers]
    rank = [0] * (k + 2)
    cleared: set[int] = set()
    for j in range(k, 0, -1):
        pivots: dict[int, set[int]] = {}
        for i, face in enumerate(layers[j]):
            if i in cleared:
                continue  # a boundary: its own boundary reduces to nothing
            column = {index[j - 1][face[:m] + face[m + 1 :]] for m in range(j + 1)}
            while column and (low := max(column)) in pivots:
                column ^= pivots[low]
            if column:
                pivots[max(column)] = column
        rank[j] = len(pivots)
        cleared = set(pivots)
    return [len(layers[j]) - rank[j] - rank[j + 1] for j in range(k + 1)]


def assert_closed_manifold(mesh, euler: int, betti: list[int] | None = None) -> None:
    """The mesh uses all its points and is a closed manifold of this topology."""
    assert np.array_equal(np.unique(mesh.simplices), np.arange(len(mesh.points)))
    assert is_closed(mesh.simplices)
    assert is_manifold(mesh.simplices)
    assert euler_characteristic(mesh.simplices) == euler
    if betti is not None:
        assert betti_numbers(mesh.simplices) == betti
