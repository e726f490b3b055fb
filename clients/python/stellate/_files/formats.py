"""Writing meshes to files."""

from __future__ import annotations

import contextlib
import dataclasses
import enum
import importlib.util
import os
from collections.abc import Iterable, Iterator
from typing import BinaryIO, Callable

import numpy as np

from .._complex import Complex
from ..errors import SaveError
from . import glb, layouts, meshio_formats, nastran, npz, su2, three_mf
from .groups import Group, groups
from .ply import PlyWriter
from .spool import Spool
from .surface import boundary, drawn
from .vtu import VtuWriter
from .writing import (
    Cells,
    MeshWriter,
    PointWalls,
    Shape,
    TextLayout,
    TextWriter,
    is_special,
    replaced,
)

_ANY = 1 << 30
_DEBIAN = {"meshio": "python3-meshio", "h5py": "python3-h5py", "netCDF4": "python3-netcdf4"}


def check_save(path: str | os.PathLike[str], dimension: int, ambient_dimension: int) -> None:
    """What Mesh.save would refuse of any k-mesh in R^d, asked before there is a mesh to lose.

    Raises: SaveError when the format that the ending says cannot hold such a mesh, or wants a
      package that is not installed; OSError when the folder is not there or cannot be written to.
    """
    path = os.fspath(path)
    if os.path.isdir(path):
        raise IsADirectoryError(f"{path} is a folder: give a file's name")
    _choose(path, dimension, ambient_dimension)
    place = path if is_special(path) else os.path.dirname(os.path.realpath(path))
    if not os.path.exists(place):
        raise FileNotFoundError(f"cannot write {path}: there is no folder {place}")
    if not os.access(place, os.W_OK):
        raise PermissionError(f"cannot write {path}: {place} cannot be written to")


def save(mesh: Complex, path: str) -> None:
    """Mesh.save."""
    form = _choose(path, mesh.dimension, mesh.ambient_dimension)
    beside = stale = None
    with contextlib.ExitStack() as stack:
        if form.meshio is not None and form.meshio.facets and not is_special(path):
            root, ending = os.path.splitext(path)
            facets = f"{root}_facets{ending}"
            if mesh.faces(mesh.dimension - 1):
                beside = stack.enter_context(replaced(facets))
            elif meshio_formats.are_facets(facets):
                stale = facets
        draft = stack.enter_context(replaced(path))
        if form.meshio is not None:
            meshio_formats.write(form.meshio, mesh, cells(mesh), draft, beside)
        else:
            form.write(mesh, draft)
    if stale is not None:  # of the mesh that was there
        os.unlink(stale)


def save_txt(mesh: Complex, path: str) -> None:
    """The .txt format, whatever the path ends in."""
    with replaced(path) as draft:
        _FORMATS[".txt"].write(mesh, draft)


def can_stream(path: str, k: int, d: int, has_walls: bool, is_boundary: bool = False) -> bool:
    """Whether a mesh of these dimensions can be written to the path as it comes, held nowhere.

    Not what a format draws of a solid, .stl and others that are written whole, what meshio writes, a
    boundary alone where it is grouped by walls, and pipes, which cannot be taken back.
    """
    form = _choose(path, k, d)
    if not form.streams or is_special(path):
        return False
    if form.holds is Holds.ROWS:
        return True
    if form.holds is Holds.DRAWN:
        return k < 3  # else it is drawn
    if has_walls:
        return not is_boundary
    return k < 3 or form.holds is Holds.GROUPS


def needs_groups(path: str, k: int, d: int, has_walls: bool) -> bool:
    """Of a path that can_stream: whether save_spooled writes it, and no streamed_file."""
    return has_walls and _choose(path, k, d).holds in (Holds.POLYGONS, Holds.GROUPS)


@dataclasses.dataclass(frozen=True)
class StreamedFile:
    """A file that can_stream takes, on its way; `is_turned`: cells are to be turned to agree."""

    writer: MeshWriter
    is_turned: bool


@contextlib.contextmanager
def streamed_file(path: str, shape: Shape) -> Iterator[StreamedFile]:
    """A file of one group, which is put in its place if all goes well."""
    form = _choose(path, shape.dimension, shape.ambient_dimension)
    with replaced(path) as draft, open(draft, "wb") as file:
        writer = form.writer(file, shape)
        yield StreamedFile(writer, form.holds is not Holds.ROWS)
        writer.finish()


def save_spooled(path: str, spool: Spool, shape: Shape) -> bool:
    """Writes what a spool has to a path that needs_groups; `shape`: without groups. False, and no file:
    the mesh has to be written whole."""
    k = shape.dimension
    form = _choose(path, k, shape.ambient_dimension)
    every = form.grouped(spool.groups(), k)
    if every is None:
        return False

    def cells(of: list[Group]) -> Iterator[tuple[int, np.ndarray]]:
        for number, group in enumerate(of):
            if group.dimension < k:
                yield number, group.simplices
            else:
                yield from ((number, rows) for rows in spool.cells(group.label))

    counts = [spool.count(it.label) if it.dimension == k else len(it.simplices) for it in every]
    shape = dataclasses.replace(
        shape,
        groups=tuple(map(_cells_of, every, counts)),
        walls=spool.walls,
        has_labels=spool.has_labels,
    )
    with replaced(path) as draft, open(draft, "wb") as file:
        form.fill(file, shape, spool.points(), cells(every))
    return True


def _cells_of(group: Group, count: int) -> Cells:
    return Cells(
        group.dimension, count, group.tag, group.name, group.bits, group.label, group.sides
    )


class Holds(enum.Enum):
    """What a format holds of a mesh."""

    ROWS = "the simplices as they are"
    DRAWN = "turned to agree; of a solid its surface"
    POLYGONS = "turned to agree, group by group; of a solid its boundary"
    GROUPS = "turned to agree, group by group"


@dataclasses.dataclass(frozen=True)
class _Format:
    """What a file format can hold, and who writes it: we, by a layout of text, as .vtu or .ply or whole,
    or meshio."""

    least_dimension: int
    largest_dimension: int
    largest_ambient_dimension: int
    words: str
    holds: Holds = Holds.GROUPS
    layout: Callable[[Shape], TextLayout] | None = None
    is_vtu: bool = False
    is_ply: bool = False
    contents: Callable[[Complex], bytes] | None = None
    meshio: meshio_formats.MeshioFormat | None = None
    surface_of_solids: bool = False  # in space, besides what it holds
    fills_space: bool = False  # k = d alone

    def takes(self, k: int, d: int) -> bool:
        if self.fills_space and k != d:
            return False
        return (self.surface_of_solids and k == d == 3) or (
            self.least_dimension <= k <= self.largest_dimension
            and d <= self.largest_ambient_dimension
        )

    @property
    def streams(self) -> bool:
        """Whether points and cells of one group are written in the order in which they come."""
        return self.is_vtu or self.is_ply or self.layout is not None

    def writer(self, file: BinaryIO, shape: Shape) -> MeshWriter:
        if self.layout is not None:
            return TextWriter(file, self.layout(shape))
        if self.is_ply:
            return PlyWriter(file, shape)
        return VtuWriter(file, shape)

    def fill(
        self,
        file: BinaryIO,
        shape: Shape,
        points: Iterable[np.ndarray],
        cells: Iterable[tuple[int, np.ndarray]],
    ) -> None:
        """`cells`: with the number of their group, from zero."""
        writer = self.writer(file, shape)
        for block in points:
            writer.add_points(block)
        for number, rows in cells:
            writer.add_cells(number, rows)
        writer.finish()

    def write(self, mesh: Complex, path: str) -> None:
        if self.contents is not None:
            contents = self.contents(mesh)  # whole before the file is touched
            with open(path, "wb") as file:
                file.write(contents)
            return
        points, every = self._contents(mesh)
        shape = Shape(
            mesh.dimension,
            mesh.ambient_dimension,
            len(points),
            tuple(_cells_of(it, len(it.simplices)) for it in every),
            mesh.report,
            None if mesh.walls is None else PointWalls.of(mesh.walls),
            mesh.labels is not None,
        )
        with open(path, "wb") as file:
            self.fill(file, shape, [points], ((i, it.simplices) for i, it in enumerate(every)))

    def _contents(self, mesh: Complex) -> tuple[np.ndarray, list[Group]]:
        """The points and the cells that it holds."""
        if self.holds is Holds.ROWS:
            return mesh.points, [Group(1, "", (), mesh.simplices)]
        rows = cells(mesh)
        if self.holds is Holds.DRAWN:
            points = mesh.points
            if mesh.dimension == 3:
                points, rows = drawn(mesh, rows)
            return points, [Group(1, "", (), rows)]
        every = self.grouped(groups(mesh, rows), mesh.dimension)
        if every is None:
            every = [Group(1, "", (), boundary(rows))]
        return mesh.points, every

    def grouped(self, every: list[Group], k: int) -> list[Group] | None:
        """Those of all groups that it holds; None where it is not known on what walls a solid ends, and it
        holds the boundary alone."""
        if self.holds is Holds.GROUPS:
            return every
        if len(every) == 1:
            return None if k == 3 else [dataclasses.replace(every[0], name="")]
        return [group for group in every if group.dimension < 3]


def _choose(path: str, k: int, d: int) -> _Format:
    """The format of a path. Raises SaveError if it is not one for k-simplices in R^d."""
    ending = os.path.splitext(path)[1].lower()
    known = " ".join(name for name, form in _FORMATS.items() if form.takes(k, d))
    form = _FORMATS.get(ending)
    if form is None:
        pieces = "; .pvtu is written by stellate-mpi, a piece a rank" if ending == ".pvtu" else ""
        raise SaveError(
            f"no format is known by the ending {ending!r} of {path}; known for this mesh: {known}{pieces}"
        )
    if not form.takes(k, d):
        fits = form.least_dimension <= k <= form.largest_dimension and not form.fills_space
        raise SaveError(
            f"{ending} holds {'points of space' if fits else form.words}, and {path} would get a "
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


def cells(mesh: Complex) -> np.ndarray:
    """The simplices, turned to agree where that can be."""
    oriented = mesh.oriented_simplices()
    return mesh.simplices if oriented is None else oriented


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


def _three_mf(mesh: Complex) -> bytes:
    return three_mf.contents(mesh, cells(mesh))


def _glb(mesh: Complex) -> bytes:
    return glb.contents(mesh, cells(mesh))


def _nastran(mesh: Complex) -> bytes:
    return nastran.contents(mesh, cells(mesh))


def _su2(mesh: Complex) -> bytes:
    return su2.contents(mesh, cells(mesh))


_LOW = "curves and surfaces"
_SOLIDS = "and the surfaces of solids in space"
_CELLULAR = "simplices of dimension 3 at most"

_FORMATS = {
    ".txt": _Format(0, _ANY, _ANY, "anything", Holds.ROWS, layouts.txt),
    ".off": _Format(
        1, 2, _ANY, f"{_LOW}, {_SOLIDS}", Holds.DRAWN, layouts.off, surface_of_solids=True
    ),
    ".obj": _Format(
        1, 2, 3, f"{_LOW}, {_SOLIDS}", Holds.POLYGONS, layouts.obj, surface_of_solids=True
    ),
    ".ply": _Format(
        1, 2, 3, f"{_LOW}, {_SOLIDS}", Holds.DRAWN, is_ply=True, surface_of_solids=True
    ),
    ".stl": _Format(2, 2, 3, f"surfaces, {_SOLIDS}", contents=_stl, surface_of_solids=True),
    ".3mf": _Format(2, 2, 3, f"surfaces, {_SOLIDS}", contents=_three_mf, surface_of_solids=True),
    ".glb": _Format(2, 2, 3, f"surfaces, {_SOLIDS}", contents=_glb, surface_of_solids=True),
    ".msh": _Format(1, 3, 3, _CELLULAR, layout=layouts.msh),
    ".vtu": _Format(1, 3, _ANY, _CELLULAR, is_vtu=True),
    ".npz": _Format(0, _ANY, _ANY, "anything", contents=npz.contents),
    **{
        ending: _Format(1, 3, 3, _CELLULAR, contents=_nastran)
        for ending in (".bdf", ".fem", ".nas")
    },
    ".su2": _Format(
        2, 3, 3, "domains of the plane and solids of space", contents=_su2, fills_space=True
    ),
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
