"""A solid torus

What a torus encloses, filled with tetrahedra: a solid is what walls leave of space itself. Here it is cut
open, and one sees where the tetrahedra meet the cut.
"""

import numpy as np
import stellate


def inside(x):
    return 0.4**2 - (np.hypot(x[:, 0], x[:, 1]) - 1) ** 2 - x[:, 2] ** 2


mesh = stellate.mesh(
    stellate.ImplicitSolid(inside, bounding_box=([-1.6, -1.6, -0.6], [1.6, 1.6, 0.6])), epsilon=0.17
)

cut = np.array([0.5, -1, 0])
section = mesh.slice(cut)
skin = mesh.boundary[0].simplices
skin = skin[mesh.points[skin].mean(axis=1) @ cut < 0]
points = np.concatenate([mesh.points, section.points])
triangles = np.concatenate([skin, section.simplices + len(mesh.points)])
color = np.arange(len(points)) >= len(mesh.points)
axes = stellate.Mesh(points, triangles).plot(
    color=color, colormap="Set3", frame=False, view=(30, -60)
)
axes.figure.savefig("solid_torus.png")
