"""A wedge of 30 degrees

A slice of a cylinder. Where two sides meet as sharply as that, neither could be refined without coming too
near to the other, again and again: the edge is guarded, and its points keep all others away. It says so
itself: which walls meet, at which angle and where, as a warning beside the certificate.
"""

import numpy as np
import stellate
from stellate.oracles import HalfSpace, Solid

angle = np.radians(30)
sides = [HalfSpace([0, 1, 0]), HalfSpace([np.sin(angle), -np.cos(angle), 0])]


def inside_the_cylinder(x):
    return 1 - x[:, 0] ** 2 - x[:, 1] ** 2


wedge = Solid([*sides, inside_the_cylinder], box=([-np.inf, -np.inf, 0], [np.inf, np.inf, 0.5]),
              bounding_box=([-0.2, -0.2, -0.2], [1.2, 0.7, 0.7]))  # fmt: skip
mesh = stellate.mesh(wedge, epsilon=0.1)
print(mesh.report.certificate.warnings)

faces = [face.simplices for face in mesh.boundary]
walls = np.repeat([face.walls[0] for face in mesh.boundary], [3 * len(face) for face in faces])
corners = np.concatenate(faces).ravel()  # each triangle with points of its own, to be of one colour
skin = stellate.Mesh(mesh.points[corners], np.arange(len(corners)).reshape(-1, 3))
axes = skin.plot(color=walls, colormap="Pastel1")
seen = [edge.simplices for edge in mesh.edges if edge.walls != (2, 3)]  # the arc below is behind
edges = np.concatenate(seen)
stellate.Mesh(mesh.points, edges).plot(ax=axes, color="black", frame=False, view=(40, 200))
axes.figure.savefig("wedge.png")
