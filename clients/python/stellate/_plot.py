"""Pictures of meshes, by matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ._complex import Complex
from ._slice import as_normal, cut
from .errors import InvalidArgument

_PLAIN = "#6f9fc8"
_SIZE_INCHES = 4.8
_LIGHT = np.array([0.35, -0.45, 0.82]) / np.linalg.norm([0.35, -0.45, 0.82])
_MOST_TICKS = 9  # of the longest axis, as matplotlib has it
_FEW_TRIANGLES = 3000  # whose edges can be seen


def plot(
    mesh: Complex,
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
    """Mesh.plot."""
    pyplot = _pyplot()
    n, d = mesh.points.shape
    shade, label, plain = _colors(color, n, d, mesh.points)
    everything = np.column_stack([mesh.points, shade])  # cut along with the points
    cuts = _median_cuts(mesh) if slices is None else list(slices)
    cells = mesh.simplices
    for normal, level in cuts:
        if cells.shape[1] < 2:
            raise InvalidArgument("nothing is left to slice: the last slice left points")
        heights = everything[:, :d] @ as_normal(normal, d) - level
        everything, cells = cut(everything, cells, heights)
    if not len(cells):
        raise InvalidArgument(f"the mesh does not meet the slice: {cuts}")
    if cells.shape[1] > 3:
        raise InvalidArgument(
            f"what the slices leave is of dimension {cells.shape[1] - 1}; a picture shows 2 at most"
        )
    projection, names = _projection(coordinates, d, [normal for normal, _ in cuts])
    if plain is None and color is None:  # the first coordinate that is not to be seen otherwise
        hidden = [i for i in range(d) if names is None or f"x{i + 1}" not in names]
        hidden = [i for i in hidden if i not in [normal for normal, _ in cuts if _is_axis(normal)]]
        if names is None or not hidden:
            plain = _PLAIN
        else:
            everything[:, d], label = everything[:, hidden[0]], f"x{hidden[0] + 1}"
    flat = everything[:, :d] @ projection.T
    if ax is None:
        figure = pyplot.figure(figsize=(_SIZE_INCHES, _SIZE_INCHES), layout="constrained")
        ax = figure.add_subplot(projection="3d" if flat.shape[1] == 3 else None)
    values = None if plain is not None else everything[:, d]
    edges = (len(cells) <= _FEW_TRIANGLES) if edges is None else edges
    artist = _draw(ax, flat, cells, values, plain or _PLAIN, colormap, edges, alpha)
    _dress(ax, flat, names, view, frame)
    if values is not None and label and frame:
        ax.figure.colorbar(artist, ax=ax, label=label, shrink=0.5)
    return ax


def _pyplot() -> Any:
    try:
        import matplotlib.pyplot as pyplot
    except ImportError:
        raise ImportError(
            "mesh.plot() draws with matplotlib, which is not installed: "
            "apt-get install python3-matplotlib, or pip install matplotlib"
        ) from None
    return pyplot


def _is_axis(normal: Any) -> bool:
    return isinstance(normal, (int, np.integer))


def _median_cuts(mesh: Complex) -> list[tuple[int, float]]:
    """Through the middle of the last coordinates, as many as leave a surface."""
    count = max(0, mesh.dimension - 2)
    axes = range(mesh.ambient_dimension - 1, mesh.ambient_dimension - 1 - count, -1)
    return [(axis, float(np.median(mesh.points[:, axis]))) for axis in axes]


def _colors(
    color: Any, n: int, d: int, points: np.ndarray
) -> tuple[np.ndarray, str | None, str | None]:
    """A number for each vertex, what it is called, and the colour that is one for all."""
    nothing = np.zeros(n)
    if color is None:
        return nothing, None, _PLAIN if d <= 3 else None
    if isinstance(color, str):
        return nothing, None, color
    if _is_axis(color):
        return points @ as_normal(color, d), f"x{color + 1}", None
    values = np.asarray(color, dtype=float)
    if values.shape != (n,) or not np.isfinite(values).all():
        raise InvalidArgument(
            f"color is a name, the number of a coordinate, or a finite number for each of the {n} "
            f"points; it has shape {values.shape}"
        )
    return values, "", None


def _projection(
    coordinates: Any, d: int, cut_normals: list[Any]
) -> tuple[np.ndarray, list[str] | None]:
    """The matrix (2 or 3, d) of what is shown, and the names of its rows, where they are axes."""
    if coordinates is None:
        # Seen along a cut, a slice is a flat smear.
        free = [i for i in range(d) if not any(_is_axis(c) and c == i for c in cut_normals)]
        coordinates = (free if len(free) >= 2 else list(range(d)))[:3]
    matrix = np.asarray(coordinates)
    if matrix.ndim == 1 and matrix.dtype.kind in "iu" and len(matrix) in (2, 3):
        rows = [as_normal(int(axis), d) for axis in matrix]
        return np.stack(rows), [f"x{axis + 1}" for axis in matrix]
    if matrix.ndim == 2 and matrix.shape[0] in (2, 3) and matrix.shape[1] == d:
        return np.asarray(matrix, dtype=float), None
    raise InvalidArgument(
        f"coordinates are the numbers of two or three axes, from 0 on, or a matrix (2 or 3, {d}); "
        f"they are {coordinates!r}"
    )


def _draw(
    ax: Any,
    points: np.ndarray,
    cells: np.ndarray,
    values: np.ndarray | None,
    plain: str,
    colormap: str,
    edges: bool,
    alpha: float,
) -> Any:
    """Adds points, lines or triangles. Returns what a colour bar can be made of."""
    import matplotlib as mpl

    norm = scale = None
    if values is not None:
        norm = mpl.colors.Normalize(values.min(), values.max())
        scale = mpl.cm.ScalarMappable(norm, colormap)
        colors = scale.to_rgba(values[cells].mean(axis=1))
    else:
        colors = np.tile(mpl.colors.to_rgba(plain), (len(cells), 1))
    colors[:, 3] *= alpha
    corners = points[cells]
    if cells.shape[1] == 1:
        ax.scatter(*corners[:, 0].T, c=colors, s=6)
        return scale
    if cells.shape[1] == 3 and points.shape[1] == 3:
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.linalg.norm(normals, axis=1)
        light = np.abs(normals @ _LIGHT) / np.where(lengths > 0, lengths, 1)
        colors[:, :3] *= (0.45 + 0.55 * light)[:, None]
    from matplotlib import collections
    from mpl_toolkits.mplot3d import art3d

    if cells.shape[1] == 2:
        kind = art3d.Line3DCollection if points.shape[1] == 3 else collections.LineCollection
        drawn = kind(corners, colors=colors, linewidths=1.8)
    else:
        kind = art3d.Poly3DCollection if points.shape[1] == 3 else collections.PolyCollection
        rims = colors * [0.55, 0.55, 0.55, 1.0] if edges else colors
        drawn = kind(corners, facecolors=colors, edgecolors=rims, linewidths=0.3)
    ax.add_collection(drawn)
    return scale


def _dress(
    ax: Any, points: np.ndarray, names: list[str] | None, view: tuple[float, float], frame: bool
) -> None:
    """Limits, equal scales, names of the axes."""
    lower, upper = points.min(axis=0), points.max(axis=0)
    extent = np.maximum(upper - lower, 1e-3 * max(float((upper - lower).max()), 1e-300))
    middle = (lower + upper) / 2
    axes = "xyz"[: points.shape[1]]
    for i, axis in enumerate(axes):
        half = 0.52 * extent[i]
        getattr(ax, f"set_{axis}lim")(middle[i] - half, middle[i] + half)
        if names is not None:
            getattr(ax, f"set_{axis}label")(names[i])
        if points.shape[1] == 3 and frame:  # as many numbers as have place beside each other
            most = max(1, round(_MOST_TICKS * extent[i] / max(extent)))
            ax.locator_params(axis=axis, nbins=most)
    if points.shape[1] == 3:
        ax.set_box_aspect(extent, zoom=0.9 if frame else 1.1)
        ax.view_init(*view)
    else:
        ax.set_aspect("equal")
    if not frame:
        ax.set_axis_off()
