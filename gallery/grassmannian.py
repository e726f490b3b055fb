"""All planes of four-space

The Grassmannian G(2, 4): each plane as the projection onto it, a symmetric matrix with four
eigenvalues 1, 1, 0, 0. It is of dimension 4, in R^10; two slices leave a surface.
"""

import numpy as np
import stellate

rows, columns = np.triu_indices(4)
stretch = np.where(rows == columns, 1.0, np.sqrt(2.0))  # so that distances are those of matrices


class Planes:
    dimension, ambient_dimension, thread_safe = 4, 10, True
    bounding_box = np.where(rows == columns, 0.0, -0.71), np.where(rows == columns, 1.0, 0.71)

    def closest_point(self, points):
        matrices = np.zeros((len(points), 4, 4))
        matrices[:, rows, columns] = matrices[:, columns, rows] = points / stretch
        plane = np.linalg.eigh(matrices)[1][:, :, 2:]
        return (plane @ plane.transpose(0, 2, 1))[:, rows, columns] * stretch


mesh = stellate.mesh(Planes(), epsilon=0.45)
tilt = np.random.default_rng(3).normal(size=(3, 10))
axes = mesh.plot(slices=[(0, 0.5), (4, 0.45)], coordinates=tilt, color=7, frame=False)
axes.figure.savefig("grassmannian.png")
