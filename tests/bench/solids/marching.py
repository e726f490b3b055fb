"""Solids of the `sdf` library beside its own mesher, marching cubes: prints a table, asserts nothing.

    STELLATED=... PYTHONPATH=clients/python python3 tests/bench/solids/marching.py

Wants the package `sdf` (`sdf-fork`) and its scikit-image, in an environment of their own. Its objects are
traced as they are, and meshed as a boundary alone; its mesher is given the step of the grid that makes
about as many triangles. Seconds are of the clock, one thread each; tracing is told apart. What the
other columns are is in surfaces.py.
"""

import time

import numpy as np
import sdf
import stellate
from sdf import X, Y, Z
from stellate import solids as s
from surfaces import HEADER, area, line, points_of_edges

_BOX = [-1.6] * 3, [1.6] * 3
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


def main() -> None:
    print(HEADER)
    with stellate.Server() as server:
        for name, (f, epsilon) in SOLIDS.items():
            began = time.monotonic()
            solid = s.traced(f, _BOX)
            traced = time.monotonic() - began
            mesh = stellate.mesh(solid, epsilon, server=server, boundary_only=True)
            seconds = time.monotonic() - began - traced
            corners = mesh.points[mesh.simplices]
            true = points_of_edges(mesh)
            note = f"{'certified' if mesh.certified else 'NOT CERTIFIED'}, traced in {traced:.1f} s"
            line(name, "Stellate", f, corners, true, seconds, epsilon, note)
            step = float(np.sqrt(2.2 * area(corners) / len(corners)))  # as many triangles a cell
            began = time.monotonic()
            points = f.generate(step=step, bounds=_BOX, workers=1, verbose=False, sparse=False)
            seconds = time.monotonic() - began
            line(name, "marching cubes", f, np.reshape(points, (-1, 3, 3)), true, seconds, epsilon)


if __name__ == "__main__":
    main()
