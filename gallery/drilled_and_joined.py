"""A part, drilled and joined

A cube and a ball, drilled along x, and a ball joined to a corner: nine walls, and labels for their signs. The
edges are where walls meet that matter there, and no others; what the ball covers has none.
"""

import numpy as np
import stellate
from stellate import solids as s

block = s.Box([-1] * 3, [1] * 3) & s.Ball(1.3)
part = block - s.Cylinder(0.5, axis="x") | s.Ball(0.45, at=(0.95, 0.9, 0.2))
mesh = stellate.mesh(part, epsilon=0.13)

skin = mesh.boundary_mesh()
walls = np.bitwise_and.reduce(mesh.walls[skin.simplices], axis=1)
number = np.log2(walls.astype(float))  # each triangle is on one wall
corners = skin.simplices.ravel()  # and gets points of its own, to be of one colour
triangles = stellate.Mesh(mesh.points[corners], np.arange(len(corners)).reshape(-1, 3))
axes = triangles.plot(color=np.repeat(number, 3), colormap="Set3", edges=True)
edges = np.concatenate([edge.simplices for edge in mesh.edges])
stellate.Mesh(mesh.points, edges).plot(ax=axes, color="black", frame=False, view=(28, 40))
axes.figure.savefig("drilled_and_joined.png")
