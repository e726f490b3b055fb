"""Writing meshes to files."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Iterator

import numpy as np

from . import _vtu
from .errors import SaveError

if TYPE_CHECKING:
    from ._mesh import Mesh

_VTK_CELLS = {1: "line", 2: "triangle", 3: "tetra"}


def save(mesh: Mesh, path: str) -> None:
    """Mesh.save."""
    extension = os.path.splitext(path)[1].lower()
    own = {".txt": _txt, ".off": _off, ".obj": _obj, ".ply": _ply, ".vtu": _as_vtu}.get(extension)
    if own is None:
        _with_meshio(mesh, path, extension)
        return
    text = "\n".join(own(mesh)) + "\n"  # in full before the file is touched
    with open(path, "w") as file:
        file.write(text)


def _lines(rows: np.ndarray, number: str, prefix: str = "") -> Iterator[str]:
    line = prefix + " ".join([number] * rows.shape[1])
    return (line % tuple(row) for row in rows.tolist())


def _cells(mesh: Mesh) -> np.ndarray:
    oriented = mesh.oriented_simplices()
    return mesh.simplices if oriented is None else oriented


def _refuse_solids(mesh: Mesh, name: str) -> None:
    if mesh.dimension > 2:
        raise SaveError(
            f"{name} holds curves and surfaces, and this mesh has dimension {mesh.dimension}; "
            "save it " + ("as .vtu or .txt" if mesh.dimension == 3 else "as .txt")
        )


def _in_space(mesh: Mesh, name: str) -> np.ndarray:
    """The points with three coordinates, zeros added; an error if there are more."""
    n, d = mesh.points.shape
    if d > 3:
        raise SaveError(
            f"{name} holds points of space, and these have {d} coordinates; save them as .txt or "
            ".off (all coordinates) or .vtu (the first three, all of them as point data)"
        )
    return np.hstack([mesh.points, np.zeros((n, 3 - d))])


def _txt(mesh: Mesh) -> Iterator[str]:
    yield f"{mesh.dimension} {mesh.ambient_dimension} {len(mesh.points)} {len(mesh.simplices)}"
    yield from _lines(mesh.points, "%.17g")
    yield from _lines(mesh.simplices, "%d")


def _off(mesh: Mesh) -> Iterator[str]:
    _refuse_solids(mesh, "OFF")
    if mesh.ambient_dimension == 3:
        yield "OFF"
    else:
        yield "nOFF"
        yield str(mesh.ambient_dimension)
    yield f"{len(mesh.points)} {len(mesh.simplices)} 0"
    yield from _lines(mesh.points, "%.17g")
    yield from _lines(_cells(mesh), "%d", f"{mesh.dimension + 1} ")


def _obj(mesh: Mesh) -> Iterator[str]:
    points = _in_space(mesh, "OBJ")
    _refuse_solids(mesh, "OBJ")
    yield from _lines(points, "%.17g", "v ")
    yield from _lines(_cells(mesh) + 1, "%d", "l " if mesh.dimension == 1 else "f ")


def _ply(mesh: Mesh) -> Iterator[str]:
    points = _in_space(mesh, "PLY")
    _refuse_solids(mesh, "PLY")
    yield "ply"
    yield "format ascii 1.0"
    yield f"element vertex {len(points)}"
    yield from (f"property double {axis}" for axis in "xyz")
    if mesh.dimension == 1:
        yield f"element edge {len(mesh.simplices)}"
        yield from ("property int vertex1", "property int vertex2")
    else:
        yield f"element face {len(mesh.simplices)}"
        yield "property list uchar int vertex_indices"
    yield "end_header"
    yield from _lines(points, "%.17g")
    yield from _lines(_cells(mesh), "%d", "" if mesh.dimension == 1 else "3 ")


def _as_vtu(mesh: Mesh) -> Iterator[str]:
    if mesh.dimension not in _vtu.DIMENSIONS:
        raise SaveError(
            "VTU holds simplices of dimension 3 at most, and this mesh has dimension "
            f"{mesh.dimension}; save it as .txt"
        )
    yield from _vtu.lines(mesh, _cells(mesh))


def _with_meshio(mesh: Mesh, path: str, extension: str) -> None:
    try:
        import meshio
    except ImportError:
        raise SaveError(
            f"{extension or 'this'} files are written by meshio, which is not installed "
            "(python3-meshio); .txt .off .obj .ply .vtu need nothing"
        ) from None
    if extension not in meshio.extension_to_filetypes:
        known = ".txt " + " ".join(sorted(meshio.extension_to_filetypes))
        raise SaveError(f"no format is known by the ending {extension!r} of {path}; known: {known}")
    cell = _VTK_CELLS.get(mesh.dimension)
    if cell is None:
        raise SaveError(
            f"{extension} holds simplices of dimension 3 at most, and this mesh has dimension "
            f"{mesh.dimension}; save it as .txt"
        )
    n, d = mesh.points.shape
    space = np.zeros((n, 3))
    space[:, : min(d, 3)] = mesh.points[:, :3]
    point_data = {"coordinates": np.ascontiguousarray(mesh.points)} if d > 3 else {}
    try:
        meshio.Mesh(space, [(cell, _cells(mesh))], point_data=point_data).write(path)
    except Exception as error:  # meshio has no base class for what its writers raise
        if isinstance(error, OSError):
            raise
        raise SaveError(f"meshio cannot write this mesh to {path}: {error}") from error
