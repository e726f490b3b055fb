"""Rotations and reflections

O(3): the matrices whose inverse is their transpose. Two components in R^9, which one mesh finds;
both are sliced by a hyperplane, and drawn over a projection that keeps them apart.
"""

import numpy as np
import stellate

pairs = np.triu_indices(3)


def excess(x):
    m = x.reshape(-1, 3, 3)
    return (m @ m.transpose(0, 2, 1) - np.eye(3))[:, pairs[0], pairs[1]]


group = stellate.ImplicitManifold(
    excess, ambient_dimension=9, dimension=3, bounding_box=([-1.1] * 9, [1.1] * 9)
)
mesh = stellate.mesh(group, epsilon=0.4)

slice = mesh.slice(np.diag([1.0, 2.0, 3.0]).ravel(), level=0.3)
sign = np.linalg.det(slice.points.reshape(-1, 3, 3))
apart = np.eye(9)[[1, 5, 6]]
shown = stellate.Mesh(
    slice.points @ apart.T + [[0, 1.4, 0]] * np.sign(sign)[:, None], slice.simplices
)
shown.plot(color=sign, colormap="coolwarm", frame=False).figure.savefig("orthogonal.png")
