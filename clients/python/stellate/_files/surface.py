"""What a format of triangles holds of a mesh: all of it, or the surface of a solid."""

from __future__ import annotations

import numpy as np

from .._complex import Complex, in_space


def drawn(mesh: Complex, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The points (n, 3) and simplices of a mesh with these cells; of a solid those of its surface.

    The surface's triangles are those that one tetrahedron alone has, turned outwards of it: around a
    cavity into that. Points within are left out.
    """
    points = in_space(mesh.points)
    if mesh.dimension != 3:
        return points, cells
    triangles = boundary(cells)
    used, renumbered = np.unique(triangles, return_inverse=True)
    return points[used], renumbered.reshape(-1, 3)


def boundary(cells: np.ndarray) -> np.ndarray:
    """The facets (m, k) of one cell alone, as it induces their orientation."""
    facets = []
    for out in range(cells.shape[1]):
        facet = np.delete(cells, out, axis=1)
        if out % 2:
            facet[:, -2:] = facet[:, [-1, -2]]
        facets.append(facet)
    every = np.concatenate(facets)
    _, first, counts = np.unique(
        np.sort(every, axis=1), axis=0, return_index=True, return_counts=True
    )
    return np.asarray(every[np.sort(first[counts == 1])])
