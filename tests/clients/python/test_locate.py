"""Where points are on a mesh, beside a solver of its own, and the Laplacian beside closed forms."""

import numpy as np
import pytest
import stellate
from scipy.optimize import nnls
from scipy.sparse.linalg import eigsh
from scipy.spatial import ConvexHull, Delaunay


def sphere(rng, n):
    x = rng.normal(size=(n, 3))
    x /= np.linalg.norm(x, axis=1)[:, None]
    return stellate.Mesh(x, np.unique(np.sort(ConvexHull(x).simplices.astype(np.int64)), axis=0))


def nearest_by_least_squares(corners, x):
    """The distance of x from one simplex: weights that are not negative, their sum held by a row."""
    heavy = 1e6
    weights, _ = nnls(np.vstack([corners.T, heavy * np.ones(len(corners))]), np.append(x, heavy))
    return np.linalg.norm(weights @ corners / weights.sum() - x)


@pytest.mark.parametrize("k, d", [(1, 2), (1, 5), (2, 3), (2, 6), (3, 3), (3, 9)])
def test_the_nearest_point_is_the_nearest(rng, k, d):
    flat = np.zeros((25, d))
    flat[:, :k] = rng.uniform(size=(25, k))
    simplices = Delaunay(flat[:, :k]).simplices if k > 1 else None
    if simplices is None:
        order = np.argsort(flat[:, 0])
        simplices = np.stack([order[:-1], order[1:]], axis=1)
    points = flat + 0.2 * rng.normal(size=flat.shape)
    mesh = stellate.Mesh(points, np.sort(simplices.astype(np.int64)))
    asked = rng.uniform(-1, 2, size=(40, d))
    found = mesh.locate(asked)
    assert (found.weights >= 0).all()
    assert np.abs(found.weights.sum(axis=1) - 1).max() < 1e-12
    corners = points[mesh.simplices]
    at = np.einsum("qc,qcd->qd", found.weights, corners[found.simplices])
    assert np.abs(at - found.points).max() < 1e-12
    assert np.abs(np.linalg.norm(asked - at, axis=1) - found.distances).max() < 1e-12
    for x, distance in zip(asked, found.distances):
        least = min(nearest_by_least_squares(simplex, x) for simplex in corners)
        assert distance == pytest.approx(least, abs=1e-6)


def test_vertices_are_on_themselves_and_the_first_simplex_counts(rng):
    mesh = sphere(rng, 200)
    found = mesh.locate(mesh.points)
    assert found.distances.max() < 1e-12
    first = [np.flatnonzero((mesh.simplices == i).any(axis=1))[0] for i in range(200)]
    assert found.simplices.tolist() == first


def test_many_points_are_located_piece_by_piece(rng, monkeypatch):
    mesh = sphere(rng, 300)
    asked = rng.normal(size=(500, 3))
    whole = mesh.locate(asked)
    monkeypatch.setattr(stellate._locate, "_AT_A_TIME", 7)
    assert mesh.locate(asked).simplices.tolist() == whole.simplices.tolist()


def test_a_flat_simplex_is_its_faces():
    line = stellate.Mesh(np.array([[0.0, 0], [1, 0], [2, 0]]), np.array([[0, 1, 2]]))
    found = line.locate([[1.5, 1.0], [-1, 0]])
    assert found.points.tolist() == [[1.5, 0], [0, 0]]
    with pytest.raises(stellate.InvalidArgument, match="simplex 0 is flat"):
        line.laplacian()


@pytest.mark.parametrize(
    "points, cure",
    [([[0.0, 0]], "2 coordinates"), ([[0, 0, np.nan]], "row 0"), ([], r"\(n, d\)")],
)
def test_what_cannot_be_located_is_refused(rng, points, cure):
    with pytest.raises(stellate.InvalidArgument, match=cure):
        sphere(rng, 20).locate(points)


def test_a_mesh_without_simplices_is_refused():
    empty = stellate.Mesh(np.zeros((3, 2)), np.empty((0, 2), dtype=np.int64))
    with pytest.raises(stellate.InvalidArgument, match="no simplices"):
        empty.locate([[0.0, 0]])


def test_the_laplacian_of_a_circle_in_space():
    t = np.linspace(0, 2 * np.pi, 401)[:-1]
    circle = np.stack([np.cos(t), np.sin(t), 0 * t, 0 * t], axis=1)
    rows = np.sort(np.stack([np.arange(400), (np.arange(400) + 1) % 400], axis=1))
    stiffness, mass = stellate.Mesh(circle, rows).laplacian()
    values = eigsh(stiffness, 7, mass, sigma=-0.1, return_eigenvectors=False)
    assert np.sort(values) == pytest.approx([0, 1, 1, 4, 4, 9, 9], abs=2e-3)


def octahedron(halvings):
    """A sphere: the octahedron, each triangle cut into four so many times."""
    points = np.concatenate([np.eye(3), -np.eye(3)])
    rows = np.array([[a, b, c] for a in (0, 3) for b in (1, 4) for c in (2, 5)])
    for _ in range(halvings):
        corners = points[rows]
        middles = corners + np.roll(corners, -1, axis=1)
        middles /= np.linalg.norm(middles, axis=2)[:, :, None]
        (a, b, c), (ab, bc, ca) = corners.swapaxes(0, 1), middles.swapaxes(0, 1)
        pieces = [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        every = np.concatenate([np.stack(piece, axis=1) for piece in pieces])
        points, at = np.unique(every.reshape(-1, 3).round(12), axis=0, return_inverse=True)
        rows = at.reshape(-1, 3)
    return stellate.Mesh(points, np.sort(rows))


def test_the_laplacian_of_a_sphere_falls_with_the_square_of_the_spacing():
    errors = []
    for halvings in (3, 4):
        stiffness, mass = octahedron(halvings).laplacian()
        assert np.abs(stiffness.sum(axis=1)).max() < 1e-12
        values = np.sort(eigsh(stiffness, 9, mass, sigma=-0.1, return_eigenvectors=False))
        errors.append(np.abs(values - [0, 2, 2, 2, 6, 6, 6, 6, 6]).max())
    assert errors[1] < 0.1
    assert 3.3 < errors[0] / errors[1] < 4.7
