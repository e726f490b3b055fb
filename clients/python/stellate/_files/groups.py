"""A mesh with boundary as files hold it: groups of simplices, by the walls that they lie on."""

from __future__ import annotations

import dataclasses

import numpy as np

from .._complex import Complex


@dataclasses.dataclass(frozen=True, eq=False)
class Group:
    """Simplices of one dimension that lie on the same walls; on none: the mesh's own, or a region's.

    Attributes:
      tag: its number, from 1 on: the mesh's own first, then the boundary's, edges', corners'.
      name: "inside", or "region_1" of several regions; "wall_0", "walls_0_1", ...
      walls: their numbers, ascending.
      simplices: (m, j+1). The boundary's are turned as the mesh's own induce it: outwards, if
        the mesh fills space. What is between two regions is turned outwards from that of the
        lower label.
    """

    tag: int
    name: str
    walls: tuple[int, ...]
    simplices: np.ndarray

    @property
    def dimension(self) -> int:
        """j"""
        return self.simplices.shape[1] - 1

    @property
    def bits(self) -> int:
        """The walls, wall i as bit i."""
        return sum(1 << wall for wall in self.walls)


def groups(mesh: Complex, cells: np.ndarray) -> list[Group]:
    """All of a mesh with these cells, oriented or not: one group, where it has no boundary."""
    labels = mesh.labels
    if labels is not None and labels.ndim == 2:
        return _boundary_groups(mesh, cells)
    found = [Group(1, "inside", (), cells)]
    if labels is not None and len(np.unique(labels)) > 1:
        found = [
            Group(number, f"region_{label}", (), cells[labels == label])
            for number, label in enumerate(np.unique(labels).tolist(), 1)
        ]
    regions = [group.simplices for group in found]
    for dimension in reversed(range(mesh.dimension)):
        for face in mesh.faces(dimension):
            rows = face.simplices
            if dimension == mesh.dimension - 1 >= 1:
                for region in reversed(regions):  # of several, the first one's turn stays
                    rows = _turned(rows, region)
            found.append(Group(len(found) + 1, _name(face.walls), face.walls, rows))
    return found


def _name(walls: tuple[int, ...]) -> str:
    return f"wall{'s' if len(walls) > 1 else ''}_" + "_".join(map(str, walls))


def _boundary_groups(mesh: Complex, cells: np.ndarray) -> list[Group]:
    """A boundary without its inside: its walls, and where they meet."""
    found: list[Group] = []
    assert mesh.walls is not None
    bits = np.bitwise_and.reduce(mesh.walls[mesh.simplices], axis=1)
    for dimension in reversed(range(mesh.dimension + 1)):
        for face in mesh.faces(dimension):
            rows = face.simplices
            if dimension == mesh.dimension:
                rows = cells[bits == sum(1 << wall for wall in face.walls)]
            found.append(Group(len(found) + 1, _name(face.walls), face.walls, rows))
    return found


def _turned(rows: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """The facets as the cells that have them induce their orientation; others as they are."""
    wanted = {tuple(row): i for i, row in enumerate(np.sort(rows, axis=1).tolist())}
    on = np.zeros(int(max(cells.max(), rows.max())) + 1, dtype=bool)
    on[rows] = True
    turned = rows.copy()
    for out in range(cells.shape[1]):
        facets = np.delete(cells, out, axis=1)
        facets = facets[on[facets].all(axis=1)]
        if out % 2:
            facets[:, -2:] = facets[:, [-1, -2]]
        for ascending, facet in zip(np.sort(facets, axis=1).tolist(), facets.tolist()):
            place = wanted.get(tuple(ascending))
            if place is not None:
                turned[place] = facet
    return turned
