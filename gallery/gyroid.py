"""The gyroid, once around

The gyroid repeats itself in three directions, so it lives in the torus T^3, where it is closed. T^3
is a product of circles in R^6; one equation on it is the gyroid. Cut open again, it fills a cube.
"""

import numpy as np
import stellate


def gyroid(p):
    c1, s1, c2, s2, c3, s3 = p.T
    return s1 * c2 + s2 * c3 + s3 * c1


def gradient(p):
    c1, s1, c2, s2, c3, s3 = p.T
    return np.stack([s3, c2, s1, c3, s2, c1], axis=1)


torus = stellate.manifolds.ProductOfCircles((1, 1, 1))
mesh = stellate.mesh(stellate.oracles.LevelSet(torus, gyroid, gradient), epsilon=0.2)

angles = np.arctan2(mesh.points[:, 1::2], mesh.points[:, ::2])
corners = angles[mesh.simplices]
corners -= 2 * np.pi * np.round((corners - corners[:, :1]) / (2 * np.pi))  # across the cube's sides
cube = stellate.Mesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
cube.plot(frame=False, view=(25, -50), color=2).figure.savefig("gyroid.png")
