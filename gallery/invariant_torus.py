"""The invariant torus of an ODE

Two van der Pol oscillators, weakly coupled. Their motion tends to a torus in R^4 that no formula
gives: one long trajectory fills it, and the mesh is made through the points that it left.
"""

import numpy as np
import stellate
from scipy.integrate import solve_ivp


def flow(t, state):
    x, v, y, w = state
    return [v, 0.3 * (1 - x**2) * v - x + 0.1 * (y - x),
            w, 0.3 * (1 - y**2) * w - 2.6 * y + 0.1 * (x - y)]  # fmt: skip


times = np.linspace(100, 2400, 40000)
run = solve_ivp(flow, (0, times[-1]), [2, 0, 0, 2], t_eval=times, rtol=1e-8)
torus = stellate.oracles.PointCloud(run.y.T, 2, bandwidth=0.35)
print(f"the trajectory keeps within {torus.residual:.2g} of the surface")
mesh = stellate.mesh(torus, epsilon=0.3)

tilted = [[1, 0, 0.45, 0], [0, 1, 0, 0.3], [0, 0.2, 0.9, 0.2]]
axes = mesh.plot(coordinates=tilted, color=3, frame=False, view=(40, -50))
axes.figure.savefig("invariant_torus.png")
