"""Rotations that fulfil an equation

A function on a manifold, and where it vanishes: here on SO(3), which is a torus in R^9. The
manifold's oracle is ready; the function is one line.
"""

import numpy as np
import stellate

weights = np.diag([1.0, 2.0, 4.0]).ravel()
rotations = stellate.manifolds.SpecialOrthogonal3()
surface = stellate.oracles.LevelSet(
    rotations, lambda r: r @ weights, lambda r: np.broadcast_to(weights, r.shape)
)
mesh = stellate.mesh(surface, epsilon=0.2)
axes = mesh.plot(coordinates=[2, 6, 3], color=1, colormap="coolwarm", frame=False, view=(30, 30))
axes.figure.savefig("level_set.png")
