"""Heat in a composite of two materials

Grains in a matrix, ten times as conductive: two regions of one mesh, which share the triangles between
them. Elements of first order on it let heat flow from the left to the right. Without grains the isotherms
would be planes; here they crowd between the grains, and the whole conducts more.
"""

import numpy as np
import stellate
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve
from stellate import solids as s

places = (-0.5, -0.45, 0), (0.45, -0.4, 0.2), (-0.1, 0.45, -0.1)
grains = s.Ball(0.4, places[0]) | s.Ball(0.35, places[1]) | s.Ball(0.42, places[2])
composite = s.Labels(matrix=s.Box([-1] * 3, [1] * 3), grains=grains)
mesh = stellate.mesh(composite, epsilon=0.16)

corners = mesh.points[mesh.simplices]
sides = np.linalg.inv(corners[:, 1:] - corners[:, :1])
slopes = np.concatenate([-sides.sum(axis=2, keepdims=True), sides], axis=2)  # of the elements
volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6
conductivity = np.where(mesh.labels == composite.label_of("grains"), 10.0, 1.0)
local = (volumes * conductivity)[:, None, None] * (slopes.transpose(0, 2, 1) @ slopes)
rows = np.repeat(mesh.simplices, 4, axis=1).ravel(), np.tile(mesh.simplices, 4).ravel()
stiffness = coo_matrix((local.ravel(), rows)).tocsr()
heat = (mesh.points[:, 0] + 1) / 2  # 0 on the left, 1 on the right; in between to be found
free = np.flatnonzero(np.abs(mesh.points[:, 0]) < 1 - 1e-9)
heat[free] += spsolve(stiffness[free][:, free], -(stiffness @ heat)[free])
conductance = heat @ stiffness @ heat / 2  # 1, were it all matrix

plane = stellate.Mesh(np.column_stack([mesh.points, heat]), mesh.simplices).slice(2)
x, y, _, t = plane.points.T
axes = mesh.region(2).boundary_mesh().slice(2).plot(coordinates=(0, 1), color="white")
axes.tricontourf(x, y, plane.simplices, t, levels=25, cmap="inferno")
axes.set(xlim=(-1, 1), ylim=(-1, 1))
axes.set_axis_off()
axes.figure.savefig("composite.png")
