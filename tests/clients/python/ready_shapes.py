"""Ready oracles to try, one of each kind, and points to ask them about."""

import importlib.util

import numpy as np
import stellate
from stellate import oracles

TORUS = stellate.manifolds.Torus(1.0, 0.4)
TURN = 2 * np.pi


def torus_map(u):
    ring = 1 + 0.4 * np.cos(u[:, 1])
    return np.stack([ring * np.cos(u[:, 0]), ring * np.sin(u[:, 0]), 0.4 * np.sin(u[:, 1])], axis=1)


def torus_derivative(u):
    (a, b), zero = u.T, np.zeros(len(u))
    ring = 1 + 0.4 * np.cos(b)
    along = np.stack([-ring * np.sin(a), ring * np.cos(a), zero], axis=1)
    round_ = 0.4 * np.stack([-np.sin(b) * np.cos(a), -np.sin(b) * np.sin(a), np.cos(b)], axis=1)
    return np.stack([along, round_], axis=2)


def half_sphere(sign):
    """The inverse of a stereographic projection."""

    def chart(u):
        s = (u * u).sum(axis=1)
        return np.concatenate([2 * u, (sign * (1 - s))[:, None]], axis=1) / (1 + s)[:, None]

    return oracles.Chart(chart, None, [-1.3, -1.3], [1.3, 1.3])


def torus_grid(count=40):
    grid = np.stack(np.meshgrid(*[np.linspace(-1.5, 1.5, count)] * 3, indexing="ij"), axis=-1)
    return np.hypot(np.hypot(grid[..., 0], grid[..., 1]) - 1, grid[..., 2]) - 0.4


def torus_triangles(n=120, m=60):
    a, b = np.meshgrid(np.arange(n), np.arange(m), indexing="ij")
    u = np.stack([TURN * a / n, TURN * b / m], axis=-1).reshape(-1, 2)

    def number(i, j):
        return (i % n) * m + j % m

    first = np.stack([number(a, b), number(a + 1, b), number(a + 1, b + 1)], axis=-1)
    second = np.stack([number(a, b), number(a + 1, b + 1), number(a, b + 1)], axis=-1)
    return torus_map(u), np.concatenate([first.reshape(-1, 3), second.reshape(-1, 3)])


def torus_cloud(noise=0.0):
    a, b = np.meshgrid(np.arange(100) / 100, np.arange(40) / 40, indexing="ij")
    u = TURN * np.stack([a + 0.37 * b, b], axis=-1).reshape(-1, 2)  # no rows along the axes
    points = torus_map(u)
    return points + noise * np.random.default_rng(3).normal(size=points.shape)


def turned_torus():
    turn, _ = np.linalg.qr(np.random.default_rng(2).normal(size=(5, 3)))
    return oracles.Transformed(TORUS, rotation=turn, scale=2, translation=np.arange(5.0))


def clifford():
    """A torus in R^4 by two constraints, one with its gradient."""

    def slope(x):
        return 2 * x * [1, 1, 0, 0]

    return oracles.ConstraintSet(
        [(lambda x: norm2(x[:, :2]) - 1, slope), lambda x: norm2(x[:, 2:]) - 1],
        ambient_dimension=4,
        bounding_box=([-1.5] * 4, [1.5] * 4),
    )


def norm2(x):
    return (x * x).sum(axis=1)


def sines():
    """Some that are fitted to a torus: weights, shifts, coefficients."""
    rng = np.random.default_rng(4)
    weights, shifts = rng.normal(size=(3, 120)), rng.uniform(0, TURN, 120)
    places = rng.uniform(-1.6, 1.6, (4000, 3))
    features, target = np.sin(places @ weights + shifts), quartic(places)
    near = np.exp(-20 * target * target)[:, None]  # where it matters
    gram = features.T @ (near * features) + 1e-6 * np.eye(120)
    out = np.linalg.solve(gram, features.T @ (near[:, 0] * target))
    return weights, shifts, out


def network_torus(double=float):
    """Their value and gradient, by hand."""
    weights, shifts, out = (part.astype(double) for part in sines())

    def network(x):
        inside = x.astype(double) @ weights + shifts
        return np.sin(inside) @ out, (np.cos(inside) * out) @ weights.T

    return network


def torch_torus():
    """The same as a module, in single precision as modules are."""
    import torch

    class Sines(torch.nn.Module):
        def __init__(self):
            super().__init__()
            weights, shifts, out = (torch.tensor(part, dtype=torch.float32) for part in sines())
            self.weights, self.shifts = torch.nn.Parameter(weights), torch.nn.Parameter(shifts)
            self.out = torch.nn.Parameter(out)

        def forward(self, x):
            return torch.sin(x @ self.weights + self.shifts) @ self.out

    return Sines()


NETWORKS = {"numpy": network_torus}
if importlib.util.find_spec("torch"):
    NETWORKS["torch"] = torch_torus


def quartic(x):
    rho2 = norm2(x[:, :2])
    return ((rho2 + x[:, 2] ** 2 + 0.84) ** 2 - 4 * rho2) / 4


def veronese(x):
    """What RP^n is in the symmetric matrices, of all of them an isometry."""
    first, second = np.triu_indices(x.shape[1])
    return x[:, first] * x[:, second] * np.where(first == second, 1.0, np.sqrt(2))


def times(a, b):
    """Of complex numbers as pairs: numpy's own product rounds by where its arrays happen to lie."""
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]


def lens(x):
    """S^3 in C^2 under (z, w) -> (e^(2 pi i / 3) z, e^(2 pi i / 3) w): the monomials of degree 3."""
    z, w = x.T[:2], x.T[2:]
    zz, ww, root = times(z, z), times(w, w), (np.sqrt(3), 0.0)
    terms = [times(zz, z), times(root, times(zz, w)), times(root, times(z, ww)), times(ww, w)]
    return np.stack([part for term in terms for part in term], axis=1)


def klein(x):
    """A torus of two circles, once around the first of which turns the second over."""
    (c, s, a, b), two = x.T, 2.0
    along = 1 + 0.4 * a
    return np.stack(
        [along * (c * c - s * s), along * two * c * s, 0.4 * b * c, 0.4 * b * s], axis=1
    )


def circles():
    circle = stellate.manifolds.Sphere(1)
    return oracles.Product(circle, circle)


FOUR_BARS = [("a", "p", 1.0), ("p", "q", 1.3), ("q", "b", 1.1), ("q", "r", 0.5)]
GROUND = {"a": (0, 0), "b": (1.5, 0)}

# By name: how to make it, how far queries are from M, how exactly closest points are normal to it.
ALL = {
    "parametrized": (
        lambda: oracles.Parametrized(torus_map, torus_derivative, [0, 0], [TURN] * 2, True),
        0.2,
        1e-9,
    ),
    "parametrized_differences": (
        lambda: oracles.Parametrized(torus_map, None, [0, 0], [TURN, TURN], True),
        0.2,
        1e-8,
    ),
    "charts": (lambda: oracles.Parametrized(charts=[half_sphere(1), half_sphere(-1)]), 0.5, 1e-8),
    "product": (lambda: oracles.Product(TORUS, stellate.manifolds.Sphere(1)), 0.2, 1e-12),
    "transformed": (turned_torus, 0.4, 1e-12),
    "level_set": (
        lambda: oracles.LevelSet(TORUS, lambda x: x[:, 0] - 0.3 * x[:, 2] - 0.1),
        0.1,
        1e-8,
    ),
    "signed_distance": (
        lambda: oracles.SignedDistance.of_grid(torus_grid(), ([-1.5] * 3, [1.5] * 3)),
        0.2,
        1e-7,
    ),
    "constraint_set": (lambda: clifford(), 0.2, 1e-8),
    "network": (
        lambda: oracles.NeuralImplicit(network_torus(), bounding_box=([-1.5] * 3, [1.5] * 3)),
        0.1,
        1e-7,
    ),
    "projective_plane": (
        lambda: oracles.Quotient(stellate.manifolds.Sphere(2), veronese),
        0.2,
        1e-7,
    ),
    "klein_bottle": (lambda: oracles.Quotient(circles(), klein), 0.05, 1e-7),
    "lens_space": (lambda: oracles.Quotient(stellate.manifolds.Sphere(3), lens), 0.1, 1e-7),
    "linkage": (lambda: oracles.Linkage(FOUR_BARS, GROUND), 0.05, 1e-8),
    "point_cloud": (lambda: oracles.PointCloud(torus_cloud(), 2), 0.1, 1e-9),
    "triangles": (lambda: oracles.TriangleMesh(*torus_triangles()), 0.1, 1e-9),
}


def closest(oracle, x):
    try:
        return oracle.closest_point(x), np.ones(len(x), dtype=bool)
    except stellate.NotConverged as error:
        return error.points, error.converged


def near(oracle, away, count=60):
    """Points about so far from M."""
    rng = np.random.default_rng(1)
    box = getattr(oracle, "bounding_box", None)
    x = rng.uniform(*box, size=(4 * count, oracle.ambient_dimension))
    y, found = closest(oracle, x)
    y = y[found][:count]
    assert len(y) == count
    offset = rng.normal(size=y.shape)
    return y + away * offset / np.linalg.norm(offset, axis=1)[:, None]
