"""Statistics on a sphere of shapes

Kendall: triangles that differ by moving, turning and scaling have one shape, and all shapes are a
sphere of radius 1/2. Two hundred noisy triangles make a density on it, at the mesh's vertices.
"""

import numpy as np
import stellate

mesh = stellate.mesh(stellate.manifolds.Sphere(2, radius=0.5), epsilon=0.05)


def shape_of(corners):  # (n, 3) complex -> (n, 3), points of the sphere
    a, b, c = corners.T
    z, w = (b - a) / np.sqrt(2), (2 * c - a - b) / np.sqrt(6)
    size = abs(z) ** 2 + abs(w) ** 2
    product = 2 * z * w.conj()
    polar = np.stack([product.real, product.imag, abs(z) ** 2 - abs(w) ** 2], axis=1)
    return polar / (2 * size[:, None])


rng = np.random.default_rng(1)
right_angled = np.array([0, 4, 3j]) + rng.normal(0, 0.6, (200, 3, 2)) @ [1, 1j]
cosines = np.clip(4 * mesh.points @ shape_of(right_angled).T, -1, 1)
density = np.exp(-((np.arccos(cosines) / 2 / 0.1) ** 2) / 2).sum(axis=1)
mean = mesh.points[density.argmax()]
print("the shape of most weight:", mean.round(2))
axes = mesh.plot(color=density, frame=False, edges=False, view=(15, -120))
axes.figure.savefig("shapes.png")
