"""What takes a function of points, for tests of what it may return."""

import numpy as np
import stellate
from ready_shapes import TORUS, TURN, norm2, torus_map, veronese
from stellate import manifolds, oracles

CUBE = [-1.5] * 3, [1.5] * 3


def sphere(x):
    return np.sqrt(norm2(x)) - 1


def implicit(f, jacobian=None, **more):
    return stellate.ImplicitManifold(
        f, jacobian, ambient_dimension=3, dimension=2, bounding_box=CUBE, **more
    )


def constraints(f):
    return oracles.ConstraintSet([f], ambient_dimension=3, bounding_box=CUBE)


# Each ready oracle that takes a function of points: what makes it, and a function that it takes.
TAKERS = {
    "ImplicitManifold": (implicit, sphere),
    "SignedDistance": (lambda f: oracles.SignedDistance(f, bounding_box=CUBE), sphere),
    "ConstraintSet": (constraints, sphere),
    "LevelSet": (lambda f: oracles.LevelSet(TORUS, f), lambda x: x[:, 0] - 0.3),
    "Clipped": (lambda f: oracles.Clipped(TORUS, [f]), lambda x: x[:, 0] - 0.3),
    "Solid": (lambda f: oracles.Solid(f, CUBE), lambda x: -sphere(x)),
    "Quotient": (lambda f: oracles.Quotient(manifolds.Sphere(2), f), veronese),
    "Parametrized": (
        lambda f: oracles.Parametrized(f, None, [0, 0], [TURN] * 2, True),
        torus_map,
    ),
}
SEVERAL = ["Quotient", "Parametrized"]  # values a point


def ask(oracle):
    """About all that its functions are asked for."""
    x = np.random.default_rng(1).uniform(-1, 1, (20, oracle.ambient_dimension))
    if hasattr(oracle, "clearances"):
        oracle.clearances(x)
    oracle.closest_point(x)
