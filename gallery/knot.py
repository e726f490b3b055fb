"""A knotted tube

A tube around a trefoil knot, by its parametrization. That it is knotted shows in space only: as a
surface it is a torus.
"""

import numpy as np
import stellate


def knot(t):
    return np.stack([np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t),
                     -np.sin(3 * t)], axis=-1)  # fmt: skip


def tube(u):
    h = 1e-4
    along = knot(u[:, 0] + h) - knot(u[:, 0] - h)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    side = np.cross(along, [0.0, 0.0, 1.0])  # the knot is nowhere upright
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(side, along)
    return knot(u[:, 0]) + 0.4 * (np.cos(u[:, 1:]) * side + np.sin(u[:, 1:]) * up)


oracle = stellate.oracles.Parametrized(tube, None, [0, 0], [2 * np.pi, 2 * np.pi], periodic=True)
mesh = stellate.mesh(oracle, epsilon=0.14)
mesh.plot(color=2, colormap="plasma", frame=False, view=(65, -60)).figure.savefig("knot.png")
