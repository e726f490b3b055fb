"""SU2's own meshes: cells that fill their space, and their boundary as markers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .._complex import Complex
from .groups import groups
from .surface import boundary

# meshio's writer would leave out the markers, which SU2 takes its boundary conditions from.
_TYPES = {1: 3, 2: 5, 3: 10}  # VTK's numbers


def contents(mesh: Complex, cells: np.ndarray) -> bytes:
    """The file of a mesh with these oriented cells, k = d of 2 or 3. A marker is the outer boundary on a wall,
    by the wall's name, or all of it, "boundary", where the walls are not known."""
    return "".join(_lines(mesh, cells)).encode()


def _lines(mesh: Complex, cells: np.ndarray) -> Iterator[str]:
    k = mesh.dimension
    yield f"NDIME= {k}\nNELEM= {len(cells)}\n"
    yield from _elements(cells)
    yield f"NPOIN= {len(mesh.points)}\n"
    for point in mesh.points.tolist():
        yield " ".join(map(repr, point)) + "\n"
    markers = _markers(mesh, cells)
    yield f"NMARK= {len(markers)}\n"
    for name, facets in markers.items():
        yield f"MARKER_TAG= {name}\nMARKER_ELEMS= {len(facets)}\n"
        yield from _elements(facets)


def _elements(rows: np.ndarray) -> Iterator[str]:
    kind = _TYPES[rows.shape[1] - 1]
    for row in rows.tolist():
        yield f"{kind} " + " ".join(map(str, row)) + "\n"


def _markers(mesh: Complex, cells: np.ndarray) -> dict[str, np.ndarray]:
    found: dict[str, np.ndarray] = {}
    for group in groups(mesh, cells):
        if not group.walls or group.dimension != mesh.dimension - 1:
            continue
        facets = group.simplices
        if group.sides is not None:  # what is between two regions is no boundary of the domain
            facets = facets[(group.sides == 0).any(axis=1)]
        if len(facets):
            found[group.name] = facets
    return found or {"boundary": boundary(cells)}
