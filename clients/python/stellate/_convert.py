"""Meshes as other libraries have them."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from ._complex import Complex, in_space
from ._files import vtu
from ._files.meshio_formats import as_meshio
from .errors import InvalidArgument

_INSTALL = {
    "meshio": "apt-get install python3-meshio, or pip install meshio",
    "pyvista": "pip install pyvista",
    "trimesh": "pip install trimesh",
    "open3d": "apt-get install python3-open3d, or pip install open3d",
    "pandas": "apt-get install python3-pandas, or pip install pandas",
    "gudhi": "apt-get install python3-gudhi, or pip install gudhi",
}


def to_meshio(mesh: Complex, cells: np.ndarray) -> Any:
    """Mesh.to_meshio."""
    _module("meshio")
    _insist(mesh, "meshio", range(1, 4), None)
    return as_meshio(mesh, cells)


def to_pyvista(mesh: Complex, cells: np.ndarray) -> Any:
    """Mesh.to_pyvista."""
    pyvista = _module("pyvista")
    _insist(mesh, "PyVista", vtu.DIMENSIONS, None)
    kinds = np.full(len(cells), vtu.CELL_TYPES[mesh.dimension], dtype=np.uint8)
    rows = np.column_stack([np.full(len(cells), cells.shape[1]), cells])
    grid = pyvista.UnstructuredGrid(rows.ravel(), kinds, in_space(mesh.points))
    if mesh.ambient_dimension > 3:
        grid.point_data["coordinates"] = np.ascontiguousarray(mesh.points)
    return grid


def to_trimesh(mesh: Complex, cells: np.ndarray) -> Any:
    """Mesh.to_trimesh."""
    trimesh = _module("trimesh")
    _insist(mesh, "trimesh", (2,), 3)
    return trimesh.Trimesh(in_space(mesh.points), cells, process=False)


def to_open3d(mesh: Complex, cells: np.ndarray) -> Any:
    """Mesh.to_open3d."""
    open3d = _module("open3d")
    _insist(mesh, "Open3D", (1, 2), 3)
    points = open3d.utility.Vector3dVector(in_space(mesh.points))
    if mesh.dimension == 1:
        return open3d.geometry.LineSet(points, open3d.utility.Vector2iVector(cells))
    return open3d.geometry.TriangleMesh(points, open3d.utility.Vector3iVector(cells))


def to_pandas(mesh: Complex, names: Sequence[str] | None) -> Any:
    """Mesh.to_pandas."""
    pandas, d = _module("pandas"), mesh.ambient_dimension
    if names is None:
        names = mesh.coordinate_names or (
            list("xyz"[:d]) if d <= 3 else [f"x{i}" for i in range(d)]
        )
    if isinstance(names, str) or len(names) != d:
        raise InvalidArgument(f"names have to be {d}, one for each coordinate, and are {names!r}")
    index = pandas.RangeIndex(len(mesh.points), name="vertex")
    return pandas.DataFrame(np.array(mesh.points), index=index, columns=list(names))


def to_simplex_tree(mesh: Complex) -> Any:
    """Mesh.simplex_tree."""
    tree = _module("gudhi").SimplexTree()
    for simplex in mesh.simplices.tolist():
        tree.insert(simplex, 0.0)
    return tree


def _module(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(f"there is no {name} here: {_INSTALL[name]} ({error})") from None


def _insist(mesh: Complex, library: str, dimensions: Any, most: int | None) -> None:
    k, d = mesh.dimension, mesh.ambient_dimension
    if k not in dimensions or (most is not None and d > most):
        known = f"k in {list(dimensions)}" + ("" if most is None else f" and d <= {most}")
        raise InvalidArgument(
            f"{library} takes meshes with {known}; this one has k = {k} and d = {d}. slice() lowers "
            "k, and Mesh(points[:, axes], simplices) projects"
        )
