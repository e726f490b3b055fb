"""What slicers and scenes hold of a mesh: closed surfaces, a part for each region."""

from __future__ import annotations

import dataclasses

import numpy as np

from .._complex import Complex, in_space
from ..errors import SaveError
from .groups import region_name, wall_name
from .surface import boundary


@dataclasses.dataclass(frozen=True, eq=False)
class Part:
    """A surface of its own, of points that its triangles have.

    Attributes:
      points: (n, 3).
      triangles: (m, 3), turned outwards where the part is closed.
      patches: the name and the rows of the triangles of each wall, "wall_0", ...; one without a name where
        there are no walls.
      closed: whether each edge is between two triangles.
    """

    name: str
    points: np.ndarray
    triangles: np.ndarray
    patches: tuple[tuple[str, np.ndarray], ...]
    closed: bool


def parts(mesh: Complex, cells: np.ndarray, ending: str) -> list[Part]:
    """Of a surface with these cells, or of a solid, in space: a part for each region, or one in all.

    Raises: SaveError where there is no triangle; `ending`: of the file, for the error.
    """
    if not len(cells):
        raise SaveError(f"the mesh has no triangle, and {ending} holds nothing else")
    known = () if mesh.labels is None else np.unique(mesh.labels[mesh.labels > 0]).tolist()
    if len(known) < 2 and not mesh.region_names:
        return [_part("surface", mesh, cells)]
    found = []
    for label in known:
        region = mesh.region(label)
        oriented = region.oriented_simplices()
        rows = region.simplices if oriented is None else oriented
        found.append(_part(region_name(label, mesh.region_names), region, rows))
    return found


def _part(name: str, mesh: Complex, cells: np.ndarray) -> Part:
    triangles = boundary(cells) if mesh.dimension == 3 else cells
    patches: tuple[tuple[str, np.ndarray], ...] = (("", np.arange(len(triangles))),)
    if mesh.walls is not None and len(triangles):
        bits = np.bitwise_and.reduce(mesh.walls[triangles], axis=1)
        patches = tuple((_named(int(b)), np.flatnonzero(bits == b)) for b in np.unique(bits))
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    closed = bool((np.unique(edges, axis=0, return_counts=True)[1] == 2).all())
    used, renumbered = np.unique(triangles, return_inverse=True)
    points = in_space(mesh.points)[used]
    return Part(name, points, renumbered.reshape(-1, 3), patches, closed)


def _named(bits: int) -> str:
    walls = tuple(i for i in range(64) if bits >> i & 1)
    return wall_name(walls) if walls else ""


def insist_on_single_precision(every: list[Part], ending: str) -> None:
    """Raises: SaveError where corners of a triangle fall together in single precision."""
    for part in every:
        ends = part.points.astype("<f4")[part.triangles]
        for i, j in ((0, 1), (1, 2), (2, 0)):
            if (ends[:, i] == ends[:, j]).all(axis=1).any():
                raise SaveError(
                    f"{ending} has single precision, in which vertices of this mesh fall together: save "
                    "it as .ply, or move it nearer to the origin"
                )


def smooth_normals(part: Part, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of some triangles of a part: the numbers of their points, and a unit normal at each."""
    corners = part.points[part.triangles[rows]]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sums = np.zeros_like(part.points)
    for corner in part.triangles[rows].T:
        np.add.at(sums, corner, across)  # by area
    used = np.unique(part.triangles[rows])
    lengths = np.linalg.norm(sums[used], axis=1, keepdims=True)
    upwards = np.array([0.0, 0.0, 1.0])  # any unit vector, where a sum is none
    return used, np.where(lengths > 0, sums[used] / np.where(lengths > 0, lengths, 1), upwards)
