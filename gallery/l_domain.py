"""The membrane of an L

A square without another square: eight walls, and six of them bound it, with a corner that points inwards. The
colours are the lowest eigenfunction of the Laplace operator that is 0 on the boundary, by elements of first
order; its eigenvalue is 9.6397 in the limit.
"""

import numpy as np
import stellate
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import eigsh
from stellate import solids as s

domain = s.Box([-1, -1], [1, 1]) - s.Box([0, -1], [1, 0])
mesh = stellate.mesh(domain, epsilon=0.04)

corners = mesh.points[mesh.simplices]
sides = np.linalg.inv(corners[:, 1:] - corners[:, :1])
slopes = np.concatenate([-sides.sum(axis=2, keepdims=True), sides], axis=2)  # of the elements
areas = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))[:, None, None] / 2
rows = np.repeat(mesh.simplices, 3, axis=1).ravel(), np.tile(mesh.simplices, 3).ravel()
stiffness = coo_matrix(((areas * (slopes.transpose(0, 2, 1) @ slopes)).ravel(), rows)).tocsr()
mass = coo_matrix(((areas * (1 + np.eye(3)) / 12).ravel(), rows)).tocsr()
inner = np.flatnonzero(mesh.walls == 0)
inside = stiffness[inner][:, inner], mass[inner][:, inner]
values, vectors = eigsh(inside[0], 1, inside[1], sigma=0)
membrane = np.zeros(len(mesh.points))
membrane[inner] = np.abs(vectors[:, 0])

surface = stellate.Mesh(np.column_stack([mesh.points, membrane / membrane.max()]), mesh.simplices)
axes = surface.plot(color=2, frame=False, view=(35, -130))
axes.figure.savefig("l_domain.png")
