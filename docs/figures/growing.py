"""A surface of genus two while it grows, as the revisions of `stellate.watch` show it: an animation."""

from __future__ import annotations

import pathlib
import sys

import _drawing as drawing
import matplotlib.pyplot as plt
import numpy as np
import stellate
from PIL import Image

SIZE = 1.7  # half of what is shown
FRAMES, LAST = 18, 14  # revisions, and for how many frames the end stays


def tube(x: np.ndarray) -> np.ndarray:
    """(n, 3) -> (n, 1): two tori, melted into one surface."""
    u, v, w = x.T
    left = (np.hypot(u + 0.75, v) - 0.6) ** 2 + w**2
    right = (np.hypot(u - 0.75, 0.7 * v) - 0.6) ** 2 + 2 * w**2
    return np.asarray((0.5 - np.exp(-12 * left) - np.exp(-12 * right))[:, None])


def slope(x: np.ndarray) -> np.ndarray:
    step = 1e-6 * np.eye(3)
    return np.stack([(tube(x + h) - tube(x - h))[:, 0] / 2e-6 for h in step], axis=1)


def outwards(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """The triangles, their normals outwards: no mesh is closed before its end."""
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inwards = np.einsum("nd,nd->n", normals, slope(corners.mean(axis=1))) < 0
    return np.where(inwards[:, None], triangles[:, ::-1], triangles)


def frame_of(mesh: stellate.Mesh) -> Image.Image:
    figure = plt.figure(figsize=(4.4, 2.65), dpi=90)
    axes = figure.add_axes((-0.1, -0.35, 1.2, 1.75), projection="3d", computed_zorder=False)
    if len(mesh.simplices) > 0:
        triangles = outwards(mesh.points, mesh.simplices)
        drawing.shaded(axes, mesh.points, triangles, 50, -90, size=SIZE, lines=0.25)
    else:
        drawing.shaded(
            axes, 9 * np.eye(3), np.array([[0, 1, 2]]), 50, -90, size=SIZE
        )  # out of sight
        near = mesh.points[slope(mesh.points) @ drawing.eye_of(axes) > 0]
        axes.scatter(*near.T, s=3, color=drawing.BLUE, depthshade=False)
    done = mesh.report is not None and mesh.certified
    words = f"{len(mesh.points):,} points, {len(mesh.simplices):,} triangles"
    if done:
        words += ", certified"
    figure.text(0.5, 0.02, words, ha="center", fontsize=9, color=drawing.INK)
    figure.canvas.draw()
    picture = Image.frombytes(
        "RGBA", figure.canvas.get_width_height(), bytes(figure.canvas.buffer_rgba())
    )
    plt.close(figure)
    return picture.convert("RGB").quantize(24, dither=Image.Dither.NONE)


oracle = stellate.ImplicitManifold(
    tube, ambient_dimension=3, dimension=2, bounding_box=([-1.7, -1.3, -0.4], [1.7, 1.3, 0.4])
)
meshes = [mesh for mesh in stellate.watch(oracle, 0.2, size_rate=0.3) if len(mesh.points) > 0]
chosen = np.unique(np.linspace(0, len(meshes) - 1, FRAMES).round().astype(int))
frames = [frame_of(meshes[i]) for i in chosen]
folder = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else drawing.HERE
frames[0].save(
    folder / "growing.gif",
    save_all=True,
    append_images=frames[1:],
    duration=[200] * (len(frames) - 1) + [200 * LAST],
    loop=0,
    optimize=True,
)
