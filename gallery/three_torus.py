"""The three-torus, sliced

T^3 as a product of circles in R^6. The hyperplane where the three cosines add up to zero cuts it in
a surface, drawn over the three angles: nearly the minimal surface that is called Schwarz's P.
"""

import numpy as np
import stellate

mesh = stellate.mesh(stellate.manifolds.ProductOfCircles((1, 1, 1)), epsilon=0.3)

surface = mesh.slice([1, 0, 1, 0, 1, 0], level=0.0)
angles = np.arctan2(surface.points[:, 1::2], surface.points[:, ::2])
corners = angles[surface.simplices]
corners -= 2 * np.pi * np.round((corners - corners[:, :1]) / (2 * np.pi))  # across the cube's sides
cube = stellate.Mesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
cube.plot(frame=False, view=(22, -55), color=2).figure.savefig("three_torus.png")
