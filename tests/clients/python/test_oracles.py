"""The ready oracles, held to what the catalogue's closed forms say, and to the contract of all."""

import meshio
import numpy as np
import pytest
import stellate
from ready_shapes import (
    ALL,
    FOUR_BARS,
    GROUND,
    NETWORKS,
    TORUS,
    TURN,
    closest,
    near,
    network_torus,
    norm2,
    torus_cloud,
    torus_grid,
    torus_map,
    torus_triangles,
    veronese,
)
from stellate import oracles


@pytest.fixture(scope="module", params=ALL)
def case(request):
    make, away, slack = ALL[request.param]
    oracle = make()
    return oracle, near(oracle, away), slack


def test_the_way_to_the_closest_point_is_normal(case):
    oracle, x, slack = case
    y, found = closest(oracle, x)
    assert found.mean() > 0.95
    bases = oracle.tangent_basis(y[found])
    k = oracle.dimension
    assert np.abs(bases.transpose(0, 2, 1) @ bases - np.eye(k)).max() < 1e-9
    along = (bases * (x - y)[found][:, :, None]).sum(axis=1)
    assert np.abs(along).max() <= slack * np.linalg.norm(x - y, axis=1).max()


def test_points_of_the_manifold_stay(case):
    oracle, x, _ = case
    y, found = closest(oracle, x)
    again, still = closest(oracle, y[found])
    assert still.all()
    assert np.abs(again - y[found]).max() < 1e-8


def test_answers_do_not_depend_on_the_batch(case):
    oracle, x, _ = case
    together, found = closest(oracle, x)
    bases = oracle.tangent_basis(together[found])
    for rows in [[0], [1], *np.array_split(np.arange(len(x)), 7)]:
        apart, here = closest(oracle, x[rows])
        assert (here == found[rows]).all()
        assert apart[here].tobytes() == together[rows][here].tobytes()
    parts = np.array_split(together[found], 7)
    assert np.concatenate([oracle.tangent_basis(p) for p in parts]).tobytes() == bases.tobytes()


@pytest.mark.parametrize(
    "name, error",
    [
        ("parametrized", 1e-12),
        ("parametrized_differences", 1e-12),
        ("signed_distance", 0.004),
        ("point_cloud", 0.002),
        ("triangles", 0.0015),
    ],
)
def test_a_torus_is_the_torus(name, error):
    oracle = ALL[name][0]()
    x = near(TORUS, 0.1)
    y, found = closest(oracle, x)
    assert found.all()
    assert np.linalg.norm(y - TORUS.closest_point(y), axis=1).max() < error
    assert np.linalg.norm(y - TORUS.closest_point(x), axis=1).max() < 6 * error + 1e-7


def test_flats_meet_a_parametrized_torus():
    oracle = ALL["parametrized"][0]()
    x = near(TORUS, 0.05)
    bases = TORUS.tangent_basis(TORUS.closest_point(x))
    y, found = oracle.intersect_flat(x, bases, np.full(len(x), 0.2))
    assert found.all()
    assert np.abs((bases * (y - x)[:, :, None]).sum(axis=1)).max() < 1e-11
    assert np.abs(TORUS.closest_point(y) - y).max() < 1e-12
    away = np.linalg.norm(y - x, axis=1)
    _, found = oracle.intersect_flat(x, bases, np.full(len(x), 0.02))
    assert (found == (away <= 0.02)).all()
    assert 0 < found.mean() < 1


def test_a_turned_torus_meets_turned_flats():
    turn, _ = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))
    circles = stellate.manifolds.SpecialOrthogonal3()
    assert hasattr(oracles.Transformed(circles, scale=3), "intersect_flat") == hasattr(
        circles, "intersect_flat"
    )
    base = ALL["parametrized"][0]()
    oracle = oracles.Transformed(base, rotation=turn, scale=2, translation=[1, 2, 3])
    x = near(oracle, 0.1)
    bases = oracle.tangent_basis(oracle.closest_point(x))
    y, found = oracle.intersect_flat(x, bases, np.full(len(x), 0.4))
    assert found.all()
    assert np.abs((bases * (y - x)[:, :, None]).sum(axis=1)).max() < 1e-10


def test_noise_is_smoothed_and_told():
    cloud = oracles.PointCloud(torus_cloud(noise=0.01), 2, bandwidth=0.3)
    assert 0.008 < cloud.residual < 0.03
    y = cloud.closest_point(near(TORUS, 0.05))
    off = np.linalg.norm(y - TORUS.closest_point(y), axis=1)
    assert np.median(off) < 0.005 and off.max() < 0.02


def test_a_linkage_knows_its_joints():
    linkage = oracles.Linkage(FOUR_BARS, GROUND)
    assert linkage.moving == ["p", "q", "r"]
    assert linkage.coordinate_names == ("p.x", "p.y", "q.x", "q.y", "r.x", "r.y")
    assert (linkage.dimension, linkage.ambient_dimension) == (2, 6)
    at = linkage.joints(linkage.closest_point(near(linkage, 0.05)))
    for a, b, length in FOUR_BARS:
        assert np.abs(np.linalg.norm(at[a] - at[b], axis=1) - length).max() < 1e-10


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply"])
def test_triangles_are_read_from_files(tmp_path, suffix):
    points, triangles = torus_triangles(40, 20)
    meshio.write_points_cells(tmp_path / f"a.{suffix}", points, [("triangle", triangles)])
    oracle = oracles.TriangleMesh(tmp_path / f"a.{suffix}")
    y = oracle.closest_point(near(TORUS, 0.05))
    assert np.linalg.norm(y - TORUS.closest_point(y), axis=1).max() < 0.02


def test_large_triangles_are_filled():
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]])
    faces = np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]])
    tetrahedron = oracles.TriangleMesh(corners, faces, spacing=0.1)
    middle = corners[[0, 1, 2]].mean(axis=0)
    assert np.abs(tetrahedron.closest_point(1.1 * middle[None, :]) - middle).max() < 1e-9
    with pytest.raises(stellate.InvalidArgument, match="a larger one"):
        oracles.TriangleMesh(corners, faces, spacing=1e-4)


POINTS, TRIANGLES = torus_triangles(12, 8)


def sphere(x):
    return norm2(x) - 1


def constraints(*functions, d=3):
    box = [-2] * 3, [2] * 3
    return oracles.ConstraintSet(functions, ambient_dimension=d, bounding_box=box)


WRONG = {
    r"not closed: 3 edges .*, as near \[.*\]\. Fill its holes": lambda: oracles.TriangleMesh(
        POINTS, TRIANGLES[1:]
    ),
    "triangles have to name points": lambda: oracles.TriangleMesh(POINTS, TRIANGLES + 1),
    "cannot be read": lambda: oracles.TriangleMesh("no such file.obj"),
    "takes a file": lambda: oracles.TriangleMesh(7),
    "not finite": lambda: oracles.PointCloud([[0.0, np.nan]] * 30, 1),
    "too few, at least 7 are": lambda: oracles.PointCloud(np.eye(3), 1),
    "whole number from 1 to 2": lambda: oracles.PointCloud(torus_cloud(), 3),
    "has to be positive": lambda: oracles.PointCloud(torus_cloud(), 2, bandwidth=-1),
    "larger bandwidth": lambda: oracles.PointCloud(torus_cloud(), 2, bandwidth=1e-6),
    "either a map": lambda: oracles.Parametrized(),
    "lower < upper": lambda: oracles.Chart(torus_map, None, [1, 1], [0, 2]),
    "the first has to": lambda: oracles.Parametrized(lambda u: u, None, [0, 0], [1, 1]),
    "map does not come round as periodic .* 0 to the upper 360 .*2 . np.pi": lambda: (
        oracles.Parametrized(torus_map, None, [0, 0], [360, 360], True)
    ),
    "map does not come round as periodic .* 0 to the upper 180": lambda: oracles.Parametrized(
        circle, None, [0], [180], True
    ),
    "chart 1 does not come round .* of parameter 1": lambda: oracles.Parametrized(
        charts=[
            oracles.Chart(torus_map, None, [0, 0], [TURN, upper], [False, True])
            for upper in (TURN, TURN / 2)
        ]
    ),
    "two factors": lambda: oracles.Product(TORUS),
    "orthonormal": lambda: oracles.Transformed(TORUS, rotation=2 * np.eye(3)),
    "shape": lambda: oracles.Transformed(TORUS, rotation=np.eye(2)),
    "scale": lambda: oracles.Transformed(TORUS, scale=0),
    "one number, and is .*Axes of different units": lambda: oracles.Transformed(
        TORUS, scale=[1, 2, 3]
    ),
    "and then of the joints that are fixed": lambda: oracles.Linkage(GROUND, FOUR_BARS),
    "a level set on _Bare needs": lambda: oracles.LevelSet(_Bare(), lambda x: x[:, 0]),
    "leave none": lambda: oracles.LevelSet(TORUS, lambda x: x[:, :2]),
    "no set of level 0.*; give level=, between them, such as": lambda: (
        oracles.SignedDistance.of_grid(torus_grid(8) + 9, ([-1.5] * 3, [1.5] * 3))
    ),
    "4 values an axis": lambda: oracles.SignedDistance.of_grid(
        np.zeros((3, 9)), ([0] * 2, [1] * 2)
    ),
    "a box of R": lambda: oracles.SignedDistance.of_grid(torus_grid(8), ([0] * 2, [1] * 2)),
    "pair of corners": lambda: oracles.SignedDistance(lambda x: x[:, 0], bounding_box=3),
    "one constraint at least": lambda: constraints(),
    "constraint 0 has to be": lambda: constraints(3),
    "box of R.4": lambda: constraints(sphere, d=4),
    "leave no manifold": lambda: constraints(lambda x: x),
    "constraint 1 follows": lambda: constraints(sphere, lambda x: 2 * sphere(x)),
    "no point was found": lambda: constraints(lambda x: sphere(x) + 2),
    "no gradient of its own": lambda: constraints(lambda x: sphere(x) ** 2),
    "has to be callable": lambda: oracles.NeuralImplicit(3, bounding_box=([-1], [1])),
    "corners, and is 3": lambda: oracles.NeuralImplicit(network_torus(), bounding_box=3),
    "has 1 values, and level": lambda: oracles.NeuralImplicit(
        network_torus(), bounding_box=([-1.5] * 3, [1.5] * 3), level=[0, 0]
    ),
    "a quotient of _Bare needs": lambda: oracles.Quotient(_Bare(), veronese),
    "not an immersion near": lambda: oracles.Quotient(TORUS, lambda x: x[:, [0, 0, 0]]),
    "does not embed in": lambda: oracles.Quotient(TORUS, lambda x: x[:, :2]),
    "leave nothing to move": lambda: oracles.Linkage([("a", "p", 1), ("p", "b", 1)], GROUND),
    "no bar has the fixed joint 'c'.*'a', 'p', 'q', 'b'": lambda: oracles.Linkage(
        FOUR_BARS, {**GROUND, "c": (1, 1)}
    ),
    "no chain": lambda: oracles.Linkage([("p", "q", 1)], GROUND),
    "two joints that are fixed": lambda: oracles.Linkage([("a", "b", 1)], GROUND),
    "too short": lambda: oracles.Linkage(
        [("a", "p", 0.1), ("p", "b", 0.1), ("p", "q", 1), ("q", "s", 1)], GROUND
    ),
    "length > 0": lambda: oracles.Linkage([("a", "p", 0)], GROUND),
    "a bar is .joint, joint, length., and is .'a', 'p'.": lambda: oracles.Linkage(
        [("a", "p")], GROUND
    ),
}


class _Bare:
    dimension, ambient_dimension = 2, 3
    bounding_box = TORUS.bounding_box
    closest_point = staticmethod(TORUS.closest_point)


@pytest.mark.parametrize("words", WRONG)
def test_what_is_wrong_is_said(words):
    with pytest.raises(stellate.InvalidArgument, match=words):
        WRONG[words]()


def test_a_parameter_may_come_round_turned_over():
    def klein(u):
        ring, half = 2 + np.cos(u[:, 1]), u[:, 0] / 2
        across = np.sin(u[:, 1])
        return np.stack(
            [ring * np.cos(2 * half), ring * np.sin(2 * half), across * np.cos(half), across * np.sin(half)],
            axis=1,
        )  # fmt: skip

    for turns in (1, 2):  # after one it is at the other side, and M the same
        oracles.Parametrized(klein, None, [0, 0], [turns * TURN, TURN], True)
    with pytest.raises(stellate.InvalidArgument, match="does not come round"):
        oracles.Parametrized(klein, None, [0, 0], [0.9 * TURN, TURN], True)


def circle(u):
    return np.stack([np.cos(u[:, 0]), np.sin(u[:, 0])], axis=1)


def arcs(count, overlap):
    quarters = TURN / 4 * np.arange(count)
    return [oracles.Chart(circle, None, [q], [q + TURN / 4 + overlap]) for q in quarters]


def test_where_a_parametrization_ends_is_told():
    half = oracles.Parametrized(circle, None, [0], [TURN / 2])
    assert "where the map does, at the lower end 0 of its parameter 0, as near [1.0, 0.0]" in (
        half.where_it_ends()
    )
    lacking = oracles.Parametrized(charts=arcs(3, 0.0))
    assert "where chart 0 does, at the lower end 0 of its" in lacking.where_it_ends()
    tube = oracles.Parametrized(torus_map, None, [0, 0], [TURN, TURN / 2], [True, False])
    assert "at the lower end 0 of its parameter 1" in tube.where_it_ends()


@pytest.mark.parametrize(
    "closed",
    [
        lambda: oracles.Parametrized(circle, None, [0], [TURN]),
        lambda: oracles.Parametrized(torus_map, None, [0, 0], [TURN] * 2, [True, False]),
        lambda: oracles.Parametrized(charts=arcs(4, 1e-5)),
        ALL["charts"][0],
        ALL["parametrized"][0],
    ],
    ids=["periodic is forgotten", "periodic is forgotten of one", "arcs", "charts", "periodic"],
)
def test_a_parametrization_that_goes_on_is_not_said_to_end(closed):
    assert closed().where_it_ends() == ""


def test_a_chart_of_the_wrong_shape_is_an_oracle_error():
    with pytest.raises(stellate.OracleError, match="a chart's x returned"):
        oracles.Parametrized(lambda u: torus_map(u)[:-1], None, [0, 0], [TURN, TURN], True)


@pytest.mark.parametrize(
    "network, words",
    [
        (network_torus(np.float32), "answered in float32"),
        (lambda x: x[:, 0], "returned a ndarray"),
        (lambda x: (x[:, 0], x[:, 0]), "gradients"),
    ],
)
def test_networks_answer_with_gradients_in_double_precision(network, words):
    with pytest.raises(stellate.OracleError, match=words):
        oracles.NeuralImplicit(network, bounding_box=([-1.5] * 3, [1.5] * 3))


@pytest.mark.parametrize("library", NETWORKS)
def test_a_network_is_the_torus_that_it_learnt(library):
    network = NETWORKS[library]()
    oracle = oracles.NeuralImplicit(network, bounding_box=([-1.5] * 3, [1.5] * 3))
    x = near(TORUS, 0.05)
    y = oracle.closest_point(x)
    assert np.linalg.norm(y - TORUS.closest_point(y), axis=1).max() < 0.01
    assert np.abs(y - ALL["network"][0]().closest_point(x)).max() < 1e-3
    parts = np.concatenate([oracle.closest_point(part) for part in np.array_split(x, 7)])
    assert parts.tobytes() == y.tobytes()
    assert not hasattr(network, "parameters") or all(
        p.requires_grad and str(p.dtype) == "torch.float32" for p in network.parameters()
    )


def test_a_projective_plane_is_the_matrices_of_rank_one():
    """The nearest of them is made of the eigenvector to the largest eigenvalue."""
    oracle = ALL["projective_plane"][0]()
    x = near(oracle, 0.3)
    y = oracle.closest_point(x)
    first, second = np.triu_indices(3)
    matrices = np.empty((len(x), 3, 3))
    matrices[:, first, second] = x / np.where(first == second, 1.0, np.sqrt(2))
    matrices[:, second, first] = matrices[:, first, second]
    assert np.abs(y - veronese(np.linalg.eigh(matrices)[1][:, :, 2])).max() < 1e-8


def test_walls_without_a_common_point_have_none():
    """Three upright walls: rounding alone keeps their slopes from being dependent."""
    turn = np.radians(30)
    sides = [oracles.HalfSpace([0, 1, 0]), oracles.HalfSpace([np.sin(turn), -np.cos(turn), 0])]
    wedge = oracles.Solid(
        [*sides, lambda x: 1 - x[:, 0] ** 2 - x[:, 1] ** 2], bounding_box=([-1] * 3, [1] * 3)
    )
    x = np.random.default_rng(1).uniform(-1, 1, (200, 3))
    with pytest.raises(stellate.NotConverged) as raised:
        wedge.face_point(x, (0, 1, 2))
    assert not raised.value.converged.any()
    edge = wedge.face_point(x, (0, 1))
    assert np.abs(edge[:, :2]).max() < 1e-12 and np.abs(edge[:, 2] - x[:, 2]).max() < 1e-12


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
@pytest.mark.filterwarnings("error")
def test_faces_are_found_in_any_unit(unit, rng):
    ball = oracles.Solid(ball=([0] * 3, unit))
    x = unit * rng.normal(size=(100, 3))
    expected = unit * x / np.linalg.norm(x, axis=1)[:, None]
    assert np.abs(ball.face_point(x, (0,)) - expected).max() <= 1e-9 * unit


def test_one_wall_needs_no_list():
    def above(x):
        return x[:, 2]

    def sphere(x):
        return (x * x).sum(axis=1) - 1

    equation = {"ambient_dimension": 3, "dimension": 2, "bounding_box": ([-2] * 3, [2] * 3)}
    assert oracles.Clipped(TORUS, above).walls == 1
    assert oracles.ImplicitManifold(sphere, inequalities=above, **equation).walls == 1
