"""Heat on the rotations of space: a hot spot in SO(3) cools, in the end at the rate of the theory.

The slowest that a difference of temperatures can decay is exp(-t): 1 is the least eigenvalue above
zero of the Laplacian of SO(3) in R^9, with the entries of the rotations for eigenfunctions.
"""

import elements
import numpy as np
import scipy.sparse.linalg
import stellate


def cool(epsilon, step=0.05, end=4.0):
    """Crank-Nicolson's scheme. Returns: the times, the temperatures (times, n), the mass matrix."""
    mesh = stellate.mesh(stellate.manifolds.SpecialOrthogonal3(), epsilon, require_certified=True)
    stiffness, mass = elements.assemble(mesh)
    solve = scipy.sparse.linalg.factorized(mass + step / 2 * stiffness)
    trace = mesh.points[:, [0, 4, 8]].sum(axis=1)
    temperatures = [np.exp(2 * (trace - 3))]  # hot at the identity
    times = np.arange(0, end + step / 2, step)
    for _ in times[1:]:
        before = temperatures[-1]
        temperatures.append(solve(mass @ before - step / 2 * (stiffness @ before)))
    return times, np.array(temperatures), mass


def decay_rate(times, temperatures, mass):
    """Of the distance to the mean temperature, over the last quarter of the time."""
    volume = mass.sum()
    means = (temperatures @ mass).sum(axis=1) / volume
    off = temperatures - means[:, None]
    distances = np.sqrt(np.einsum("tn,tn->t", off @ mass, off))
    late = times >= 0.75 * times[-1]
    return -np.polyfit(times[late], np.log(distances[late]), 1)[0]


if __name__ == "__main__":
    for epsilon in (0.6, 0.45, 0.35):
        times, temperatures, mass = cool(epsilon)
        heat = (temperatures @ mass).sum(axis=1)
        print(
            f"epsilon {epsilon}: {mass.shape[0]:,} vertices, decays at {decay_rate(times, temperatures, mass):.4f}"
            f" for 1; heat kept to {abs(heat / heat[0] - 1).max():.1e}"
        )
