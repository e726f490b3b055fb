"""What the Python client makes of the manifolds that the other clients' tests mesh.

Prints lines for the shell: the vertices and simplices of a torus and a Clifford torus, and of the half of
the unit sphere above the plane z = 0, a manifold with boundary.
"""

import numpy as np
import stellate
from stellate.manifolds import ProductOfCircles, Torus


class Hemisphere:
    dimension, ambient_dimension, walls = 2, 3, 1
    bounding_box = [-1.1] * 3, [1.1] * 3

    def closest_point(self, x):
        return x / np.sqrt((x * x).sum(axis=1))[:, None]

    def face_point(self, x, _face):
        flat = x * [1.0, 1.0, 0.0]
        return flat / np.sqrt((flat * flat).sum(axis=1))[:, None]

    def tangent_basis(self, p):
        x, y, z = p.T
        s = np.copysign(1.0, z)
        a = -1 / (s + z)
        first = np.stack([1 + s * x * x * a, s * x * y * a, -s * x], axis=1)
        second = np.stack([x * y * a, s + y * y * a, -y], axis=1)
        return np.stack([first, second], axis=2)

    def clearances(self, p):
        return p[:, 2:]

    def conormals(self, p, face):
        return np.broadcast_to([0.0, 0.0, -1.0], (len(p), len(face), 3))


def counts(*meshes: stellate.Mesh) -> str:
    assert all(mesh.certified for mesh in meshes)
    return " ".join(f"{len(mesh.points)} {len(mesh.simplices)}" for mesh in meshes)


closed = stellate.mesh(Torus(), 0.1), stellate.mesh(ProductOfCircles(), 0.3)
print(f"STELLATE_TEST_COUNTS='{counts(*closed)}'")
print(f"STELLATE_TEST_HEMISPHERE='{counts(stellate.mesh(Hemisphere(), 0.2))}'")
