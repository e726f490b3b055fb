"""Meshes a torus, then a manifold that nobody can see, and draws the first.

Usage: quickstart.py OUTPUT_DIRECTORY
"""

from __future__ import annotations

import pathlib
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))  # the source tree's package

import stellate  # noqa: E402
from stellate.manifolds import SpecialOrthogonal3  # noqa: E402


class Torus:
    """A torus in space, through oracles of our own. Arrays hold one point a row."""

    dimension, ambient_dimension = 2, 3
    major, minor = 1.0, 0.4
    bounding_box = [-1.5, -1.5, -0.5], [1.5, 1.5, 0.5]

    def closest_point(self, x: np.ndarray) -> np.ndarray:
        ring = x * [1.0, 1.0, 0.0]
        ring *= self.major / np.linalg.norm(ring, axis=1, keepdims=True)
        tube = x - ring
        return ring + self.minor * tube / np.linalg.norm(tube, axis=1, keepdims=True)

    def tangent_basis(self, p: np.ndarray) -> np.ndarray:
        angle = np.arctan2(p[:, 1], p[:, 0])
        along = np.stack([-np.sin(angle), np.cos(angle), np.zeros(len(p))], axis=1)
        outward = np.stack([np.cos(angle), np.sin(angle), np.zeros(len(p))], axis=1)
        normal = (p - self.major * outward) / self.minor
        return np.stack([along, np.cross(normal, along)], axis=2)


def draw(mesh: stellate.Mesh, path: pathlib.Path) -> None:
    """The surface as shaded triangles with their edges."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    oriented = mesh.oriented_simplices()
    assert oriented is not None, "a torus is orientable"
    corners = mesh.points[oriented]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    key_light, fill_light = np.array([0.35, -0.55, 0.76]), np.array([-0.8, -0.2, 0.3])
    shade = (
        0.24
        + 0.72 * np.clip(normals @ key_light, 0, 1)
        + 0.16 * np.clip(normals @ fill_light, 0, 1)
    )
    base = np.array([0.36, 0.66, 0.90])
    colours = np.clip(
        shade[:, None] * base + 0.12 * np.clip(normals @ key_light, 0, 1)[:, None] ** 8, 0, 1
    )

    figure = plt.figure(figsize=(10, 6.6), dpi=90)
    axes = figure.add_axes((-0.25, -0.4, 1.5, 1.8), projection="3d", computed_zorder=False)
    # Seen almost from afar, triangles that face away lie behind others: leave them out.
    elevation, azimuth = 38.0, -60.0
    e, a = np.radians([elevation, azimuth])
    eye = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    front = normals @ eye > -0.15
    axes.add_collection3d(
        Poly3DCollection(
            corners[front],
            facecolors=colours[front],
            edgecolors="#123047",
            linewidths=0.35,
            clip_on=False,
        )
    )
    reach = np.abs(mesh.points).max()
    for set_limit in (axes.set_xlim, axes.set_ylim, axes.set_zlim):
        set_limit(-0.86 * reach, 0.86 * reach)
    axes.set_box_aspect((1, 1, 1))
    axes.set_proj_type("persp", focal_length=0.6)
    axes.view_init(elevation, azimuth)
    axes.set_axis_off()
    figure.savefig(path, facecolor="white")
    plt.close(figure)


def main() -> int:
    output = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    output.mkdir(parents=True, exist_ok=True)
    with stellate.Server() as server:  # a stellated of our own, for both
        torus = stellate.mesh(
            Torus(), epsilon=0.07, server=server, on_progress=stellate.progress_bar("torus")
        )
        print(f"\nA torus in R^3, epsilon 0.07\n{torus.report}\n", flush=True)
        so3 = stellate.mesh(
            SpecialOrthogonal3(),
            epsilon=0.4,
            server=server,
            on_progress=stellate.progress_bar("SO(3)"),
        )
        print(f"\nSO(3), the rotations of space, a 3-manifold in R^9, epsilon 0.4\n{so3.report}\n")
    written = []
    for mesh, name in (
        (torus, "torus.vtu"),
        (torus, "torus.obj"),
        (torus, "torus.txt"),
        (so3, "so3.txt"),
    ):
        mesh.save(output / name)
        written.append(name)
    draw(torus, output / "torus.png")
    written.append("torus.png")
    try:
        torus.show(output / "torus.html", label="torus")
        written.append("torus.html")
    except stellate.ViewerNotFound as error:
        print(f"No torus.html: {error}", file=sys.stderr)
    print(f"Written to {output}: {', '.join(written)}")
    return 0 if torus.certified and so3.certified else 1


if __name__ == "__main__":
    sys.exit(main())
