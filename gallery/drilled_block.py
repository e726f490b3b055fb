"""A block with a hole

A box, and the outside of a cylinder: seven walls. Its edges and its corners are in the mesh exactly, and
each wall's triangles are a group of their own, which .msh files keep for finite elements.
"""

import numpy as np
import stellate


def outside_the_hole(x):
    return x[:, 0] ** 2 + x[:, 1] ** 2 - 0.5**2


block = stellate.oracles.Solid([outside_the_hole], box=([-1, -1, -0.5], [1, 1, 0.5]))
mesh = stellate.mesh(block, epsilon=0.18)

sides = [side.simplices for side in mesh.boundary]
walls = np.repeat([side.walls[0] for side in mesh.boundary], [3 * len(side) for side in sides])
corners = np.concatenate(sides).ravel()  # each triangle with points of its own, to be of one colour
skin = stellate.Mesh(mesh.points[corners], np.arange(len(corners)).reshape(-1, 3))
axes = skin.plot(color=walls == 0, colormap="Set3")
edges = np.concatenate([edge.simplices for edge in mesh.edges])
stellate.Mesh(mesh.points, edges).plot(ax=axes, color="black", frame=False, view=(35, -60))
axes.figure.savefig("drilled_block.png")
