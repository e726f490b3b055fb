"""What a neural network learned

A network of 450 Gaussian units is shown samples of where two linked rings are, and fits them by least
squares. Its level set is meshed: values and gradients are all that is asked of it.
"""

import numpy as np
import stellate

rng = np.random.default_rng(1)
x = rng.uniform([-1.2, -1.2, -1.2], [1.9, 1.2, 1.2], (8000, 3))
ring_a = np.hypot(np.hypot(x[:, 0], x[:, 1]) - 0.7, x[:, 2])
ring_b = np.hypot(np.hypot(x[:, 0] - 0.7, x[:, 2]) - 0.7, x[:, 1])
there = np.exp(-18 * ring_a**2) + np.exp(-18 * ring_b**2)
centres = x[there > 0.1][:450]


def units(p):
    return np.exp(-12 * ((p[:, None, :] - centres) ** 2).sum(axis=2))


weights, *_ = np.linalg.lstsq(units(x), there, rcond=1e-6)


def slope(p):
    return -24 * np.einsum("nj,nji->ni", units(p) * weights, p[:, None, :] - centres)


box = [-1.2, -1.2, -1.2], [1.9, 1.2, 1.2]
learned = stellate.oracles.SignedDistance(
    lambda p: units(p) @ weights, slope, bounding_box=box, level=0.4
)
mesh = stellate.mesh(learned, epsilon=0.08)
mesh.plot(frame=False, view=(35, -60)).figure.savefig("neural.png")
