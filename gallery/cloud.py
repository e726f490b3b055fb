"""A cloud of points

Points measured on a surface, with noise, and nothing else known of it: a plane is fitted to the
neighbours of each place, and the mesh is of what the planes agree on.
"""

import numpy as np
import stellate

rng = np.random.default_rng(7)
u, v = rng.uniform(0, 2 * np.pi, (2, 16000))
swell = 0.4 + 0.12 * np.cos(2 * u)
ring = 1 + swell * np.cos(v)
points = np.stack([ring * np.cos(u), ring * np.sin(u), swell * np.sin(v)], axis=1)
points += rng.normal(0, 0.01, points.shape)

cloud = stellate.oracles.PointCloud(points, 2, bandwidth=0.3)
print(f"noise left: {cloud.residual:.2g}")
mesh = stellate.mesh(cloud, epsilon=0.12)
axes = mesh.plot(frame=False, view=(45, -60), color="tan")
axes.scatter(*points[::6].T, s=1, color="black")
axes.figure.savefig("cloud.png")
