"""A sandwich with a core of Schwarz's P

Two plates, and between them what is near the surface cos x + cos y + cos z = 0: a light part for a
printer. The core meets the plates and its own sides at right angles, as they lie in planes of symmetry.
"""

import numpy as np
import stellate
from stellate import solids as s


def p(x):
    return np.cos(x).sum(axis=1)


def slope(x):
    return -np.sin(x)


thick, long, high = 0.45, 4 * np.pi, 2 * np.pi
near = s.Implicit(lambda x: thick + p(x), slope) & s.Implicit(
    lambda x: thick - p(x), lambda x: -slope(x)
)
core = s.Box([0, 0, 0], [long, high, high]) & near
plates = s.Box([0, 0, -0.4], [long, high, 0]), s.Box([0, 0, high], [long, high, high + 0.4])
mesh = stellate.mesh(core | plates[0] | plates[1], epsilon=0.4)
mesh.save("sandwich.stl")

axes = mesh.boundary_mesh().plot(color="#d9b06f", frame=False, view=(12, -62), edges=False)
axes.figure.savefig("schwarz.png")
