"""What meshio writes well: each read back the same, point for point and simplex for simplex."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from .._complex import Complex, in_space
from ..errors import SaveError
from .groups import Group, groups, label_data

CELLS = {0: "vertex", 1: "line", 2: "triangle", 3: "tetra"}


@dataclasses.dataclass(frozen=True)
class MeshioFormat:
    """One of meshio's file formats, by its name there.

    Attributes:
      least_dimension: of the simplices that it holds; the largest is 3.
      point_data: whether it holds more numbers for each point than its coordinates, and, of a mesh
        with boundary, its faces beside its simplices with numbers for each.
      package: that meshio needs for it.
      facets: whether the boundary's facets go into a file of their own beside it; see as_pair.
    """

    name: str
    least_dimension: int = 1
    point_data: bool = False
    package: str | None = None
    facets: bool = False
    options: Mapping[str, Any] = dataclasses.field(default_factory=dict)


_XDMF = MeshioFormat("xdmf", facets=True, options={"data_format": "XML"})  # without .h5 files

FORMATS = {
    ".vtk": MeshioFormat("vtk", point_data=True),
    ".xdmf": _XDMF,
    ".xmf": _XDMF,
    ".avs": MeshioFormat("avsucd"),
    ".cgns": MeshioFormat("cgns", least_dimension=3, package="h5py"),
    ".dat": MeshioFormat("tecplot"),
    ".dato": MeshioFormat("permas"),
    ".e": MeshioFormat("exodus", package="netCDF4"),
    ".exo": MeshioFormat("exodus", package="netCDF4"),
    ".f3grid": MeshioFormat("flac3d", least_dimension=3),
    ".h5m": MeshioFormat("h5m", package="h5py"),
    ".hmf": MeshioFormat("hmf", package="h5py"),
    ".inp": MeshioFormat("abaqus"),
    ".mdpa": MeshioFormat("mdpa"),
    ".med": MeshioFormat("med", package="h5py"),
    ".mesh": MeshioFormat("medit"),
    ".meshb": MeshioFormat("medit"),
    ".post": MeshioFormat("permas"),
    ".tec": MeshioFormat("tecplot"),
    ".vol": MeshioFormat("netgen"),
    ".xml": MeshioFormat("dolfin-xml", least_dimension=2),
}


def as_meshio(mesh: Complex, cells: np.ndarray, faces: bool = True) -> Any:
    """A meshio.Mesh with these oriented cells, 1 <= k <= 3, and `faces` of its boundary too."""
    import meshio

    every = groups(mesh, cells) if faces else [Group(1, "inside", (), cells)]
    points = np.ascontiguousarray(mesh.points)
    point_data = {"coordinates": points} if mesh.ambient_dimension > 3 else {}
    cell_data: dict[str, list[np.ndarray]] = {}
    names: dict[str, np.ndarray] = {}
    if len(every) > 1 and mesh.walls is not None:
        point_data["walls"] = mesh.walls
        tags = [np.full(len(group.simplices), group.tag, dtype=np.int32) for group in every]
        cell_data = {
            "gmsh:physical": tags,
            "gmsh:geometrical": tags,
            "walls": [np.full(len(g.simplices), g.bits, dtype=np.uint64) for g in every],
        }
        if mesh.labels is not None:
            cell_data.update(label_data(every))
        names = {group.name: np.array([group.tag, group.dimension]) for group in every}
    return meshio.Mesh(
        in_space(points),
        [(CELLS[group.dimension], group.simplices) for group in every],
        point_data=point_data,
        cell_data=cell_data,
        field_data=names,
    )


def as_pair(mesh: Complex, cells: np.ndarray) -> tuple[Any, Any]:
    """Two of meshio's meshes of the same points, in R^2 where d = 2, as FEniCS reads a mesh and the tags
    of its facets: the cells, with "region", and the facets on walls, with "wall", the first one's number
    plus 1 (0 is what has none). None in place of the second where there is no wall.
    """
    import meshio

    points = np.ascontiguousarray(
        mesh.points if mesh.ambient_dimension == 2 else in_space(mesh.points)
    )
    regions = np.ones(len(cells), dtype=np.int32)
    if mesh.labels is not None and mesh.labels.ndim == 1:
        regions = mesh.labels.astype(np.int32)
    whole = meshio.Mesh(points, [(CELLS[mesh.dimension], cells)], cell_data={"region": [regions]})
    every = [g for g in groups(mesh, cells) if g.walls and g.dimension == mesh.dimension - 1]
    if not every:
        return whole, None
    tags = np.repeat([g.walls[0] + 1 for g in every], [len(g.simplices) for g in every])
    rows = np.concatenate([g.simplices for g in every])
    walls = {"wall": [tags.astype(np.int32)]}
    return whole, meshio.Mesh(points, [(CELLS[mesh.dimension - 1], rows)], cell_data=walls)


def are_facets(path: str) -> bool:
    """Whether a file is the second one of such a pair, as we write it."""
    if not os.path.isfile(path):
        return False
    with open(path, "rb") as file:
        return any(b'<Attribute Name="wall"' in line for line in file)


def write(
    form: MeshioFormat, mesh: Complex, cells: np.ndarray, path: str, facets: str | None = None
) -> None:
    """Writes a mesh with these oriented cells, that the format can hold, to a file, or to two."""
    import meshio

    if len(cells) == 0:
        raise SaveError(
            f"the mesh has no simplices, and meshio writes none such as {form.name}: .txt, .msh "
            "and .vtu hold points alone"
        )
    try:
        of_facets = None
        if form.facets:
            whole, of_facets = as_pair(mesh, cells)
        else:
            whole = as_meshio(mesh, cells, form.point_data)
        meshio.write(path, whole, form.name, **form.options)
        if of_facets is not None and facets is not None:
            meshio.write(facets, of_facets, form.name, **form.options)
    except Exception as error:  # meshio has no base class for what its writers raise
        if isinstance(error, OSError):
            raise
        raise SaveError(f"meshio cannot write this mesh as {form.name}: {error!r}") from error
