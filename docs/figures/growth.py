"""A torus while it grows: four of the revisions that `stellate.watch` yields."""

from __future__ import annotations

import _drawing as drawing
import matplotlib.pyplot as plt
import numpy as np
import stellate
from mpl_toolkits.mplot3d import Axes3D
from stellate.manifolds import Torus


def outwards(at: np.ndarray) -> np.ndarray:
    """Normals of the torus at points near it."""
    ring = at * [1, 1, 0]
    return at - ring / np.linalg.norm(ring, axis=1, keepdims=True)


def turned(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """The triangles with their normals leaving the torus: no mesh is closed before its end."""
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inwards = np.einsum("nd,nd->n", normals, outwards(corners.mean(axis=1))) < 0
    return np.where(inwards[:, None], triangles[:, ::-1], triangles)


def dotted(axes: Axes3D, points: np.ndarray, surface: stellate.Mesh) -> None:
    """The near side of a sample that has no stars yet, on the surface that nobody has seen yet."""
    triangles = turned(surface.points, surface.simplices)
    drawing.shaded(axes, surface.points, triangles, size=1.5, colour="#e9eef1", lines=0)
    near = points[outwards(points) @ drawing.eye_of(axes) > 0]
    axes.scatter(*near.T, s=4, color=drawing.BLUE, depthshade=False, zorder=3)


meshes = list(stellate.watch(Torus(1, 0.4), 0.12))
with_stars = next(n for n, mesh in enumerate(meshes) if len(mesh.simplices) > 0)
shown = [meshes[with_stars // 2], meshes[7 * with_stars // 9], meshes[with_stars], meshes[-1]]
figure = plt.figure(figsize=(10, 2.4))
for place, mesh in enumerate(shown):
    axes = figure.add_axes((place / 4, -0.02, 0.25, 0.95), projection="3d", computed_zorder=False)
    title = f"{len(mesh.points)} vertices"
    if len(mesh.simplices) > 0:
        drawing.shaded(axes, mesh.points, turned(mesh.points, mesh.simplices), size=1.5)
        title += f", {len(mesh.simplices)} triangles"
    else:
        dotted(axes, mesh.points, meshes[-1])
    if mesh.report is not None and mesh.certified:
        title += ", certified"
    axes.set_title(title, y=0.94)
drawing.save(figure, "growth")
