"""A mesh, finished or growing."""

from __future__ import annotations

import dataclasses
import os
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _betti, _convert, _curvature, _faces, _html, _locate, _measures, _plot, _slice, viewer
from ._curvature import Curvature
from ._faces import Face
from ._files import formats
from ._files.orientation import exchanged, oriented
from ._files.read_txt import read_txt
from ._locate import Located
from ._measures import Minkowski
from ._wire.orientation import Orientation
from .errors import InvalidArgument, UncertifiedWarning
from .report import Progress, Report

if TYPE_CHECKING:
    from .oracles import PeriodicMesh


# What others call the parts of a mesh.
_CALLED_HERE = {
    **dict.fromkeys(("vertices", "verts", "nodes", "coordinates", "vectors"), "points"),
    **dict.fromkeys(("triangles", "tetrahedra", "cells", "elements", "connectivity"), "simplices"),
    **dict.fromkeys(("n_points", "n_vertices"), "len(mesh.points)"),
    **dict.fromkeys(("n_cells", "n_faces"), "len(mesh.simplices)"),
    **dict.fromkeys(("write", "export", "to_stl"), "save(path)"),
    "is_watertight": "certified",
    "euler_number": "euler",
}


@dataclasses.dataclass(frozen=True, eq=False)
class Mesh:
    """A simplicial k-complex in R^d.

    Attributes:
      points: (n, d) float64, the sample points.
      simplices: (m, k+1) int64, zero-based ids of points, ascending in each row, rows in
        lexicographic order.
      report: how it ended and what is proved. Only a FinishedMesh has to have one: None while the mesh
        grows, and of slices and files.
      progress: how it stood at this revision; None if that is not known.
      revision: one for each round that changed the mesh.
      walls: of a manifold with boundary, (n,) uint64: the walls that each point lies on, wall i as
        bit i; else None.
      orientation: how the simplices are oriented, as the server says of a mesh that is over; else None.
      labels: of an arrangement of walls, (m,) int8: the region that each simplex is in; else None.
        Of the boundary alone (boundary_only=True), (m, 2): the labels that the normal of each row's own
        order points away from and into, 0 being outside; a solid without labels has the label 1.
      places: of a finished reconstruction, (n,) str: what became of each point, "OK", "MERGED", ... (see
        stellate.reconstruct); else None.
      region_names: the names of the labels 1, 2, ..., as the oracle gave them; "" where there is none.
      smoothed: of a reconstruction from noisy points, (n, d): the positions that the complex was built on
        and that its certificate is about; None where they are the points.
      name: by which it is on its server still, "meshes/...", where it was asked to stay
        (`stellate.mesh(..., keep_on_server=True)`); else "".
      coordinate_names: d, as the oracle or the table of the points had them; () where there are none.
      scale: of a mesh made with `scale`, d: `points` are in x, and what was meshed is x / scale, whose
        lengths and angles the report says; else ().
    """

    points: np.ndarray
    simplices: np.ndarray
    report: Report | None = None
    progress: Progress | None = None
    revision: int = 0
    walls: np.ndarray | None = None
    orientation: Orientation | None = dataclasses.field(default=None, repr=False)
    labels: np.ndarray | None = None
    places: np.ndarray | None = None
    smoothed: np.ndarray | None = None
    region_names: tuple[str, ...] = ()
    name: str = ""
    coordinate_names: tuple[str, ...] = ()
    scale: tuple[float, ...] = ()

    if not TYPE_CHECKING:  # which is to find misspelt names

        def __getattr__(self, name: str) -> Any:
            here = _CALLED_HERE.get(name)
            hint = "" if here is None else f": here it is `{here}`"
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}{hint}")

    def region(self, label: int | str) -> Mesh:
        """The part with one label, or with that name, of the same points. Its boundary is where it ends
        or meets others.

        Of the boundary alone: the closed surface of that region, its normals outwards.
        """
        if isinstance(label, str):
            if not label or self.region_names.count(label) != 1:
                known = list(self.region_names)
                raise ValueError(f"the mesh has no one region named {label!r}; names: {known}")
            label = self.region_names.index(label) + 1
        if self.labels is None:
            raise ValueError(f"the mesh is all one, without regions, and has no region {label!r}")
        if label == 0 or not (self.labels == label).any():
            have = np.unique(self.labels[self.labels > 0]).tolist()
            raise ValueError(f"the mesh has no region {label!r}; it has {have}")
        if self.is_boundary:
            on = (self.labels == label).any(axis=1)
            sides = self.labels[on]
            alone = np.where(sides == label, sides, 0)  # what else is there is outside of it
            rows, revision = self.simplices[on], self.revision
            part = Mesh(self.points, rows, None, None, revision, self.walls, labels=alone)
        else:
            rows = self.simplices[self.labels == label]
            part = Mesh(self.points, rows, None, None, self.revision, self.walls)
        return dataclasses.replace(part, coordinate_names=self.coordinate_names, scale=self.scale)

    @property
    def is_boundary(self) -> bool:
        """Whether this is a boundary without its inside: stellate.mesh(..., boundary_only=True)."""
        return self.labels is not None and self.labels.ndim == 2

    @property
    def boundary(self) -> tuple[Face, ...]:
        """The boundary's parts, one for each wall: simplices of dimension k - 1. Of the boundary alone
        all of it, wall by wall, what is between regions too. A simplex whose vertices all lie on an edge,
        as in a hole that epsilon is as large as, is in a part of the edge's walls."""
        if self.is_boundary:
            return self.faces(self.dimension)
        return _faces.faces(self.simplices, self.walls, self.dimension - 1)

    @property
    def edges(self) -> tuple[Face, ...]:
        """Where two walls meet or more, the curves of them."""
        return tuple(face for face in self.faces(1) if len(face.walls) > 1)

    @property
    def corners(self) -> tuple[Face, ...]:
        """Where as many walls meet as the mesh has dimensions, or more: points."""
        least = self.dimension + self.is_boundary
        return tuple(face for face in self.faces(0) if len(face.walls) >= least)

    def faces(self, dimension: int) -> tuple[Face, ...]:
        """The faces of a dimension below k, of a manifold with boundary, by ascending walls; those
        between regions, too. The boundary alone has faces of its own dimension as well."""
        if self.is_boundary:
            return _faces.creases(self.simplices, self.walls, dimension)
        return _faces.faces(self.simplices, self.walls, dimension, self.labels)

    @property
    def dimension(self) -> int:
        """k"""
        return self.simplices.shape[1] - 1

    @property
    def ambient_dimension(self) -> int:
        """d"""
        return self.points.shape[1]

    @property
    def certified(self) -> bool:
        """Whether the mesh is finished and proved good."""
        return self.report is not None and self.report.certified

    def oriented_simplices(self) -> np.ndarray | None:
        """The simplices with vertices exchanged so that neighbours agree; None if not orientable.

        A hypersurface (k = d - 1) gets its normals outwards, component by component; simplices that
        fill space (k = d) positive volumes. The boundary alone of a solid has its normals from the larger
        of its two labels into the smaller one: outwards. The server says so of a mesh that is over;
        others are oriented here.
        """
        if self.orientation is not None:
            if not self.orientation.orientable:
                return None
            rows = np.flatnonzero(self.orientation.flags(len(self.simplices)))
            return exchanged(self.simplices, rows)
        sides = self.labels
        if sides is not None and self.is_boundary and self.dimension == self.ambient_dimension - 1:
            return exchanged(self.simplices, np.flatnonzero(sides[:, 0] < sides[:, 1]))
        return oriented(self.points, self.simplices)

    # What is measured. Vertices lie on M: volumes are right to O(epsilon^2).

    @property
    def volume(self) -> float:
        """The k-volume: the length of a curve, the area of a surface; of a region its own.

        Its error is O(epsilon^2).
        """
        return float(_measures.volumes(self.points, self.simplices).sum())

    @property
    def area(self) -> float:
        """Of a surface, to O(epsilon^2); of a mesh of tetrahedra that of its boundary.

        Raises: InvalidArgument for meshes of other dimensions, which have a `volume`.
        """
        if self.dimension == 2:
            return self.volume
        if self.dimension == 3:
            return self.boundary_mesh().volume
        raise InvalidArgument(f"a mesh of dimension {self.dimension} has a volume, and no area")

    @property
    def enclosed_volume(self) -> float:
        """What a closed hypersurface (k = d - 1) encloses, to O(epsilon^2).

        Components count by their orientation: those of a mesh that the server made outwards, each by
        itself; of a boundary_mesh() around a cavity inwards, so that it is the solid's volume.

        Raises: InvalidArgument where there is a boundary, or no orientation.
        """
        return _measures.enclosed_volume(self)

    @property
    def euler(self) -> int:
        """The Euler characteristic, counted from the simplices and their faces."""
        return _measures.euler(self.simplices)

    def normals(self) -> np.ndarray:
        """(m, d): the unit normals of a hypersurface's simplices, which agree with each other.

        Outwards where it is closed. Each is within O(epsilon) of M's at the simplex.

        Raises: InvalidArgument in other codimensions, and where it is not orientable.
        """
        return _measures.normals(self)

    def point_volumes(self) -> np.ndarray:
        """(n,): how much of the volume goes with each point.

        The integral of a smooth function is `values @ mesh.point_volumes()`, to O(epsilon^2).
        """
        return _measures.point_volumes(self.points, self.simplices)

    def boundary_mesh(self) -> Mesh:
        """The facets in one simplex alone, a mesh of dimension k - 1 of the same points.

        Oriented as this mesh induces it: outwards, of simplices that fill space.
        """
        facets, orientation = _measures.boundary_of(self)
        return Mesh(self.points, facets, None, None, self.revision, self.walls, orientation)

    def curvature(self, oracle: Any = None) -> Curvature:
        """How the mesh bends at its points, in any codimension: of any k from 1 to d - 1.

        Args:
          oracle: what the mesh is of. With a `jacobian`, as ImplicitManifold and SignedDistance have
            one, curvatures are those of its equations, to about seven digits. Any other is asked for
            closest points at steps of a fiftieth of an edge, some 2 d + k (k + 1) for each point, whose
            second differences are right to a thousandth of (epsilon / reach)^2 if its answers are exact.
            None: a cubic is fitted to the points near by (needs scipy), right to O(epsilon^2) where M is
            smooth; to O(epsilon) where it ends. Across creases it means nothing.

        Returns: `second` (n, k, k, d), the second fundamental form; `mean_vector` (n, d), `mean` (n,) and
          `scalar` (n,); `gauss` (n,) of surfaces and hypersurfaces; `principal` (n, k) of hypersurfaces,
          by the mesh's normals.
        Raises: InvalidArgument.
        """
        return _curvature.curvature(self, oracle)

    def minkowski(self) -> Minkowski:
        """Of a solid of space, or of what a closed surface bounds: volume, area, the integral of the mean
        curvature, Euler characteristic; of a region of several materials region(label).minkowski().

        The first three to O(epsilon^2); the integral to O(epsilon) where edges are curved. Components of a
        surface count each as what it bounds by itself, as in `enclosed_volume`.

        Raises: InvalidArgument for others, and where the surface touches itself.
        """
        return _measures.minkowski(self)

    def betti(self, modulus: int = 2) -> tuple[int, ...]:
        """(k+1,): the numbers of components, tunnels, cavities, ... over the field of `modulus` elements.

        By GUDHI where there is one; else by elimination here, for at most 400,000 faces in all. Over
        Z/2 every manifold has a top class, over others an orientable one alone.

        Raises: InvalidArgument.
        """
        return _betti.betti(self, modulus)

    def laplacian(self) -> tuple[Any, Any]:
        """The stiffness and the lumped mass of linear finite elements, sparse (n, n); needs scipy.

            stiffness, mass = mesh.laplacian()  # of u: minus its Laplacian is mass^-1 stiffness u

        Of any dimension and codimension; its eigenvalues are M's to O(epsilon^2). Points in no simplex
        have empty rows.

        Raises: InvalidArgument where a simplex is flat, and without scipy.
        """
        return _locate.laplacian(self)

    def locate(self, points: Any) -> Located:
        """The nearest points of the mesh to (q, d) given ones; needs scipy.

        Returns: `simplices` (q,), `weights` (q, k+1), `points` (q, d), `distances` (q,). A function with
          `values` at the mesh's points has there
          `(found.weights * values[mesh.simplices[found.simplices]]).sum(axis=1)`.
        Raises: InvalidArgument.
        """
        return _locate.locate(self, points)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the mesh in the format that the file name's ending says.

        .txt  any k and d, exact: "k d nv ns", then nv lines of coordinates, then ns lines of ids.
        .off  any d (nOFF when d is not 3), k <= 2.
        .obj  curves and surfaces, d <= 3.
        .ply  curves and surfaces, d <= 3, binary, in double precision.
        .stl  surfaces of space, binary, in single precision as the format has it.
        .3mf  surfaces of space, for 3D printers, in millimetres: an object for each region.
        .glb  surfaces of space, for Blender and browsers: a node for each region, smooth normals and a
              material for each wall, in single precision, z upwards.
              Of a solid (k = d = 3) these six hold the surface, outwards, around a cavity into that.
        .npz  any k and d, exact, by numpy: arrays of the names that a Mesh has, and "certified",
              "verdict", "epsilon", for np.load.
        .msh  k <= 3, d <= 3: Gmsh's, version 2.2.
        .vtu  k <= 3. When d > 3 the points are the first three coordinates, and all of them are the
              point data "coordinates". Its field data are "epsilon", "certified" (0 or 1),
              "verdict" and "version" (UTF-8 bytes), and "groups": the groups' names, a line each.
        .nas, .bdf, .fem  k, d <= 3: Nastran bulk data, without faces; regions are properties.
        .su2  k = d, 2 or 3: SU2's, markers by the walls' names.
        .vtk, as .vtu, and .avs .cgns .dat .dato .e .exo .f3grid .h5m .hmf .inp .mdpa .med .mesh
        .meshb .post .tec .vol .xdmf .xmf .xml, d <= 3, by meshio. Of a mesh
        with boundary part.xdmf has a part_facets.xdmf beside it, as FEniCS reads them: cells with
        "region", facets with "wall", a wall's number plus 1; of two coordinates where d = 2.

        Of a mesh with boundary .msh, .vtu, .vtk and .obj have its faces too, of all dimensions, after
        its simplices: in .msh as physical groups, "inside", or where there are several regions by
        the region's name, "region_1" for label 1 if it has none, "wall_0", ..., "walls_0_1", ...; in
        .obj as groups of the same names; in .vtu and .vtk with the cell data "walls", the walls as
        bits (0 inside), and .vtu's "group", .msh's number of it. Points have "walls" too. Faces
        between regions are among them. With labels .vtu and .vtk have "region", a simplex's label, 0
        of faces, and "sides", of faces of dimension k - 1 the labels that they face away from and
        face, (0, 0) of others.

        Surfaces are written with their triangles turned to agree where they are orientable. A file
        that was there is replaced when the new one is whole.

        Raises: SaveError when the format cannot hold this mesh, OSError. What can be known before
          there is a mesh, stellate.check_save tells.
        Warns: UncertifiedWarning for a mesh whose report says that it is not certified.
        """
        if self.report is not None and not self.report.certified:
            warn_of_uncertified(os.fspath(path), self.report, stacklevel=3)
        formats.save(self, os.fspath(path))

    def slice(self, normal: Any, level: float = 0.0) -> Mesh:
        """Where the mesh meets the hyperplane {x : normal . x = level}: a (k-1)-complex in R^d.

        `normal` is a vector (d,) or the number of an axis, from 0 on. The slice of a closed mesh is
        closed. Vertices in the hyperplane itself count as above it; its simplices there are flat.
        """
        heights = self.points @ _slice.as_normal(normal, self.ambient_dimension) - level
        return Mesh(*_slice.cut(self.points, self.simplices, heights), scale=self.scale)

    def unwrap(self, cell: Any) -> PeriodicMesh:
        """A mesh on a periodic cell in plain coordinates, going on from cell to cell.

        Args:
          cell: the stellate.oracles.PeriodicCell that it is a mesh on.

        Raises: InvalidArgument for a mesh of something else, or one too coarse to tell how it goes on.
        """
        from .oracles._periodic_mesh import unwrapped  # which imports this module

        return unwrapped(self, cell)

    def plot(
        self,
        *,
        coordinates: Any = None,
        slices: Sequence[tuple[Any, float]] | None = None,
        color: Any = None,
        ax: Any = None,
        view: tuple[float, float] = (25.0, -60.0),
        edges: bool | None = None,
        frame: bool = True,
        colormap: str = "viridis",
        alpha: float = 1.0,
    ) -> Any:
        """A picture by matplotlib: mesh.plot().figure.savefig("mesh.png").

        Args:
          coordinates: what is shown: the numbers of two or three axes, from 0 on, or a matrix
            (2 or 3, d). By default the first three that are not sliced away.
          slices: (normal, level) pairs as slice() takes them, until a surface is left. By default a
            mesh of k > 2 is sliced by its last k - 2 coordinates, at their medians.
          color: a colour's name, the number of a coordinate, or a number for each point. By default
            a coordinate that is not shown, where there is one.
          ax: matplotlib's axes to draw into, 3-d if three coordinates are shown; new ones if None.
          view: elevation and azimuth in degrees.
          edges: whether triangles have dark edges; by default while they are few.
          frame: whether to show the axes and what the colours mean.

        Returns: the axes.
        Raises: ImportError without matplotlib, InvalidArgument.
        """
        return _plot.plot(self, coordinates, slices, color, ax, view, edges, frame, colormap, alpha)

    def show(
        self,
        path: str | os.PathLike[str] | None = None,
        *,
        label: str = "",
        height: int = 640,
    ) -> Any:
        """The mesh in a browser, to be turned, sliced and measured.

        stellate.viewer.LiveView shows one grow.

        Args:
          path: a file to write, which needs no network; by default a temporary one is opened in the
            browser, and in a notebook the mesh is shown there.
          label: its title.
          height: of a notebook's frame, in pixels.

        Raises: ViewerNotFound, OSError.
        """
        return viewer.show(self, path, label, height)

    def to_meshio(self) -> Any:
        """A meshio.Mesh, k from 1 to 3.

        As in .vtu files, points are the first three coordinates; when d > 3 all of them are the
        point data "coordinates". This and its likes raise ImportError where the library is not
        installed, InvalidArgument for meshes that it cannot hold.
        """
        return _convert.to_meshio(self, formats.cells(self))

    def to_pyvista(self) -> Any:
        """A pyvista.UnstructuredGrid, k from 1 to 3; coordinates as in to_meshio()."""
        return _convert.to_pyvista(self, formats.cells(self))

    def to_trimesh(self) -> Any:
        """A trimesh.Trimesh of a surface in R^3, its normals outwards where it is closed."""
        return _convert.to_trimesh(self, formats.cells(self))

    def to_open3d(self) -> Any:
        """An open3d.geometry.TriangleMesh of a surface, a LineSet of a curve; d <= 3."""
        return _convert.to_open3d(self, formats.cells(self))

    def to_pandas(self, names: Sequence[str] | None = None) -> Any:
        """A pandas.DataFrame of the points: a row for each, by its number, and a column for each coordinate.

        Its columns are called by `names`, d of them, else by `coordinate_names`, else x, y and z, or x0, x1,
        ... where d > 3.
        """
        return _convert.to_pandas(self, names)

    def simplex_tree(self) -> Any:
        """A gudhi.SimplexTree of the mesh, all of it at the filtration value 0.

            tree = mesh.simplex_tree()
            tree.compute_persistence(persistence_dim_max=True)
            print(tree.betti_numbers())

        Vertices are rows of `points`; points in no simplex are not in the tree.
        """
        return _convert.to_simplex_tree(self)

    def _repr_html_(self) -> str:
        rows = [
            ("dimension", f"{self.dimension} in R^{self.ambient_dimension}", ""),
            ("size", f"{len(self.points):,} points, {len(self.simplices):,} simplices", ""),
        ]
        if self.report is None:
            rows.append(
                ("certificate", "none: the mesh grows still, or its report is not here", "")
            )
        else:
            verdict = self.report.certificate.verdict or self.report.termination
            rows.append(("certificate", verdict, "good" if self.certified else "bad"))
        return _html.table("Stellate: mesh", rows)

    def __repr__(self) -> str:
        if self.report is None:
            state = "no report"
        elif self.report.certified:
            state = "CERTIFIED"
        else:
            state = f"NOT CERTIFIED ({self.report.termination})"
        return (
            f"<stellate.Mesh k={self.dimension} d={self.ambient_dimension} "
            f"{len(self.points)} points, {len(self.simplices)} simplices, {state}>"
        )


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class FinishedMesh(Mesh):
    """A mesh that has come to its end, certified or not: its `report` says which."""

    report: Report = dataclasses.field()


def warn_of_uncertified(path: str, report: Report, stacklevel: int) -> None:
    """Of a file that gets such a mesh."""
    warnings.warn(
        f"{path} gets a mesh that is NOT CERTIFIED: {report.what_failed}",
        UncertifiedWarning,
        stacklevel=stacklevel,
    )


def with_report(mesh: Mesh, report: Report | None) -> Mesh:
    """A FinishedMesh, or the mesh itself where there is no report."""
    if report is None:
        return mesh
    values: dict[str, Any] = {it.name: getattr(mesh, it.name) for it in dataclasses.fields(mesh)}
    values["report"] = report
    return FinishedMesh(**values)


def load_txt(path: str | os.PathLike[str]) -> Mesh:
    """Reads the .txt format back, to the last bit. Raises ValueError if it is something else."""
    return Mesh(*read_txt(os.fspath(path)))
