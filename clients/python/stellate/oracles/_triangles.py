"""Surfaces given as meshes of triangles, to be meshed again."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from typing import Any

import numpy as np

from .._point_sets import as_points
from .._rows import Array, norms
from ..errors import InvalidArgument
from ._cloud import PointCloud

_MOST_POINTS = 5_000_000
# For meshio to begin on a busy machine, and to read: ten times what its slowest formats take.
_SECONDS, _SECONDS_A_MB = 20, 20
_SHARP = (
    60.0  # degrees between neighbouring triangles, more than coarse ones of smooth surfaces have
)
_CAD = (".step", ".stp", ".iges", ".igs", ".brep")


class TriangleMesh(PointCloud):
    """An oracle for the smooth surface in R^3 near a closed mesh of triangles.

    Args:
      source: a file that meshio reads (.obj, .stl, .ply, .off, .vtu, ...), or the points (n, 3); or
        anything with `points` and `simplices`, such as a stellate.Mesh.
      triangles: (m, 3) numbers of points, where points are given.
      spacing: triangles with longer edges are filled with points of this spacing; by default the
        median of the edges' lengths.
      bandwidth: how far creases are rounded; by default 3 spacings.

    It is a PointCloud through the vertices, and through the middle of triangles that are large: nearer
    to the surface that was triangulated than the triangles are, where it is smooth. `residual` tells
    how far the points lie from it. Edges and corners that are meant are rounded. Needs scipy.
    """

    def __init__(
        self,
        source: Any,
        triangles: Any = None,
        *,
        spacing: float | None = None,
        bandwidth: float | None = None,
    ) -> None:
        points, triangles = _read(source, triangles)
        points, triangles = _merged(as_points(points, "points"), np.asarray(triangles))
        if points.shape[1] != 3:
            raise InvalidArgument(f"triangles have to be in R^3, and are in R^{points.shape[1]}")
        _insist_on_closed(points, triangles)
        corners = points[triangles]
        edges = norms(corners - np.roll(corners, 1, axis=1))
        if spacing is None:
            spacing = float(np.median(edges))
        if not (np.isfinite(spacing) and spacing > 0):
            raise InvalidArgument(f"spacing has to be positive, and is {spacing!r}")
        samples = [points[np.unique(triangles)], *_filling(corners, edges.max(axis=1), spacing)]
        # An edge's points are those of both of its triangles, up to rounding.
        rounded = np.round(np.concatenate(samples) / (1e-6 * spacing))
        _, first = np.unique(rounded, axis=0, return_index=True)
        super().__init__(
            np.concatenate(samples)[np.sort(first)],
            2,
            bandwidth=3 * spacing if bandwidth is None else bandwidth,
        )
        self._sharp = _sharp_edges(points, triangles)

    @property
    def about(self) -> str:
        """What it was fitted with, and the creases that are rounded, for the mesh's verdict."""
        if not self._sharp:
            return super().about
        return (
            f"{super().about}, where {self._sharp:,} edges bend by more than {_SHARP:g} degrees: creases, which are "
            "rounded within the bandwidth, and no epsilon keeps them. A part is composed by solids in place of that"
        )


def _filling(corners: Array, longest: Array, spacing: float) -> list[Array]:
    """Points in triangles whose edges are longer, on a grid of about the spacing."""
    pieces = np.ceil(longest / (1.5 * spacing)).astype(int)
    if (0.5 * pieces.astype(float) ** 2).sum() > _MOST_POINTS:
        raise InvalidArgument(
            f"a spacing of {spacing:g} makes more than {_MOST_POINTS:,} points: a larger one?"
        )
    found = []
    for count in np.unique(pieces[pieces > 1]):
        i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1), indexing="ij")
        shares = np.stack([count - i - j, i, j], axis=-1)[(i + j <= count)] / count
        mine = corners[pieces == count]
        found.append((shares[None, :, :, None] * mine[:, None, :, :]).sum(axis=2).reshape(-1, 3))
    return found


def _read(source: Any, triangles: Any) -> tuple[Any, Any]:
    if triangles is not None:
        return source, triangles
    if hasattr(source, "points") and hasattr(source, "simplices"):
        return source.points, source.simplices
    if not isinstance(source, (str, os.PathLike)):
        raise InvalidArgument("TriangleMesh takes a file, points with triangles, or a mesh")
    return _read_file(os.fspath(source))


def _read_file(path: str) -> tuple[Any, Any]:
    begin = f"{path!r} cannot be read as a mesh: "
    if not os.path.isfile(path):  # a device or a pipe may have no end
        raise InvalidArgument(begin + "it is not there, or no file")
    ending = os.path.splitext(path)[1].lower()
    if ending in _CAD:
        raise InvalidArgument(
            begin + f"{ending} holds exact faces (CAD), and no triangles. Write .stl or .obj, with "
            "triangles smaller than epsilon, in the program that it is from, or by gmsh: "
            "gmsh PART -2 -clmax EPSILON -o part.stl"
        )
    seconds = _SECONDS + _SECONDS_A_MB * os.path.getsize(path) / 1e6
    reader = os.path.join(os.path.dirname(__file__), "_read_file.py")
    try:
        run = subprocess.run(
            [sys.executable, reader, os.path.abspath(path)],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=seconds,
            env={
                **os.environ,
                "PYTHONPATH": os.pathsep.join(sys.path),
                "OPENBLAS_NUM_THREADS": "1",
            },
        )
    except subprocess.TimeoutExpired:
        raise InvalidArgument(
            begin + f"meshio was not done after {seconds:.0f} s: is it damaged?"
        ) from None
    if run.returncode != 0 and b"Could not deduce file format" in run.stderr:
        raise InvalidArgument(
            begin
            + f"no format that meshio knows has the ending {ending!r}. Write one that it does: "
            ".stl, .obj, .ply, .off, .msh, .vtu"
        )
    if run.returncode != 0:
        said = run.stderr.decode(errors="replace").split("\n")
        said = [line for line in said if line.strip()][-3:]
        raise InvalidArgument(begin + ("; ".join(said) or "meshio broke down") + ": is it damaged?")
    with np.load(io.BytesIO(run.stdout), allow_pickle=False) as read:
        if not read["triangles"].size:
            kinds = ", ".join(read["kinds"]) or "nothing"
            raise InvalidArgument(f"{path!r} has no triangles, but {kinds}")
        return read["points"], read["triangles"]


def _merged(points: Array, triangles: Any) -> tuple[Array, Any]:
    """Equal points made one, as .stl files have a point for each corner of each triangle."""
    if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.dtype.kind not in "iu":
        raise InvalidArgument(f"triangles have to be whole numbers (m, 3): {triangles.shape}")
    if not triangles.size or triangles.min() < 0 or triangles.max() >= len(points):
        raise InvalidArgument(f"triangles have to name points from 0 to {len(points) - 1}")
    unique, names = np.unique(points, axis=0, return_inverse=True)
    return unique, names.reshape(-1)[triangles]


def _sharp_edges(points: Array, triangles: Any) -> int:
    """How many edges of a closed mesh have triangles that bend sharply there, whichever way round they are."""
    a, b, c = (points[triangles[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(norms(normals), 1e-300)[:, None]
    directed = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    ups = directed[:, 0] < directed[:, 1]
    edges = np.sort(directed, axis=1)
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    one, other = order[0::2], order[1::2]  # of each edge its two triangles
    turned = np.where(ups[one] != ups[other], 1.0, -1.0)
    cosines = turned * (normals[one // 3] * normals[other // 3]).sum(axis=1)
    return int(np.count_nonzero(cosines < np.cos(np.radians(_SHARP))))


def _insist_on_closed(points: Array, triangles: Any) -> None:
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    distinct, counts = np.unique(edges, axis=0, return_counts=True)
    if (counts == 2).all():
        return
    middle = points[distinct[np.flatnonzero(counts != 2)[0]]].mean(axis=0)
    raise InvalidArgument(
        f"the surface is not closed: {np.count_nonzero(counts == 1)} edges have one triangle, "
        f"{np.count_nonzero(counts > 2)} more than two, as near {middle.tolist()}. Fill its holes and "
        "remove what hangs from it, in a program that repairs meshes; of a surface that is meant to have "
        "an end, PointCloud of its vertices is cut by walls"
    )
