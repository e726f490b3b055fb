"""The faces of a mesh with boundary: of its boundary, edges, corners."""

from __future__ import annotations

import dataclasses

import numpy as np


@dataclasses.dataclass(frozen=True, eq=False)
class Face:
    """The part of a mesh that lies on some walls.

    Attributes:
      walls: their numbers, ascending.
      simplices: (m, j+1) int64, zero-based ids of the mesh's points, ascending in each row, rows in
        lexicographic order, where j is the dimension of the face.
    """

    walls: tuple[int, ...]
    simplices: np.ndarray

    def __repr__(self) -> str:
        walls = ", ".join(map(str, self.walls))
        return f"<stellate.Face of walls {walls}: {len(self.simplices)} simplices>"


def faces(
    simplices: np.ndarray,
    walls: np.ndarray | None,
    dimension: int,
    labels: np.ndarray | None = None,
) -> tuple[Face, ...]:
    """What bounds the complex, by walls: facets in one simplex alone, and what these have in common.

    `walls`: (n,) bits, or None. Faces of a dimension below that of the facets lie on more walls than
    the facets around them do. `labels`: (m,), or None: then facets between two regions bound, too.
    """
    k = simplices.shape[1] - 1
    if walls is None or not 0 <= dimension < k or not len(simplices):
        return ()
    rows = facets_in_one(simplices) if labels is None else facets_of_regions(simplices, labels)
    bits = np.bitwise_and.reduce(walls[rows], axis=1)
    return _by_walls(rows, bits, walls, dimension)


def creases(simplices: np.ndarray, walls: np.ndarray | None, dimension: int) -> tuple[Face, ...]:
    """The faces of a boundary without its inside, by walls: its simplices, and where walls meet."""
    if walls is None or not 0 <= dimension < simplices.shape[1] or not len(simplices):
        return ()
    bits = np.bitwise_and.reduce(walls[simplices], axis=1)
    return _by_walls(simplices, bits, walls, dimension)


def _by_walls(
    rows: np.ndarray, bits: np.ndarray, walls: np.ndarray, dimension: int
) -> tuple[Face, ...]:
    while rows.shape[1] - 1 > dimension and len(rows):
        rows, bits = _ridges(rows, walls)
    return tuple(
        Face(tuple(i for i in range(64) if int(b) >> i & 1), rows[bits == b])
        for b in sorted(
            map(int, np.unique(bits)), key=lambda b: [i for i in range(64) if b >> i & 1]
        )
        if b
    )


def _subsets(rows: np.ndarray) -> np.ndarray:
    """All rows with one entry left out."""
    width = rows.shape[1]
    return np.concatenate([np.delete(rows, i, axis=1) for i in range(width)])


def facets_in_one(simplices: np.ndarray) -> np.ndarray:
    """The facets in one simplex alone, in lexicographic order."""
    facets, counts = np.unique(_subsets(simplices), axis=0, return_counts=True)
    return facets[counts == 1]


def facets_of_regions(simplices: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """The facets that are not in two simplices with one label, in lexicographic order."""
    facets, at = np.unique(_subsets(simplices), axis=0, return_inverse=True)
    of = np.tile(labels, simplices.shape[1]).astype(np.int64)
    counts = np.bincount(at.ravel(), minlength=len(facets))
    least, most = np.full(len(facets), 128), np.full(len(facets), -1)
    np.minimum.at(least, at.ravel(), of)
    np.maximum.at(most, at.ravel(), of)
    return facets[(counts == 1) | (least != most)]


def _ridges(rows: np.ndarray, walls: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of these faces' own faces those that lie on more walls than a face that has them."""
    width = rows.shape[1]
    outer = np.tile(np.bitwise_and.reduce(walls[rows], axis=1), width)
    inner = _subsets(rows)
    bits = np.bitwise_and.reduce(walls[inner], axis=1)
    inner = np.unique(inner[bits != outer], axis=0)
    return inner, np.bitwise_and.reduce(walls[inner], axis=1)
