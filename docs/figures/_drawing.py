"""What the scripts of the figures share: colours, shaded triangles, where a picture goes.

A script draws one picture of its name beside it, `docs/figures/NAME.png`, or into the folder that its
command line names. `docs/figures/draw` runs all of them.
"""

from __future__ import annotations

import pathlib
import sys

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1] / "clients" / "python"))

BLUE, SAND, RED, GREEN, INK = "#1f6f8b", "#b8b0a2", "#c8553d", "#588157", "#123047"
plt.rcParams.update({"font.size": 9, "axes.titlesize": 9, "savefig.facecolor": "white"})


def save(figure: Figure, name: str, dpi: int = 90) -> None:
    """As NAME.png, of 160 colours: a figure is read, and a repository keeps it for ever."""
    from PIL import Image

    folder = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else HERE
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.png"
    figure.savefig(path, dpi=dpi, metadata={"Software": None})
    plt.close(figure)
    picture = Image.open(path).convert("RGB")
    picture.quantize(160, dither=Image.Dither.NONE).save(path, optimize=True)


def eye_of(axes: Axes3D) -> np.ndarray:
    """The unit vector towards whoever looks at it."""
    e, a = np.radians([axes.elev, axes.azim])
    return np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])


def shaded(
    axes: Axes3D,
    points: np.ndarray,
    triangles: np.ndarray,
    elevation: float = 38,
    azimuth: float = -60,
    colour: str = "#5ca8e5",
    marked: np.ndarray | None = None,
    size: float | None = None,
    lines: float = 0.3,
) -> None:
    """A closed surface, the far side left out; `marked` triangles (bool) in red.

    `size`: the half width of what is shown; the largest coordinate if none is given. `lines`: the
    width of the edges.
    """
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    axes.view_init(elevation, azimuth)
    light = np.array([0.35, -0.55, 0.76])
    shade = 0.35 + 0.65 * np.clip(normals @ light, 0, 1)
    base = np.tile(matplotlib.colors.to_rgb(colour), (len(triangles), 1))
    if marked is not None:
        base[marked] = matplotlib.colors.to_rgb(RED)
    front = normals @ eye_of(axes) > -0.15
    axes.add_collection3d(
        Poly3DCollection(
            corners[front],
            facecolors=(shade[:, None] * base)[front],
            edgecolors=INK,
            linewidths=lines,
        )
    )
    size = size or np.abs(points).max()
    axes.set(xlim=(-size, size), ylim=(-size, size), zlim=(-size, size))
    axes.set_box_aspect((1, 1, 1), zoom=1.7)
    axes.set_axis_off()
