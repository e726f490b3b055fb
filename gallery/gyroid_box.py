"""A gyroid in a box

An unbounded surface, in a box that cuts it: six walls. Where two sides of the box meet on it there is a
corner; the mesher is not given where these are, or how many.
"""

import numpy as np
import stellate


def gyroid(x):
    s, c = np.sin(x), np.cos(x)
    return (s * np.roll(c, -1, axis=1)).sum(axis=1, keepdims=True)


box = np.array([-2.5, -2.4, -2.3]), np.array([2.7, 2.8, 2.9])
around = box[0] - 1, box[1] + 1
surface = stellate.ImplicitManifold(gyroid, ambient_dimension=3, dimension=2, bounding_box=around)
mesh = stellate.mesh(stellate.oracles.Clipped(surface, box=box), epsilon=0.25)

axes = mesh.plot(color=2, frame=False)
rim = np.concatenate([side.simplices for side in mesh.boundary])
stellate.Mesh(mesh.points, rim).plot(ax=axes, color="crimson", frame=False, view=(25, -50))
axes.figure.savefig("gyroid_box.png")
