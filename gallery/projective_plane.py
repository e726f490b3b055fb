"""The projective plane

Each line through the origin of space, as the projection onto it: Veronese's surface, in R^6. Its
picture over the products yz, zx, xy is Steiner's Roman surface, which crosses itself as the
projective plane itself does not.
"""

import numpy as np
import stellate

rows, columns = [0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]
stretch = np.array([1, 1, 1, 1, 1, 1]) * np.sqrt([1, 1, 1, 2, 2, 2])


class Lines:
    dimension, ambient_dimension, thread_safe = 2, 6, True
    bounding_box = [0, 0, 0, -0.8, -0.8, -0.8], [1, 1, 1, 0.8, 0.8, 0.8]

    def closest_point(self, points):
        matrices = np.zeros((len(points), 3, 3))
        matrices[:, rows, columns] = matrices[:, columns, rows] = points / stretch
        line = np.linalg.eigh(matrices)[1][:, :, 2]
        return line[:, rows] * line[:, columns] * stretch


mesh = stellate.mesh(Lines(), epsilon=0.1)
axes = mesh.plot(coordinates=[3, 4, 5], color=2, frame=False, view=(30, 20))
axes.figure.savefig("projective_plane.png")
