"""Sizes that an oracle gives: graded meshes through the real server, and sizes that make no sense."""

import re

import numpy as np
import pytest
import stellate
import topology
from stellate import manifolds
from stellate.oracle import CheckedOracle


def least_vertices(area, radius):
    """Of a surface whose triangles have at most this circumradius: two a vertex cover it."""
    return area / (2 * 0.75 * 3**0.5 * radius**2)


def largest_share(oracle, mesh):
    """The largest circumradius of a triangle over the size at one of its vertices."""
    a, b, c = (mesh.points[mesh.simplices[:, i]] for i in range(3))
    sides = [np.linalg.norm(v, axis=1) for v in (b - c, c - a, a - b)]
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    radii = sides[0] * sides[1] * sides[2] / (4 * area)
    return (radii / oracle.local_size(mesh.points)[mesh.simplices].min(axis=1)).max()


SPHEROID = 0.99**0.5

# name: (oracle, epsilon, area, reach, Euler characteristic)
THIN = {
    "torus": (manifolds.Torus(1.0, 0.9), 0.5, 4 * np.pi**2 * 0.9, 0.1, 0),
    "ellipsoid": (
        manifolds.ellipsoid((1.0, 1.0, 10.0)),
        0.8,
        2 * np.pi * (1 + 10 / SPHEROID * np.arcsin(SPHEROID)),
        0.1,
        2,
    ),
}


@pytest.mark.parametrize("name", THIN)
def test_local_feature_size_spares_most_of_a_mesh(name, server):
    oracle, epsilon, area, reach, euler = THIN[name]
    mesh = stellate.mesh(oracle, epsilon, server=server, size_rate=0.4)
    assert mesh.certified, mesh.report
    topology.assert_closed_manifold(mesh, euler)
    assert largest_share(oracle, mesh) <= 0.4 * (1 + 1e-9)
    assert 10 * len(mesh.points) < least_vertices(area, 0.4 * reach)


class TwoSpheres:
    """Unit spheres about the origin and (3, 0, 0), a unit apart."""

    dimension, ambient_dimension = 2, 3
    bounding_box = [-1.1] * 3, [4.1, 1.1, 1.1]

    def centers(self, x):
        return np.where(x[:, :1] > 1.5, [3.0, 0, 0], 0.0)

    def closest_point(self, x):
        away = x - self.centers(x)
        return x - away + away / np.linalg.norm(away, axis=1, keepdims=True)

    def local_size(self, points):
        return np.minimum(1, np.abs(points[:, 0] - 1.5))


class Sizeless:
    """An oracle without its sizes."""

    def __init__(self, oracle):
        for name in (
            "dimension",
            "ambient_dimension",
            "bounding_box",
            "closest_point",
            "tangent_basis",
        ):
            if hasattr(oracle, name):
                setattr(self, name, getattr(oracle, name))


# As the page calls them.
COMPARED = {
    "torus 1:0.9": manifolds.Torus(1.0, 0.9),
    "ellipsoid 1:1:10": manifolds.ellipsoid((1.0, 1.0, 10.0)),
    "two spheres a unit apart": TwoSpheres(),
}


@pytest.mark.parametrize("name", COMPARED)
def test_the_page_tells_how_many_vertices_graded_meshes_have(name, server, repository):
    page = (repository / "docs" / "using" / "sizes.md").read_text()
    row = re.search(rf"(?m)^\| {name}, `size_rate` 0.4 (\|.*)$", page)[1]
    _, *told = (int(count.replace(",", "")) for count in re.findall(r"\| ([\d,]+)", row))
    oracle = COMPARED[name]
    meshes = [
        stellate.mesh(one, 0.5, server=server, size_rate=0.4) for one in (Sizeless(oracle), oracle)
    ]
    assert all(mesh.certified for mesh in meshes)
    # On another machine oracles round otherwise.
    assert [len(mesh.points) for mesh in meshes] == pytest.approx(told, rel=0.05), "mend the page"


def test_a_field_of_ones_own(server):
    class Painted(manifolds.Sphere):
        def local_size(self, points):
            return 0.05 + 0.2 * (1 + points[:, 2])

    oracle = Painted()
    mesh = stellate.mesh(oracle, 0.4, server=server, size_rate=1.0)
    assert mesh.certified, mesh.report
    assert largest_share(oracle, mesh) <= 1 + 1e-9
    plain = stellate.mesh(manifolds.Sphere(), 0.05, server=server)
    assert 4 * len(mesh.points) < len(plain.points)


def test_sizes_are_asked_for_only_with_a_criterion(server):
    class Torus(manifolds.Torus):
        def local_size(self, points):
            raise AssertionError("nobody needs it")

    assert stellate.mesh(Torus(), 0.3, server=server).certified


def test_a_missing_closest_point_has_no_size(server):
    class Flaky(manifolds.Torus):
        def closest_point(self, x):
            p = super().closest_point(x)
            raise stellate.NotConverged(p, np.abs(x).sum(axis=1) <= 2.2)

    assert stellate.mesh(Flaky(), 0.3, server=server, size_rate=0.5).certified


class Changing:
    """A size that grows with every call."""

    def __init__(self):
        self.calls = 0

    def __call__(self, points):
        self.calls += 1
        return np.full(len(points), float(self.calls))


@pytest.mark.parametrize(
    "size, reason, words",
    [
        (lambda p: np.full(len(p), np.nan), "ORACLE_NOT_FINITE", "local_size"),
        (lambda p: np.full(len(p), np.inf), "ORACLE_NOT_FINITE", "local_size"),
        (lambda p: np.zeros(len(p)), "ORACLE_BAD_SIZE", "size .* 0 "),
        (lambda p: np.full(len(p), -2.0), "ORACLE_BAD_SIZE", "size .* -2 "),
        (lambda p: np.ones(len(p) - 1), "ORACLE_SHAPE", "local_size"),
        (lambda p: np.ones((len(p), 1)), "ORACLE_SHAPE", "local_size"),
        (lambda p: ["large"] * len(p), "ORACLE_SHAPE", "local_size"),
        (Changing(), "ORACLE_BAD_SIZE", "point alone"),
    ],
)
def test_sizes_that_break_a_rule(size, reason, words, server):
    oracle = manifolds.Torus()
    oracle.local_size = size
    with pytest.raises(stellate.OracleError, match=words) as caught:
        stellate.mesh(oracle, 0.3, server=server, size_rate=0.5)
    assert caught.value.reason == reason
    assert stellate.mesh(manifolds.Torus(), 0.3, server=server, size_rate=0.5).certified


def test_a_worker_without_sizes_leaves_a_mesh_of_sizes_alone(client):
    class Sizeless(manifolds.Torus):
        local_size = None

    info = client.create(manifolds.Torus(), 0.3, size_rate=0.5)
    try:
        with pytest.raises(stellate.InvalidArgument, match="local_size"):
            client.serve(Sizeless(), info.name)
    finally:
        client.delete(info.name)


@pytest.mark.parametrize(
    "oracle",
    [
        manifolds.Torus(1.0, 0.7),
        manifolds.ellipsoid((1.0, 0.8, 0.6)),
        manifolds.ellipsoid((1.0, 1.0, 3.0)),
        manifolds.ellipsoid((2.0, 1.0)),
        manifolds.Sphere(2, 5, radius=0.5),
        manifolds.ProductOfCircles((1.0, 0.3)),
        manifolds.SpecialOrthogonal3(),
    ],
)
def test_given_sizes_are_local_feature_sizes(oracle, rng):
    """Up to that length along normals a point's foot stays where it is; for some, not beyond."""
    lower, upper = oracle.bounding_box
    p = oracle.closest_point(rng.uniform(lower, upper, (400, oracle.ambient_dimension)))
    bases = oracle.tangent_basis(p)
    n = rng.standard_normal(p.shape)
    n -= (bases @ (bases.transpose(0, 2, 1) @ n[..., None]))[..., 0]
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    sizes = CheckedOracle(oracle).sizes(p, np.ones(len(p), dtype=bool))
    assert sizes.shape == (400,) and (sizes > 0).all()
    there = p + 0.99 * sizes[:, None] * n
    assert np.abs(oracle.closest_point(there) - p).max() < 1e-6
    order = np.argsort(sizes)  # 1-Lipschitz: neighbours in size, and any others
    gaps = np.linalg.norm(p[order[1:]] - p[order[:-1]], axis=1)
    assert (np.diff(sizes[order]) <= gaps + 1e-9).all()
