"""A Moebius strip

A wider strip, given by its parametrization, and a wall that leaves what is near its middle circle. It has
one edge, in red, and one side.
"""

import numpy as np
import stellate


def strip(p):
    u, v = p.T
    r = 1 + v * np.cos(u / 2)
    return np.stack([r * np.cos(u), r * np.sin(u), v * np.sin(u / 2)], axis=1)


def near_the_middle(x):
    return 0.4**2 - (np.hypot(x[:, 0], x[:, 1]) - 1) ** 2 - x[:, 2] ** 2


wide = stellate.oracles.Parametrized(
    strip, None, [0, -0.8], [4 * np.pi, 0.8], periodic=[True, False]
)
mesh = stellate.mesh(stellate.oracles.Clipped(wide, [near_the_middle]), epsilon=0.12)

axes = mesh.plot(color=2, frame=False)
(edge,) = mesh.boundary
stellate.Mesh(mesh.points, edge.simplices).plot(
    ax=axes, color="crimson", frame=False, view=(50, 20)
)
axes.figure.savefig("moebius_strip.png")
