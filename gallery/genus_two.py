"""A double torus, graded

Two tori, melted into one surface. Triangles are smaller where it bends more: `size_rate` grades them
by the distance to the medial axis, which the server estimates.
"""

import numpy as np
import stellate


def f(p):
    x, y, z = p.T
    left = (np.hypot(x + 0.75, y) - 0.6) ** 2 + z**2
    right = (np.hypot(x - 0.75, 0.7 * y) - 0.6) ** 2 + 2 * z**2
    return 0.5 - np.exp(-12 * left) - np.exp(-12 * right)


surface = stellate.oracles.SignedDistance(
    f, bounding_box=([-1.7, -1.3, -0.4], [1.7, 1.3, 0.4]), thread_safe=True
)
mesh = stellate.mesh(surface, epsilon=0.2, size_rate=0.3)

sizes = np.linalg.norm(np.ptp(mesh.points[mesh.simplices], axis=1), axis=1)
print(f"triangles from {sizes.min():.3f} to {sizes.max():.3f}")
axes = mesh.plot(view=(50, -70), edges=True, frame=False)
axes.figure.savefig("genus_two.png")
