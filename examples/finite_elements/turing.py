"""A Turing pattern on a double torus: Schnakenberg's two substances, which react and diffuse.

From even concentrations and a little noise, spots grow. At first each eigenfunction of the Laplacian
grows on its own, at a rate that a 2 x 2 matrix tells; in the end the surface chooses the spots.
"""

import elements
import numpy as np
import scipy.sparse.linalg
import stellate

A, B = 0.1, 0.9  # supplies of the substances
D = np.array([1.0, 10.0])  # their diffusion
GAMMA = 300.0  # of the reaction against it: the larger, the more spots
EVEN = np.array([A + B, B / (A + B) ** 2])  # where the reaction rests
JACOBIAN = np.array([[2 * EVEN[0] * EVEN[1] - 1, EVEN[0] ** 2],
                     [-2 * EVEN[0] * EVEN[1], -EVEN[0] ** 2]])  # fmt: skip


def double_torus(p):
    x, y, z = p.T
    left = (np.hypot(x + 0.75, y) - 0.6) ** 2 + z**2
    right = (np.hypot(x - 0.75, 0.9 * y) - 0.6) ** 2 + z**2
    return 0.5 - np.exp(-10 * left) - np.exp(-10 * right)


def surface(epsilon):
    oracle = stellate.oracles.SignedDistance(
        double_torus, bounding_box=([-1.7, -1.3, -0.5], [1.7, 1.3, 0.5]), thread_safe=True
    )
    return stellate.mesh(oracle, epsilon, require_certified=True)


def growth(eigenvalue):
    """How fast an eigenfunction of the Laplacian grows while the pattern is faint."""
    return np.linalg.eigvals(GAMMA * JACOBIAN - np.diag(eigenvalue * D)).real.max()


def fastest(stiffness, mass):
    """The eigenvalue and eigenfunction of the discrete Laplacian that grow fastest."""
    guesses = np.linspace(0, GAMMA, 2000)
    best = guesses[np.argmax([growth(t) for t in guesses])]
    values, functions = scipy.sparse.linalg.eigsh(stiffness, 8, mass, sigma=best)
    i = np.argmax([growth(t) for t in values])
    return values[i], functions[:, i]


def react(u):
    return GAMMA * np.stack([A - u[0] + u[0] ** 2 * u[1], B - u[0] ** 2 * u[1]])


def steps(stiffness, mass, start, step, count):
    """Diffusion implicit, reaction explicit, both of second order (SBDF2). Yields (2, n) each."""
    first = [scipy.sparse.linalg.factorized(mass + step * d * stiffness) for d in D]
    then = [scipy.sparse.linalg.factorized(1.5 * mass + step * d * stiffness) for d in D]
    old, u = start, start
    for i in range(count):
        if i == 0:
            right, solves = u + step * react(u), first
        else:
            right = 2 * u - old / 2 + step * (2 * react(u) - react(old))
            solves = then
        old, u = u, np.stack([solve(mass @ row) for solve, row in zip(solves, right)])
        yield u


def noise(n, size, seed=1):
    return EVEN[:, None] + size * np.random.default_rng(seed).normal(size=(2, n))


if __name__ == "__main__":
    mesh = surface(0.07)
    stiffness, mass = elements.assemble(mesh)
    eigenvalue, function = fastest(stiffness, mass)
    *_, pattern = steps(stiffness, mass, noise(len(mesh.points), 0.01), 5e-4, 3000)
    print(f"fastest: the eigenfunction to {eigenvalue:.1f}, at a rate of {growth(eigenvalue):.2f}")
    print(f"the first substance lies between {pattern[0].min():.2f} and {pattern[0].max():.2f}")
    axes = mesh.plot(color=pattern[0], frame=False, edges=False, view=(60, -85))
    axes.figure.savefig("turing.png")
