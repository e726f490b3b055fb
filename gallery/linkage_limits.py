"""A linkage with joint limits

The five-bar linkage, two of whose bars have to point upwards: two walls, which cut the surface of its
positions, of genus 4, to a piece of it with corners. It is drawn over three of the six coordinates.
"""

import numpy as np
import stellate

bars = [("a", "p", 1.0), ("p", "q", 1.0), ("q", "r", 1.0), ("r", "b", 1.0)]
linkage = stellate.oracles.Linkage(bars, fixed={"a": (0, 0), "b": (1, 0)})


def up(joint):
    """The bar from the ground to a joint points upwards, by 15 degrees at least."""
    return lambda x: x[:, linkage.moving.index(joint) * 2 + 1] - np.sin(np.radians(15))


limits = [up("p"), up("r")]
mesh = stellate.mesh(stellate.oracles.Clipped(linkage, limits), epsilon=0.3, size_rate=0.4)

axes = mesh.plot(coordinates=[0, 4, 3], color=3, frame=False)
rim = np.concatenate([face.simplices for face in mesh.boundary])
stellate.Mesh(mesh.points, rim).plot(coordinates=[0, 4, 3], ax=axes, color="crimson", frame=False)
axes.figure.savefig("linkage_limits.png")
