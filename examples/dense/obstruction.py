"""One tetrahedron, two circumcentres, no ball with a point in it: in samples as dense as one likes (Chapter 6).

M is the graph in R^4 of a quadratic form on R^3. Three of its points lie near a circle of radius eps. The points of M
equidistant from them are a curve, which bends by eps^3: so does what they are to a fourth point, which can be
placed, some eps^3 off their plane, as far as they are from two places of the curve. Between the two it is
nearer than they are. The rest of the sample stays out of both balls.
"""

import numpy as np
from scipy.optimize import root
from scipy.spatial import cKDTree

FORM = np.array([1.0, -1.0, 0.7]) / 2
SIZES = (0.4, 0.2, 0.1, 0.05, 0.025)


def lift(x):
    """(..., 3) -> (..., 4), on M."""
    x = np.asarray(x, dtype=float)
    return np.concatenate([x, (FORM * x**2).sum(axis=-1, keepdims=True)], axis=-1)


def on_circle(angle, radius, height):
    return lift([radius * np.cos(angle), radius * np.sin(angle), height])


def power(centre, q, p):
    """How much farther, squared, q is from the centre than p, without cancellation."""
    return (q - p) @ (q + p - 2 * centre)


def centre(triangle, height):
    """The point of M at this height that is equidistant from the three."""
    p, q, r = triangle

    def unequal(x):
        c = lift([*x, height])
        return power(c, q, p), power(c, r, p)

    return lift([*root(unequal, [0.0, 0.0], tol=1e-15).x, height])


def configuration(eps):
    """The tetrahedron, its two centres, and by how much the fourth point is nearer than the others between these."""
    triangle = np.array([on_circle(angle, eps, 0.0) for angle in (0.1, 2.2, 4.3)])
    low, high = centre(triangle, -0.2 * eps), centre(triangle, 0.25 * eps)

    def fourth(x):
        return on_circle(5.3, eps * (1 + eps**2 * x[0]), eps**3 * x[1])

    def unequal(x):
        return [power(c, fourth(x), triangle[0]) / eps**4 for c in (low, high)]

    found = root(unequal, [0.0, 0.0], tol=1e-13).x
    middle = centre(triangle, 0.025 * eps)
    nearer = -power(middle, fourth(found), triangle[0]) / (2 * eps)
    return np.array([*triangle, fourth(found)]), np.array([low, high]), nearer, found[1] * eps**3


def dense_sample(corners, centres, eps, spacing=0.6):
    """The four, and an even sample of M around them that leaves the balls of both centres empty."""
    pool = lift(np.random.default_rng(0).uniform(-3 * eps, 3 * eps, (40_000, 3)))
    radii = np.linalg.norm(centres - corners[0], axis=1)
    off = np.linalg.norm(pool[:, None] - centres, axis=2) - radii
    pool = np.concatenate([corners, pool[(off > 1e-3 * eps).all(axis=1)]])
    kept = np.ones(len(pool), bool)
    for i, around in enumerate(cKDTree(pool).query_ball_point(pool, spacing * eps)):
        if kept[i]:
            kept[[j for j in around if j > max(i, 3)]] = False
    return pool[kept]


def is_empty(c, sample):
    """Whether the first four points are the four nearest, to rounding at the same distance."""
    distances, ids = cKDTree(sample).query(c, k=5)
    return set(ids[:4]) == {0, 1, 2, 3} and distances[4] > distances[3]


if __name__ == "__main__":
    print("   eps  sample  two empty balls   fourth point off the plane  nearer between, by eps^3")
    for eps in SIZES:
        corners, centres, nearer, height = configuration(eps)
        sample = dense_sample(corners, centres, eps)
        empty = all(is_empty(c, sample) for c in centres)
        print(
            f"{eps:6} {len(sample):7}  {str(empty):16}  {height / eps**3:+.4f} eps^3"
            f"{nearer / eps**3:27.5f}"
        )
