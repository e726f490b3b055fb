"""Manifolds with boundary from nearest points alone, from inequalities, and solids."""

import numpy as np
import pytest
import stellate
from stellate import manifolds, oracles
from test_walls import hold

TALL = 0.2  # where the cap ends
ROOM = np.full(3, -1.2), np.full(3, 1.2)


def rim_of_the_cap(x):
    flat = x[:, :2] / np.linalg.norm(x[:, :2], axis=1, keepdims=True)
    return np.column_stack([flat * np.sqrt(1 - TALL**2), np.full(len(x), TALL)])


class Points:
    """Nearest points, and nothing else."""

    def __init__(self, dimension, box, closest_point):
        self.dimension, self.ambient_dimension = dimension, len(box[0])
        self.bounding_box, self.closest_point = box, closest_point


def cap(x):
    y = x / np.linalg.norm(x, axis=1, keepdims=True)
    return np.where(y[:, 2:] < TALL, rim_of_the_cap(x), y)


CAP, RIM = Points(2, ROOM, cap), Points(1, ROOM, rim_of_the_cap)
PLANE = np.full(2, -1.5), np.full(2, 1.5)


def ends(x):
    return np.column_stack([np.sign(x[:, 0] + 1e-300), 0 * x[:, 1]])


@pytest.mark.parametrize(
    ("inner", "rim", "epsilon", "chi"),
    [
        (CAP, RIM, 0.25, 1),
        (
            Points(2, PLANE, lambda x: x / np.maximum(1, np.linalg.norm(x, axis=1))[:, None]),
            Points(1, PLANE, lambda x: x / np.linalg.norm(x, axis=1)[:, None]),
            0.2,
            1,
        ),
        (
            Points(1, PLANE, lambda x: np.column_stack([np.clip(x[:, 0], -1, 1), 0 * x[:, 1]])),
            Points(0, PLANE, ends),
            0.2,
            1,
        ),
    ],
    ids=["cap", "disc", "segment"],
)
def test_two_oracles_of_nearest_points_will_do(server, inner, rim, epsilon, chi):
    oracle = oracles.ManifoldWithBoundary(inner, rim)
    mesh = stellate.mesh(oracle, epsilon, server=server)
    hold(mesh, chi, {(0,)})
    on = mesh.points[mesh.walls > 0]
    assert np.abs(on - rim.closest_point(on)).max() < 1e-9
    assert np.abs(mesh.points - inner.closest_point(mesh.points)).max() < 1e-9
    report = stellate.check(oracle)
    assert report.ok, report


def test_the_same_from_a_larger_manifold_and_where_it_ends(server):
    oracle = oracles.ManifoldWithBoundary(
        manifolds.Sphere(2), RIM, clearance=lambda x: x[:, 2] - TALL
    )
    hold(stellate.mesh(oracle, 0.25, server=server), 1, {(0,)})
    assert stellate.check(oracle).ok


def test_normals_of_the_boundary_are_found():
    oracle = oracles.ManifoldWithBoundary(CAP, RIM)
    y = rim_of_the_cap(np.random.default_rng(1).normal(size=(20, 3)))
    down = np.array([0, 0, -1]) + TALL * y
    down /= np.linalg.norm(down, axis=1)[:, None]
    assert np.abs(oracle.conormals(y, (0,))[:, 0] - down).max() < 1e-3
    beyond = y + 0.1 * down
    assert np.allclose(oracle.clearances(beyond), -0.1, atol=1e-2)
    assert np.allclose(oracle.clearances(y), 0, atol=1e-9)


@pytest.mark.parametrize(
    ("inner", "rim", "words"),
    [
        (manifolds.Sphere(2), RIM, "do not end at the boundary"),
        (manifolds.Torus(), RIM, "away from the manifold"),
    ],
)
def test_oracles_that_do_not_belong_together_are_refused(server, inner, rim, words):
    with pytest.raises(stellate.OracleError, match=words):
        stellate.mesh(oracles.ManifoldWithBoundary(inner, rim), 0.25, server=server)


def onto_disc(radius):
    return lambda x: x / np.maximum(1, np.linalg.norm(x, axis=1) / radius)[:, None]


# A disc that ends 1e-5 before, or beyond, where its boundary is said to be.
@pytest.mark.parametrize("radius", [1 - 1e-5, 1 + 1e-5])
def test_oracles_that_disagree_about_the_end_are_told_by_how_much(radius):
    disc = Points(2, PLANE, onto_disc(radius))
    edge = Points(1, PLANE, lambda x: x / np.linalg.norm(x, axis=1)[:, None])
    on = edge.closest_point(np.random.default_rng(1).normal(size=(20, 2)))
    with pytest.raises(
        stellate.OracleError, match=r"disagree by 1e-05 .*take tolerance=\d"
    ) as told:
        oracles.ManifoldWithBoundary(disc, edge).conormals(on, (0,))
    advised = float(str(told.value).split("tolerance=")[1].split(",")[0])
    outward = oracles.ManifoldWithBoundary(disc, edge, tolerance=advised).conormals(on, (0,))
    assert np.abs(outward[:, 0] - on).max() < 1e-3


def test_bad_declarations_are_refused():
    with pytest.raises(stellate.InvalidArgument, match="has dimension 1 there, and this has 2"):
        oracles.ManifoldWithBoundary(CAP, CAP)
    half = oracles.Clipped(manifolds.Sphere(2), [oracles.HalfSpace([0, 0, 1])])
    for make in (
        lambda: oracles.ManifoldWithBoundary(half, RIM),
        lambda: oracles.Product(half, manifolds.Sphere(1)),
        lambda: oracles.Transformed(half),
        lambda: oracles.LevelSet(half, lambda x: x[:, 0]),
    ):
        with pytest.raises(stellate.InvalidArgument, match="clip it instead"):
            make()
    with pytest.raises(stellate.InvalidArgument, match="bounding_box, or a finite box or ball"):
        oracles.Solid(lambda x: 1 - (x**2).sum(axis=1))
    with pytest.raises(stellate.InvalidArgument, match="a half-space needs a normal"):
        oracles.HalfSpace([0, 0, 0])


def sphere(x):
    return (x**2).sum(axis=1, keepdims=True) - 1


@pytest.mark.parametrize("jacobian", [None, lambda x: 2 * x[:, None, :]])
def test_inequalities_bound_an_implicit_manifold(server, jacobian):
    quarter = stellate.ImplicitManifold(
        sphere,
        jacobian,
        ambient_dimension=3,
        dimension=2,
        bounding_box=ROOM,
        inequalities=[lambda x: x[:, 0], lambda x: x[:, 1] + 0.1 * x[:, 2]],
    )
    mesh = stellate.mesh(quarter, 0.3, server=server)
    hold(mesh, 1, {(0,), (1,)})
    assert sum(len(face.simplices) for face in mesh.corners) == 2
    assert stellate.check(quarter).ok


def test_inequalities_may_be_written_for_a_library(server, fake_autograd):
    half = stellate.ImplicitManifold(
        sphere,
        "autograd",
        ambient_dimension=3,
        dimension=2,
        bounding_box=ROOM,
        inequalities=[lambda x: x[:, 2]],
    )
    hold(stellate.mesh(half, 0.3, server=server), 1, {(0,)})
    assert len(fake_autograd) == 2  # the equation's and the inequality's


@pytest.fixture
def fake_autograd(monkeypatch):
    """autograd's one function that is used, by differences; it keeps what it was asked about."""
    import sys
    import types

    seen = []

    def make_vjp(f):
        def at(x):
            values = np.asarray(f(x))

            def pull_back(weights):
                if f not in seen:
                    seen.append(f)
                h = 1e-6 * np.eye(x.shape[1])
                columns = [((f(x + v) - f(x - v)) * weights).sum(axis=1) / 2e-6 for v in h]
                return np.stack(columns, axis=1)

            return pull_back, values

        return at

    monkeypatch.setitem(sys.modules, "autograd", types.SimpleNamespace(make_vjp=make_vjp))
    return seen


def test_solids_by_their_function(server):
    egg = stellate.ImplicitSolid(
        lambda x: 1 - (x**2).sum(axis=1),
        bounding_box=ROOM,
        inequalities=[lambda x: x[:, 2] + 0.2],
    )
    mesh = stellate.mesh(egg, 0.5, server=server)
    hold(mesh, 1, {(0,), (1,)})
    assert [edge.walls for edge in mesh.edges] == [(0, 1)]


def test_clipping_twice_is_clipping_by_all(server):
    half = oracles.Clipped(manifolds.Torus(), [oracles.HalfSpace([1, 0, 0])])
    quarter = oracles.Clipped(half, [oracles.HalfSpace([0, 1, 0])], ball=([0, 0, 0], 5))
    assert quarter.walls == 3
    hold(stellate.mesh(quarter, 0.2, server=server), 0, {(0,), (1,)})


@pytest.mark.parametrize(
    ("wall", "gradient", "said"),
    [
        (lambda x: x, None, r"wall 0 returned shape \(\d+, 3\)"),
        (lambda x: 1 - (x**2).sum(), None, r"wall 0 returned shape \(\)"),
        (
            lambda x: 1 - (x**2).sum(axis=1),
            lambda x: -2 * x.T,  # as many numbers, in the wrong order
            r"the gradient of wall 0 returned shape \(3, \d+\)",
        ),
    ],
)
def test_walls_of_the_wrong_shape_are_named(server, wall, gradient, said):
    with pytest.raises(stellate.OracleError, match=said):
        solid = oracles.Solid(wall, ROOM, gradients=[gradient])
        stellate.mesh(solid, 0.4, server=server)


def test_epsilon_may_be_left_to_the_reach_of_the_boundary(server):
    mesh = stellate.mesh(oracles.Solid(ball=([0, 0, 0], 1)), "auto", server=server)
    assert mesh.certified and mesh.report.epsilon == pytest.approx(0.25)
