"""Rotations that a joint allows

Rotations of space that tilt the upright axis by 60 degrees at most, as a ball joint does, are a part of
SO(3) with a boundary: a solid torus in R^9. It is drawn as one, cut open: once around is the twist, and
from the middle outwards the tilt grows.
"""

import numpy as np
import stellate

tilt = stellate.oracles.HalfSpace([0, 0, 0, 0, 0, 0, 0, 0, 1], np.cos(np.radians(60)))
joint = stellate.oracles.Clipped(stellate.manifolds.SpecialOrthogonal3(), [tilt])
mesh = stellate.mesh(joint, epsilon=0.45)

r = mesh.points.reshape(-1, 3, 3)
twist = np.arctan2(r[:, 1, 0] - r[:, 0, 1], r[:, 0, 0] + r[:, 1, 1])
around = 2 + r[:, 0, 2]
drawn = np.stack([around * np.cos(twist), around * np.sin(twist), r[:, 1, 2]], axis=1)
cut, (limit,) = np.array([0.5, -1, 0]), mesh.boundary
section = stellate.Mesh(drawn, mesh.simplices).slice(cut)
skin = limit.simplices[drawn[limit.simplices].mean(axis=1) @ cut < 0]
points = np.concatenate([drawn, section.points])
triangles = np.concatenate([skin, section.simplices + len(drawn)])
color = np.concatenate([np.abs(twist), np.full(len(section.points), 4.0)])
axes = stellate.Mesh(points, triangles).plot(color=color, frame=False, view=(30, -60))
axes.figure.savefig("joint_limits.png")
