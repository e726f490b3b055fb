"""A surface, meshed again

A file of long thin triangles, as a program for drawing makes them, and the same surface in
triangles of one size.
"""

import matplotlib.pyplot as plt
import numpy as np
import stellate

# What was there: a vase's ring, 120 steps around and 24 across.
around, across = np.meshgrid(np.arange(120), np.arange(24), indexing="ij")
u, v = around.ravel() * 2 * np.pi / 120, across.ravel() * 2 * np.pi / 24
radius = 1 + (0.42 + 0.05 * np.sin(3 * u)) * np.cos(v)
points = np.stack([radius * np.cos(u), radius * np.sin(u), 0.45 * np.sin(v)], axis=1)
a, b = around.ravel(), across.ravel()
corner = lambda i, j: (a + i) % 120 * 24 + (b + j) % 24  # noqa: E731
triangles = np.concatenate([np.stack([corner(0, 0), corner(1, 0), corner(1, 1)], 1),
                            np.stack([corner(0, 0), corner(1, 1), corner(0, 1)], 1)])  # fmt: skip
old = stellate.Mesh(points, triangles)
old.save("old.stl")

mesh = stellate.mesh(stellate.oracles.TriangleMesh("old.stl"), epsilon=0.12)
figure = plt.figure(figsize=(4.8, 2.4), layout="constrained")
old.plot(
    ax=figure.add_subplot(121, projection="3d"), frame=False, color="tan", edges=True, view=(50, 0)
)
mesh.plot(ax=figure.add_subplot(122, projection="3d"), frame=False, view=(50, 0))
figure.savefig("remeshed.png")
