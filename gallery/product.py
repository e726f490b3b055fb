"""A product

The two-sphere times the circle, in R^5: where a ball-and-socket joint and a wheel may stand together.
A slant slice of it.
"""

import numpy as np
import stellate

sphere, circle = stellate.manifolds.Sphere(2), stellate.manifolds.Sphere(1, radius=0.7)
mesh = stellate.mesh(stellate.oracles.Product(sphere, circle), epsilon=0.3)

slice = mesh.slice([0, 0, 1, 1, 0], level=0.1)
turn = np.arctan2(slice.points[:, 4], slice.points[:, 3])
axes = slice.plot(
    coordinates=[0, 1, 4], color=np.cos(turn), frame=False, view=(35, -50), edges=True
)
axes.figure.savefig("product.png")
