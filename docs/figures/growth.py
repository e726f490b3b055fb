"""A torus while it grows: four of the revisions that `stellate.watch` yields."""

from __future__ import annotations

import _drawing as drawing
import matplotlib.pyplot as plt
import numpy as np
import stellate
from stellate.manifolds import Torus


def outwards(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """The triangles turned so that their normals leave the torus: no mesh is closed before its end."""
    corners = points[triangles]
    middle = corners.mean(axis=1)
    ring = middle * [1, 1, 0]
    ring /= np.linalg.norm(ring, axis=1, keepdims=True)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inwards = np.einsum("nd,nd->n", normals, middle - ring) < 0
    return np.where(inwards[:, None], triangles[:, ::-1], triangles)


meshes = list(stellate.watch(Torus(1, 0.4), 0.12))
shown = [meshes[0], meshes[3], meshes[5], meshes[-1]]
figure = plt.figure(figsize=(10, 2.4))
for place, mesh in enumerate(shown):
    axes = figure.add_axes((place / 4, -0.02, 0.25, 0.95), projection="3d", computed_zorder=False)
    drawing.shaded(axes, mesh.points, outwards(mesh.points, mesh.simplices), size=1.5)
    done = ", certified" if mesh.report is not None and mesh.certified else ""
    axes.set_title(f"{len(mesh.points)} vertices, {len(mesh.simplices)} triangles{done}", y=0.94)
drawing.save(figure, "growth")
