"""Writing meshes to files."""

from __future__ import annotations

import contextlib
import dataclasses
import importlib.util
import itertools
import os
import secrets
import stat
from collections.abc import Iterator
from typing import Callable

import numpy as np

from .._complex import Complex, in_space
from ..errors import SaveError
from . import glb, meshio_formats, npz, three_mf, vtu
from .groups import Group, groups
from .surface import boundary, drawn

_ANY = 1 << 30
_DEBIAN = {"meshio": "python3-meshio", "h5py": "python3-h5py", "netCDF4": "python3-netcdf4"}


def check_save(path: str | os.PathLike[str], dimension: int, ambient_dimension: int) -> None:
    """What Mesh.save would refuse of any k-mesh in R^d, asked before there is a mesh to lose.

    Raises: SaveError when the format that the ending says cannot hold such a mesh, or wants a
      package that is not installed; OSError when the folder is not there or cannot be written to.
    """
    path = os.fspath(path)
    _choose(path, dimension, ambient_dimension)
    if os.path.isdir(path):
        raise IsADirectoryError(f"{path} is a folder")
    place = path if _is_special(path) else os.path.dirname(os.path.realpath(path))
    if not os.path.exists(place):
        raise FileNotFoundError(f"cannot write {path}: there is no folder {place}")
    if not os.access(place, os.W_OK):
        raise PermissionError(f"cannot write {path}: {place} cannot be written to")


def save(mesh: Complex, path: str) -> None:
    """Mesh.save."""
    form = _choose(path, mesh.dimension, mesh.ambient_dimension)
    if form.meshio is not None:
        with contextlib.ExitStack() as stack:
            beside = None
            if form.meshio.facets and mesh.faces(mesh.dimension - 1) and not _is_special(path):
                root, ending = os.path.splitext(path)
                beside = stack.enter_context(_replaced(f"{root}_facets{ending}"))
            draft = stack.enter_context(_replaced(path))
            meshio_formats.write(form.meshio, mesh, cells(mesh), draft, beside)
        return
    _write(form.contents(mesh), path)


def save_txt(mesh: Complex, path: str) -> None:
    """The .txt format, whatever the path ends in."""
    _write(_FORMATS[".txt"].contents(mesh), path)


def _write(contents: bytes, path: str) -> None:
    """Takes contents that are whole before any file is touched."""
    with _replaced(path) as draft, open(draft, "wb") as file:
        file.write(contents)


@dataclasses.dataclass(frozen=True)
class _Format:
    """What a file format can hold, and who writes it: we, or meshio."""

    least_dimension: int
    largest_dimension: int
    largest_ambient_dimension: int
    holds: str
    contents: Callable[[Complex], bytes] = lambda mesh: b""
    meshio: meshio_formats.MeshioFormat | None = None
    surface_of_solids: bool = False  # in space, besides what it holds

    def takes(self, k: int, d: int) -> bool:
        return (self.surface_of_solids and k == d == 3) or (
            self.least_dimension <= k <= self.largest_dimension
            and d <= self.largest_ambient_dimension
        )


def _choose(path: str, k: int, d: int) -> _Format:
    """The format of a path. Raises SaveError if it is not one for k-simplices in R^d."""
    ending = os.path.splitext(path)[1].lower()
    known = " ".join(name for name, form in _FORMATS.items() if form.takes(k, d))
    form = _FORMATS.get(ending)
    if form is None:
        raise SaveError(
            f"no format is known by the ending {ending!r} of {path}; known for this mesh: {known}"
        )
    if not form.takes(k, d):
        fits = form.least_dimension <= k <= form.largest_dimension
        raise SaveError(
            f"{ending} holds {'points of space' if fits else form.holds}, and {path} would get a "
            f"mesh of dimension {k} in R^{d}; known for it: {known}"
        )
    needed = [] if form.meshio is None else ["meshio", form.meshio.package]
    for package in filter(None, needed):
        if importlib.util.find_spec(package) is None:
            raise SaveError(
                f"{ending} files are written with {package}, which is not installed "
                f"({_DEBIAN[package]}, or pip install {package})"
            )
    return form


def _is_special(path: str) -> bool:
    """A pipe or a device: written as it is, since nothing may take its place."""
    return os.path.exists(path) and not stat.S_ISREG(os.stat(path).st_mode)


@contextlib.contextmanager
def _replaced(path: str) -> Iterator[str]:
    """A file to write that takes the path's place when it is whole, and goes if it is not."""
    if _is_special(path):
        yield path
        return
    target = os.path.realpath(path)
    root, ending = os.path.splitext(target)  # which meshio goes by
    draft = f"{root}.part-{secrets.token_hex(4)}{ending}"
    try:
        yield draft
        if os.path.exists(target):
            os.chmod(draft, stat.S_IMODE(os.stat(target).st_mode))
        with open(draft, "rb") as written:
            os.fsync(written.fileno())
        os.replace(draft, target)
    except BaseException as error:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(draft)
        if isinstance(error, OSError) and error.filename == draft:
            error.filename = path  # the one that the caller knows
        raise


def _lines(rows: np.ndarray, number: str, prefix: str = "") -> Iterator[str]:
    line = prefix + " ".join([number] * rows.shape[1])
    return (line % tuple(row) for row in rows.tolist())


def cells(mesh: Complex) -> np.ndarray:
    """The simplices, turned to agree where that can be."""
    oriented = mesh.oriented_simplices()
    return mesh.simplices if oriented is None else oriented


def _txt(mesh: Complex) -> Iterator[str]:
    yield f"{mesh.dimension} {mesh.ambient_dimension} {len(mesh.points)} {len(mesh.simplices)}"
    yield from _lines(mesh.points, "%.17g")
    yield from _lines(mesh.simplices, "%d")


def _off(mesh: Complex) -> Iterator[str]:
    if mesh.ambient_dimension == 3:
        yield "OFF"
    else:
        yield "nOFF"
        yield str(mesh.ambient_dimension)
    points, rows = mesh.points, cells(mesh)
    if mesh.dimension == 3:
        points, rows = drawn(mesh, rows)
    yield f"{len(points)} {len(rows)} 0"
    yield from _lines(points, "%.17g")
    yield from _lines(rows, "%d", f"{rows.shape[1]} ")


def _obj(mesh: Complex) -> Iterator[str]:
    points = in_space(mesh.points)
    yield from _lines(points, "%.17g", "v ")
    every = groups(mesh, cells(mesh))
    named = len(every) > 1
    if mesh.dimension == 3:  # a solid is its boundary here, by its walls if they are known
        every = every[1:] or [Group(1, "surface", (), boundary(cells(mesh)))]
    for group in every:
        if named:
            yield f"g {group.name}"
        yield from _lines(group.simplices + 1, "%d", ("p ", "l ", "f ")[group.dimension])


def _ply(mesh: Complex) -> Iterator[str]:
    points, rows = drawn(mesh, cells(mesh))
    yield "ply"
    yield "format ascii 1.0"
    yield f"element vertex {len(points)}"
    yield from (f"property double {axis}" for axis in "xyz")
    if mesh.dimension == 1:
        yield f"element edge {len(rows)}"
        yield from ("property int vertex1", "property int vertex2")
    else:
        yield f"element face {len(rows)}"
        yield "property list uchar int vertex_indices"
    yield "end_header"
    yield from _lines(points, "%.17g")
    yield from _lines(rows, "%d", "" if mesh.dimension == 1 else "3 ")


def _msh(mesh: Complex) -> Iterator[str]:
    """Gmsh's format 2.2, which every version of it reads, and most others who read .msh."""
    element_types = (15, 1, 2, 4)  # point, line, triangle, tetrahedron
    every = groups(mesh, cells(mesh))
    yield "$MeshFormat\n2.2 0 8\n$EndMeshFormat"
    if len(every) > 1:
        yield f"$PhysicalNames\n{len(every)}"
        yield from (f'{group.dimension} {group.tag} "{group.name}"' for group in every)
        yield "$EndPhysicalNames"
    yield f"$Nodes\n{len(mesh.points)}"
    yield from (f"{i} {line}" for i, line in enumerate(_lines(in_space(mesh.points), "%.17g"), 1))
    yield f"$EndNodes\n$Elements\n{sum(len(group.simplices) for group in every)}"
    # Two tags for each element: its physical group and its geometrical entity, by the same number.
    rows = itertools.chain.from_iterable(
        _lines(
            group.simplices + 1,
            "%d",
            f"{element_types[group.dimension]} 2 {group.tag} {group.tag} ",
        )
        for group in every
    )
    yield from (f"{i} {line}" for i, line in enumerate(rows, 1))
    yield "$EndElements"


_STL_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])


def _stl(mesh: Complex) -> bytes:
    """Binary: a header that says nothing, and never "solid", and a record a triangle."""
    points, rows = drawn(mesh, cells(mesh))
    corners = points[rows]
    facets = np.zeros(len(corners), _STL_FACET)
    facets["corners"] = corners
    ends = facets["corners"]
    for i, j in ((0, 1), (1, 2), (2, 0)):
        if (ends[:, i] == ends[:, j]).all(axis=1).any():
            raise SaveError(
                "STL has single precision, in which vertices of this mesh fall together: save it "
                "as .ply, or move it nearer to the origin"
            )
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    facets["normal"] = normals / np.where(lengths > 0, lengths, 1)
    return b" " * 80 + np.uint32(len(facets)).astype("<u4").tobytes() + facets.tobytes()


def _vtu_lines(mesh: Complex) -> Iterator[str]:
    return vtu.lines(mesh, cells(mesh))


def _three_mf(mesh: Complex) -> bytes:
    return three_mf.contents(mesh, cells(mesh))


def _glb(mesh: Complex) -> bytes:
    return glb.contents(mesh, cells(mesh))


def _text(lines: Callable[[Complex], Iterator[str]]) -> Callable[[Complex], bytes]:
    return lambda mesh: ("\n".join(lines(mesh)) + "\n").encode()


_LOW = "curves and surfaces"
_SOLIDS = "and the surfaces of solids in space"
_CELLULAR = "simplices of dimension 3 at most"

_FORMATS = {
    ".txt": _Format(0, _ANY, _ANY, "anything", _text(_txt)),
    ".off": _Format(1, 2, _ANY, f"{_LOW}, {_SOLIDS}", _text(_off), surface_of_solids=True),
    ".obj": _Format(1, 2, 3, f"{_LOW}, {_SOLIDS}", _text(_obj), surface_of_solids=True),
    ".ply": _Format(1, 2, 3, f"{_LOW}, {_SOLIDS}", _text(_ply), surface_of_solids=True),
    ".stl": _Format(2, 2, 3, f"surfaces, {_SOLIDS}", _stl, surface_of_solids=True),
    ".3mf": _Format(2, 2, 3, f"surfaces, {_SOLIDS}", _three_mf, surface_of_solids=True),
    ".glb": _Format(2, 2, 3, f"surfaces, {_SOLIDS}", _glb, surface_of_solids=True),
    ".msh": _Format(1, 3, 3, _CELLULAR, _text(_msh)),
    ".vtu": _Format(1, 3, _ANY, _CELLULAR, _text(_vtu_lines)),
    ".npz": _Format(0, _ANY, _ANY, "anything", npz.contents),
    **{
        ending: _Format(
            form.least_dimension,
            3,
            _ANY if form.point_data else 3,
            {1: _CELLULAR, 2: "surfaces and solids", 3: "solids"}[form.least_dimension],
            meshio=form,
        )
        for ending, form in meshio_formats.FORMATS.items()
    },
}
