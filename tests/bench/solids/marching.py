"""Solids of the `sdf` library beside its own mesher, marching cubes: prints a table, asserts nothing.

    STELLATED=... PYTHONPATH=clients/python python3 tests/bench/solids/marching.py

Wants the package `sdf` (`sdf-fork`) and its scikit-image, in an environment of their own. Its objects are
traced as they are, and meshed as a boundary alone; its mesher is given the step of the grid that makes
about as many triangles. Seconds are of the clock, one thread each; tracing is told apart.
  middles   the farthest that a triangle's middle is from f = 0, as a share of epsilon
  edges     the farthest that a point of a true edge is from the mesh, as a share of epsilon
  angle     the least of a triangle, degrees
"""

import time

import numpy as np
import sdf
import stellate
from scipy.spatial import cKDTree
from sdf import X, Y, Z
from stellate import solids as s

_BOX = [-1.6] * 3, [1.6] * 3
_SAMPLES = np.random.default_rng(1).dirichlet([1, 1, 1], 24)
rods = sdf.cylinder(0.5)
SOLIDS = {
    "drilled block and ball": (
        (sdf.sphere(1) & sdf.box(1.5)) - (rods.orient(X) | rods.orient(Y) | rods.orient(Z)),
        0.06,
    ),
    "ball and box": (sdf.sphere(0.7) | sdf.box(1).translate((0.6, 0.3, 0.2)), 0.08),
    "ball without box": (sdf.sphere(1) - sdf.box(1).translate((0.6, 0.3, 0.7)), 0.08),
    "cylinder": (sdf.capped_cylinder(-Z, Z, 0.5), 0.08),
    "octahedron": (sdf.octahedron(1), 0.08),
    "frame of a box": (sdf.wireframe_box((1.6, 1.4, 1.2), 0.2), 0.06),
    "torus": (sdf.torus(0.8, 0.3), 0.06),
    "twisted bar": (sdf.box((1, 1, 1.6)).twist(0.6), 0.08),
}


def angle(corners: np.ndarray) -> float:
    least = 180.0
    for i in range(3):
        a, b = corners[:, i - 1] - corners[:, i], corners[:, i - 2] - corners[:, i]
        lengths = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
        cosines = (a * b).sum(axis=1) / np.maximum(lengths, 1e-300)
        least = min(least, float(np.degrees(np.arccos(np.clip(cosines.max(), -1, 1)))))
    return least


def euler(corners: np.ndarray) -> int:
    points, ids = np.unique(np.round(corners.reshape(-1, 3), 9), axis=0, return_inverse=True)
    rows = np.sort(ids.reshape(-1, 3), axis=1)
    rows = rows[(np.diff(rows, axis=1) > 0).all(axis=1)]
    edges = np.unique(np.concatenate([rows[:, [0, 1]], rows[:, [0, 2]], rows[:, [1, 2]]]), axis=0)
    return len(points) - len(edges) + len(rows)


def line(name, mesher, f, corners, edges, seconds, epsilon, note=""):
    middles = np.abs(f(corners.mean(axis=1))).max() / epsilon
    off = 0.0
    if len(edges):
        some = (_SAMPLES @ corners).reshape(-1, 3)
        off = (
            cKDTree(np.concatenate([some, corners.reshape(-1, 3)])).query(edges)[0].max() / epsilon
        )
    print(
        f"{name:24s} {mesher:15s} {len(corners):9d} {seconds:7.2f} {middles:9.4f} {off:7.3f} "
        f"{angle(corners):7.2f} {euler(corners):5d}  {note}",
        flush=True,
    )


def main() -> None:
    print(f"{'solid':24s} {'mesher':15s} triangles seconds   middles   edges   angle   chi")
    with stellate.Server() as server:
        for name, (f, epsilon) in SOLIDS.items():
            began = time.monotonic()
            solid = s.traced(f, _BOX)
            traced = time.monotonic() - began
            mesh = stellate.mesh(solid, epsilon, server=server, boundary_only=True)
            seconds = time.monotonic() - began - traced
            corners = mesh.points[mesh.simplices]
            edges = [mesh.points[edge.simplices] for edge in mesh.edges]
            true = np.concatenate([e.mean(axis=1) for e in edges]) if edges else np.empty((0, 3))
            # Of curved edges the middles of chords are not on them; the ends are.
            true = np.concatenate([true, *(e.reshape(-1, 3) for e in edges)])
            note = f"{'certified' if mesh.certified else 'NOT CERTIFIED'}, traced in {traced:.1f} s"
            line(name, "Stellate", f, corners, true, seconds, epsilon, note)
            area = np.linalg.norm(
                np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
            ).sum() / 2  # fmt: skip
            step = float(np.sqrt(2.2 * area / len(corners)))  # so many triangles a cell of the grid
            began = time.monotonic()
            points = f.generate(step=step, bounds=_BOX, workers=1, verbose=False, sparse=False)
            seconds = time.monotonic() - began
            line(name, "marching cubes", f, np.reshape(points, (-1, 3, 3)), true, seconds, epsilon)


if __name__ == "__main__":
    main()
