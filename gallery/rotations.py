"""All rotations of space

SO(3), a 3-manifold in R^9, sliced: of the tetrahedra one sees where they meet a hyperplane. The
colour is the angle of the rotation.
"""

import numpy as np
import stellate

mesh = stellate.mesh(stellate.manifolds.SpecialOrthogonal3(), epsilon=0.3)

weights = np.diag([1.0, 2.0, 3.0]).ravel()  # of the matrix: its slices are not just spheres
slice = mesh.slice(weights, level=0.3)
angles = np.arccos(np.clip((slice.points[:, [0, 4, 8]].sum(axis=1) - 1) / 2, -1, 1))
axes = slice.plot(coordinates=[1, 5, 6], color=angles, frame=False, view=(30, 40))
axes.figure.savefig("rotations.png")
