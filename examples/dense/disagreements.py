"""However dense a sample of a 3-manifold is, stars in tangent spaces disagree about it.

Uniform random points of the flat tori T^2 in R^4 and T^3 in R^6. The star of p is the Voronoi cell of p in its
tangent space; a simplex is doubtful if some star of its vertices has it and another has not.

    disagreements.py [SIZE ...]     numbers of points; default 1000 2000 4000 8000
"""

import sys
from collections import Counter

import numpy as np
import stellate
from scipy.spatial import ConvexHull, cKDTree
from stellate import manifolds


def star(p, points, tangent, tree, near=60):
    """The simplices at p. The cell's polar body is a hull, with a facet for each of them."""
    while True:
        distances, ids = tree.query(points[p], k=min(near, len(points)))
        away = points[ids[1:]] - points[p]
        hull = ConvexHull(2 * (away @ tangent) / (away**2).sum(axis=1, keepdims=True))
        radius = -1 / hull.equations[:, -1]  # of the simplices, if all are positive
        if near >= len(points) or (radius.min() > 0 and 2 * radius.max() <= distances[-1]):
            return [tuple(sorted((p, *ids[1 + one]))) for one in hull.simplices]
        near *= 2


def doubtful(points, tangents):
    """How many simplices are in some, but not in all stars of their vertices."""
    tree = cKDTree(points)
    held = Counter(s for p in range(len(points)) for s in star(p, points, tangents[p], tree))
    return sum(count < len(simplex) for simplex, count in held.items())


def flat_torus(k):
    return manifolds.ProductOfCircles((1.0,) * k)


def uniform(k, n, seed=1):
    angles = np.random.default_rng(seed).uniform(0, 2 * np.pi, (n, k))
    return np.stack([np.cos(angles), np.sin(angles)], axis=2).reshape(n, 2 * k)


def row(k, n):
    points = uniform(k, n)
    return doubtful(points, flat_torus(k).tangent_basis(points))


if __name__ == "__main__":
    sizes = [int(word) for word in sys.argv[1:]] or [1000, 2000, 4000, 8000]
    print("points      h, k = 2   doubtful      h, k = 3   doubtful")
    for n in sizes:
        print(f"{n:6}", end="")
        for k in (2, 3):
            print(f"{2 * np.pi / n ** (1 / k):14.3f}{row(k, n):11}", end="")
        print()
    for k, epsilon, share in ((2, 0.2, 0.1), (3, 0.4, 0.02)):
        mesh = stellate.mesh(flat_torus(k), epsilon, protection=share)
        left = doubtful(mesh.points, flat_torus(k).tangent_basis(mesh.points))
        weak = mesh.report.certificate.protection.weak
        print(f"protected, k = {k}: {len(mesh.points)} points, {weak} weak, {left} doubtful")
