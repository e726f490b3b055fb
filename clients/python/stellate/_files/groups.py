"""A mesh with boundary as files hold it: groups of simplices, by the walls that they lie on."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from .._complex import Complex
from .._faces import faces


@dataclasses.dataclass(frozen=True, eq=False)
class Group:
    """Simplices of one dimension that lie on the same walls; on none: the mesh's own, or a region's.

    Attributes:
      tag: its number, from 1 on: the mesh's own first, then the boundary's, edges', corners'.
      name: "inside", or a region's name, "region_1" if it has none; "wall_0", "walls_0_1", ...
      walls: their numbers, ascending.
      simplices: (m, j+1). The boundary's are turned as the mesh's own induce it: outwards, if
        the mesh fills space. What is between two regions is turned outwards from that of the
        lower label.
      label: of the region that it is; else 0.
      sides: (m, 2), of faces of dimension k - 1 of a mesh with labels: the labels that each faces away
        from and faces. None of others.
    """

    tag: int
    name: str
    walls: tuple[int, ...]
    simplices: np.ndarray
    label: int = 0
    sides: np.ndarray | None = None

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
        return _boundary_groups(mesh, cells, labels)
    known = () if labels is None else np.unique(labels).tolist()
    return cell_groups(mesh.simplices, cells, mesh.walls, labels, mesh.region_names, known)


def cell_groups(
    simplices: np.ndarray,
    cells: np.ndarray,
    walls: np.ndarray | None,
    labels: np.ndarray | None,
    names: tuple[str, ...],
    known: Sequence[int],
) -> list[Group]:
    """Those of a mesh that is not a boundary alone; `known`, ascending: the labels, where it has some.

    Its simplices, and the same as `cells`, may be those alone that have a vertex on a wall: then so
    are those of the regions, and the faces are those of the whole mesh.
    """
    k = simplices.shape[1] - 1
    found = [Group(1, "inside", (), cells)]
    if labels is not None and len(known):
        is_all = len(known) == 1 and not names
        found = [
            Group(
                number,
                "inside" if is_all else region_name(label, names),
                (),
                cells[labels == label],
                label,
            )
            for number, label in enumerate(known, 1)
        ]
    regions = list(found)
    for dimension in reversed(range(k)):
        for face in faces(simplices, walls, dimension, labels):
            rows, sides = face.simplices, None
            if dimension == k - 1 >= 1:
                sides = None if labels is None else np.zeros((len(rows), 2), dtype=np.int32)
                for region in reversed(regions):  # of several, the first one's turn stays
                    rows, on = _turned(rows, region.simplices)
                    if sides is not None:
                        sides[on, 1], sides[on, 0] = sides[on, 0], region.label
            found.append(
                Group(len(found) + 1, wall_name(face.walls), face.walls, rows, sides=sides)
            )
    return found


def region_name(label: int, names: tuple[str, ...]) -> str:
    """A name without what formats take for something else: .obj has spaces between names of groups,
    .msh quotes around them. "region_1" where there is none, or another region has it, too."""
    clean = ["".join("_" if c in ' "\\' else c for c in name) for name in names]
    name = clean[label - 1] if label <= len(clean) else ""
    return name if name and clean.count(name) == 1 else f"region_{label}"


def label_data(every: list[Group]) -> dict[str, list[np.ndarray]]:
    """What cells of files have of labels, group by group: "region", (m,), and "sides", (m, 2)."""
    counts = [len(group.simplices) for group in every]
    nothing = [np.zeros((count, 2), dtype=np.int32) for count in counts]
    return {
        "region": [
            np.full(count, group.label, dtype=np.int32) for count, group in zip(counts, every)
        ],
        "sides": [
            none if group.sides is None else group.sides for none, group in zip(nothing, every)
        ],
    }


def wall_name(walls: tuple[int, ...]) -> str:
    """ "wall_0", "walls_0_1", ..."""
    return f"wall{'s' if len(walls) > 1 else ''}_" + "_".join(map(str, walls))


def _boundary_groups(mesh: Complex, cells: np.ndarray, labels: np.ndarray) -> list[Group]:
    """A boundary without its inside: its walls, and where they meet."""
    found: list[Group] = []
    assert mesh.walls is not None
    bits = np.bitwise_and.reduce(mesh.walls[mesh.simplices], axis=1)
    is_turned = (cells != mesh.simplices).any(axis=1)
    every = np.where(is_turned[:, None], labels[:, ::-1], labels).astype(np.int32)
    for dimension in reversed(range(mesh.dimension + 1)):
        for face in mesh.faces(dimension):
            rows, sides = face.simplices, None
            if dimension == mesh.dimension:
                on = bits == sum(1 << wall for wall in face.walls)
                rows, sides = cells[on], every[on]
            found.append(
                Group(len(found) + 1, wall_name(face.walls), face.walls, rows, sides=sides)
            )
    return found


def _turned(rows: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The facets as the cells that have them induce their orientation, others as they are; and which
    the cells have."""
    wanted = {tuple(row): i for i, row in enumerate(np.sort(rows, axis=1).tolist())}
    on = np.zeros(int(max(cells.max(initial=0), rows.max())) + 1, dtype=bool)
    on[rows] = True
    turned, there = rows.copy(), np.zeros(len(rows), dtype=bool)
    for out in range(cells.shape[1]):
        facets = np.delete(cells, out, axis=1)
        facets = facets[on[facets].all(axis=1)]
        if out % 2:
            facets[:, -2:] = facets[:, [-1, -2]]
        for ascending, facet in zip(np.sort(facets, axis=1).tolist(), facets.tolist()):
            place = wanted.get(tuple(ascending))
            if place is not None:
                turned[place], there[place] = facet, True
    return turned, there
