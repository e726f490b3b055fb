"""Complexes known beforehand."""

import itertools

import numpy as np
import stellate


def polygon(count: int, ambient_dimension: int = 2) -> stellate.Mesh:
    angle = 2 * np.pi * np.arange(count) / count
    points = np.zeros((count, ambient_dimension))
    points[:, 0], points[:, 1] = np.cos(angle), np.sin(angle)
    edges = np.sort([[i, (i + 1) % count] for i in range(count)], axis=1)
    return stellate.Mesh(points, edges[np.lexsort(edges.T[::-1])])


def simplex_boundary(dimension: int) -> stellate.Mesh:
    """The boundary of a (k+1)-simplex: a k-sphere in R^(k+1)."""
    points = np.vstack([np.eye(dimension + 1), np.full(dimension + 1, -0.7)])
    return stellate.Mesh(
        points, np.array(list(itertools.combinations(range(dimension + 2), dimension + 1)))
    )


def projective_plane(ambient_dimension: int = 5) -> stellate.Mesh:
    """RP^2 with six vertices, not orientable."""
    triangles = ["012", "023", "034", "045", "015", "124", "235", "134", "245", "135"]
    rows = np.array([[int(c) for c in t] for t in triangles])
    return stellate.Mesh(np.eye(6, ambient_dimension) + 0.1, rows)


def torus(columns: int = 12, rows: int = 7) -> stellate.Mesh:
    u, v = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    a, b = 2 * np.pi * u / columns, 2 * np.pi * v / rows
    ring = 1 + 0.4 * np.cos(b)
    points = np.stack([ring * np.cos(a), ring * np.sin(a), 0.4 * np.sin(b)], axis=-1).reshape(-1, 3)

    def at(i, j):
        return (i % columns) * rows + j % rows

    lower = np.stack([at(u, v), at(u + 1, v), at(u + 1, v + 1)], axis=-1).reshape(-1, 3)
    upper = np.stack([at(u, v), at(u + 1, v + 1), at(u, v + 1)], axis=-1).reshape(-1, 3)
    triangles = np.sort(np.concatenate([lower, upper]), axis=1)
    return stellate.Mesh(points, triangles[np.lexsort(triangles.T[::-1])])


def equation(f, jacobian=None):
    """A surface in a cube, by one equation."""
    return stellate.ImplicitManifold(
        f, jacobian, ambient_dimension=3, dimension=2, bounding_box=([-1.4] * 3, [1.4] * 3)
    )
