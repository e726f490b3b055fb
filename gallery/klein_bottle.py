"""The Klein bottle

In R^4 it needs not pass through itself; in the picture, where the fourth coordinate is a colour, it
does. The chart goes around twice.
"""

import numpy as np
import stellate


def bottle(u):
    a, b = u.T
    ring = 1.5 + 0.6 * np.cos(b)
    lift = 0.6 * np.sin(b)
    return np.stack([ring * np.cos(a), ring * np.sin(a),
                     lift * np.cos(a / 2), lift * np.sin(a / 2)], axis=1)  # fmt: skip


oracle = stellate.oracles.Parametrized(bottle, None, [0, 0], [4 * np.pi, 2 * np.pi], periodic=True)
mesh = stellate.mesh(oracle, epsilon=0.2)
axes = mesh.plot(color=3, colormap="twilight", frame=False, view=(35, 20))
axes.figure.savefig("klein_bottle.png")
