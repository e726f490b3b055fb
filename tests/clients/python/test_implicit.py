"""Manifolds by equations, held to the laws of an oracle, and the ready-made ones with them."""

import itertools

import numpy as np
import pytest
import stellate
from stellate import manifolds


def implicit_torus(**options):
    def f(x):
        return ((np.sqrt(x[:, 0] * x[:, 0] + x[:, 1] * x[:, 1]) - 1) ** 2 + x[:, 2] ** 2 - 0.16)[
            :, None
        ]

    box = manifolds.Torus().bounding_box
    return stellate.ImplicitManifold(
        f, ambient_dimension=3, dimension=2, bounding_box=box, **options
    )


def implicit_rotations():
    rows, columns = np.triu_indices(3)

    def f(x):
        r = x.reshape(-1, 3, 3)
        return (r @ r.transpose(0, 2, 1) - np.eye(3))[:, rows, columns]

    box = -np.ones(9), np.ones(9)
    return stellate.ImplicitManifold(f, ambient_dimension=9, dimension=3, bounding_box=box)


def implicit_circle(d):
    def f(x):
        return np.column_stack([x[:, 0] ** 2 + x[:, 1] ** 2 - 1, x[:, 2:]])

    box = np.full(d, -1.5), np.full(d, 1.5)
    return stellate.ImplicitManifold(f, ambient_dimension=d, dimension=1, bounding_box=box)


ALL = {
    "torus": manifolds.Torus(),
    "circle in R^10": manifolds.Sphere(1, 10),
    "S^4": manifolds.Sphere(4, radius=2.0),
    "Clifford torus": manifolds.ProductOfCircles(),
    "T^3": manifolds.ProductOfCircles((1, 0.8, 0.6)),
    "SO(3)": manifolds.SpecialOrthogonal3(),
    "ellipsoid": manifolds.ellipsoid(),
    "ellipsoid S^3": manifolds.ellipsoid((1, 0.9, 0.8, 0.7)),
    "tanglecube": manifolds.tanglecube(),
    "torus by its equation": implicit_torus(),
    "SO(3) by its equations": implicit_rotations(),
    "circle by its equations": implicit_circle(4),
}


@pytest.mark.parametrize("name", ALL)
def test_laws_of_an_oracle(name, rng):
    """Idempotent, perpendicular to the tangent space, tangents orthonormal: up to rounding."""
    m = ALL[name]
    lower, upper = m.bounding_box
    x = rng.uniform(lower, upper, (500, m.ambient_dimension))
    try:
        p = m.closest_point(x)
    except stellate.NotConverged as error:
        assert error.converged.mean() > 0.97
        x, p = x[error.converged], error.points[error.converged]
    assert np.abs(m.closest_point(p) - p).max() < 1e-12
    basis = m.tangent_basis(p)
    k = m.dimension
    assert basis.shape == (len(p), m.ambient_dimension, k)
    assert np.abs(basis.transpose(0, 2, 1) @ basis - np.eye(k)).max() < 1e-13
    assert np.abs(np.einsum("ndk,nd->nk", basis, x - p)).max() < 1e-8
    # Tangent indeed: a step along it leaves M by its square only.
    step = 1e-4
    ahead = p + step * basis[:, :, 0]
    assert np.linalg.norm(m.closest_point(ahead) - ahead, axis=1).max() < 100 * step**2


@pytest.mark.parametrize(
    "name", ["ellipsoid S^3", "torus by its equation", "SO(3) by its equations"]
)
def test_flats_are_met_where_asked(name, rng):
    m = ALL[name]
    p = m.closest_point(m.closest_point(rng.uniform(*m.bounding_box, (300, m.ambient_dimension))))
    bases = m.tangent_basis(p)
    radius = 0.05 * np.linalg.norm(m.bounding_box[1])
    along = rng.normal(size=(len(p), m.dimension, 1))
    centers = p + radius * (bases @ (along / np.linalg.norm(along, axis=1, keepdims=True)))[..., 0]
    q, found = m.intersect_flat(centers, bases, np.full(len(p), radius))
    assert found.all()
    assert np.abs(np.einsum("ndk,nd->nk", bases, q - centers)).max() < 1e-12
    assert np.linalg.norm(q - centers, axis=1).max() <= radius
    assert np.abs(m.closest_point(q) - q).max() < 1e-10


def test_flats_that_miss_the_manifold_or_meet_it_too_far_away():
    m = manifolds.ellipsoid((1.0, 1.0, 1.0))
    bases = np.broadcast_to(np.eye(3, 2), (3, 3, 2))  # flats are vertical lines
    centers = np.array([[2.0, 0, 0], [0, 0, 0], [0, 0, 0.9]])
    q, found = m.intersect_flat(centers, bases, np.array([5.0, 0.5, 0.5]))
    assert found.tolist() == [False, False, True]
    assert np.allclose(q[2], [0, 0, 1], atol=1e-14)


def test_agrees_with_the_closed_form(rng):
    closed = manifolds.Torus()
    x = closed.closest_point(rng.uniform(*closed.bounding_box, (400, 3)))
    x += rng.uniform(-0.1, 0.1, x.shape)
    assert np.abs(implicit_torus().closest_point(x) - closed.closest_point(x)).max() < 1e-9
    rotations = manifolds.SpecialOrthogonal3()
    x = rotations.closest_point(rng.uniform(-1, 1, (100, 9))) + rng.uniform(-0.1, 0.1, (100, 9))
    assert np.abs(implicit_rotations().closest_point(x) - rotations.closest_point(x)).max() < 1e-9


@pytest.mark.parametrize("name", ["tanglecube", "torus by its equation", "SO(3)", "torus", "S^4"])
def test_answers_do_not_depend_on_the_batch(name, rng):
    """Bit for bit, or a mesh would depend on how many workers there are."""
    m = ALL[name]
    x = m.closest_point(rng.uniform(*m.bounding_box, (101, m.ambient_dimension)))
    x += rng.uniform(-0.05, 0.05, x.shape)
    whole, bases = m.closest_point(x), m.tangent_basis(x)
    for cut in ([1, 2, 50], [33], list(range(1, 101))):
        parts = np.split(x, cut)
        assert (
            np.concatenate([m.closest_point(part) for part in parts]).tobytes() == whole.tobytes()
        )
        assert (
            np.concatenate([m.tangent_basis(part) for part in parts]).tobytes() == bases.tobytes()
        )


def test_says_which_points_do_not_converge():
    def f(x):  # a sphere of radius 1, and no way down from its centre
        return (x * x).sum(axis=1, keepdims=True) - 1

    box = -np.ones(3), np.ones(3)
    m = stellate.ImplicitManifold(
        f, lambda x: 2 * x, ambient_dimension=3, dimension=2, bounding_box=box
    )
    with pytest.raises(stellate.NotConverged, match="1 of 3 points") as caught:
        m.closest_point(np.array([[0.5, 0, 0], [0, 0, 0], [0, 0, 3.0]]))
    assert caught.value.converged.tolist() == [True, False, True]
    assert np.allclose(caught.value.points[[0, 2]], [[1, 0, 0], [0, 0, 1]])
    assert isinstance(caught.value, stellate.StellateError)


def test_a_function_without_zeros_converges_nowhere(rng):
    def f(x):
        return (x * x).sum(axis=1, keepdims=True) + 1

    box = -np.ones(2), np.ones(2)
    m = stellate.ImplicitManifold(f, ambient_dimension=2, dimension=1, bounding_box=box)
    with pytest.raises(stellate.NotConverged) as caught:
        m.closest_point(rng.uniform(-1, 1, (20, 2)))
    assert not caught.value.converged.any()


def test_values_that_are_not_numbers_spoil_their_own_points_alone(rng):
    def f(x):
        with np.errstate(invalid="ignore"):
            return (np.sqrt(x[:, :1]) ** 2 + x[:, 1:] ** 2) - 1  # only defined on the right

    m = stellate.ImplicitManifold(
        f, ambient_dimension=2, dimension=1, bounding_box=([-1, -1], [2, 2])
    )
    with pytest.raises(stellate.NotConverged) as caught:
        m.closest_point(np.array([[0.9, 0.1], [-0.5, 0.2]]))
    assert caught.value.converged.tolist() == [True, False]


def upper_half(x):
    """z = sqrt(1 - x^2 - y^2), which ends with the root."""
    with np.errstate(invalid="ignore"):
        return x[:, 2] - np.sqrt(1 - x[:, 0] ** 2 - x[:, 1] ** 2)


def slope_of_upper_half(x):
    with np.errstate(invalid="ignore"):
        root = np.sqrt(1 - x[:, 0] ** 2 - x[:, 1] ** 2)
    return np.stack([x[:, 0] / root, x[:, 1] / root, np.ones(len(x))], axis=1)


def test_a_manifold_ends_where_its_function_does(rng):
    box = -2 * np.ones(3), 2 * np.ones(3)

    def half(jacobian=None):
        return stellate.ImplicitManifold(
            upper_half, jacobian, ambient_dimension=3, dimension=2, bounding_box=box
        )

    def at(z):
        angles = rng.uniform(0, 2 * np.pi, 20)
        r = np.sqrt(1 - z * z)
        return np.stack([r * np.cos(angles), r * np.sin(angles), np.full(20, z)], axis=1)

    with_slopes = half(slope_of_upper_half)
    with_slopes.tangent_basis(at(0.3))
    assert with_slopes.where_it_ends() == ""
    with_slopes.tangent_basis(at(0.005))
    assert "ends where f does, near" in with_slopes.where_it_ends()
    # Differences look beyond the end by themselves, and know no tangent space there.
    assert half().tangent_basis(at(0.3)).shape == (20, 3, 2)
    with pytest.raises(stellate.OracleError, match="ends where f does.*inequalities"):
        half().tangent_basis(np.concatenate([at(0.3), at(0.005)]))


@pytest.mark.parametrize("offset", [0.0, 1e6, -1e7])
@pytest.mark.parametrize("radius", [1.0, 1e-8, 1e8])
@pytest.mark.filterwarnings("error")
def test_units_and_far_origins_do_not_matter(offset, radius, rng):
    """Coordinates of surveyors: a sphere of unit size a million units away, and in other units."""
    center = offset * radius

    def f(x):
        return (((x - center) / radius) ** 2).sum(axis=1)[:, None] - 1

    box = np.full(3, center - 2 * radius), np.full(3, center + 2 * radius)
    m = stellate.ImplicitManifold(f, ambient_dimension=3, dimension=2, bounding_box=box)
    away = rng.normal(size=(200, 3))
    x = center + radius * away / np.linalg.norm(away, axis=1)[:, None] * rng.uniform(
        0.5, 1.5, (200, 1)
    )
    y = m.closest_point(x)
    expected = center + radius * (x - center) / np.linalg.norm(x - center, axis=1)[:, None]
    # A closest point found by differences, as far as its coordinates can say.
    assert np.abs(y - expected).max() <= radius * (1e-8 + 1e-15 * abs(offset) * 100)


def test_the_nearest_of_two_sheets_is_found():
    m = manifolds.ellipsoid((2.0, 1.0))
    p = m.closest_point(np.array([[1.2, 0.1], [1.2, -0.1], [0.0, 3.0]]))
    assert (np.sign(p[:, 1]) == [1, -1, 1]).all()
    angles = np.linspace(0, 2 * np.pi, 100001)
    curve = np.column_stack([2 * np.cos(angles), np.sin(angles)])
    nearest = np.linalg.norm(curve - [1.2, 0.1], axis=1).min()
    assert np.linalg.norm(p[0] - [1.2, 0.1]) == pytest.approx(nearest, rel=1e-6)


def test_wrong_shapes_are_named():
    box = -np.ones(3), np.ones(3)
    flat = stellate.ImplicitManifold(
        lambda x: x[:, :2], ambient_dimension=3, dimension=2, bounding_box=box
    )
    with pytest.raises(stellate.OracleError, match=r"f returned shape \(60, 2\).*\(60, 1\)"):
        flat.closest_point(np.ones((4, 3)))
    bent = stellate.ImplicitManifold(
        lambda x: x[:, :1], lambda x: x[:, :2], ambient_dimension=3, dimension=2, bounding_box=box
    )
    with pytest.raises(stellate.OracleError, match=r"jacobian returned shape \(4, 2\)"):
        bent.closest_point(np.ones((4, 3)))


@pytest.mark.parametrize(
    "changed, words",
    [
        ({"dimension": 0}, "dimension 0"),
        ({"dimension": 3}, "dimension 3"),
        ({"bounding_box": ([0, 0], [1, 1])}, "shapes"),
        ({"bounding_box": ([0, 0, 0], [1, 0, 1])}, "empty"),
    ],
)
def test_bad_declarations_are_refused(changed, words):
    good = {"ambient_dimension": 3, "dimension": 2, "bounding_box": ([0, 0, 0], [1, 1, 1])}
    with pytest.raises(stellate.InvalidArgument, match=words):
        stellate.ImplicitManifold(lambda x: x[:, :1], **{**good, **changed})


def test_points_that_creases_are_nearest_to_are_given_up_soon(rng):
    calls = []

    def cut_cube(p):  # less a cylinder along each axis
        calls.append(len(p))
        cube = (np.abs(p) - 0.75).max(axis=1)
        axes = [np.hypot(p[:, i], p[:, i - 1]) - 0.5 for i in range(3)]
        return np.maximum(cube, -np.minimum.reduce(axes))

    oracle = stellate.oracles.SignedDistance(cut_cube, bounding_box=([-1.5] * 3, [1.5] * 3))
    x = rng.uniform(-1.2, 1.2, (150, 3))
    with pytest.raises(stellate.NotConverged) as lost:
        oracle.closest_point(x)
    asked, found = len(calls), lost.value.converged
    assert 0.3 < found.mean() < 0.9
    for point, y in zip(x[found], lost.value.points[found]):
        np.testing.assert_array_equal(oracle.closest_point(point[None])[0], y)
    assert asked < 2000, "calls of f, each for a few points, are what a search costs"


def found_of(nearest, x, face):
    """Of points that are far, nearly all."""
    try:
        return nearest(x, face)
    except stellate.NotConverged as error:
        assert error.converged.mean() > 0.97
        return error.points[error.converged]


def slope_of_bowl(x):
    return np.column_stack([np.ones(len(x)), 0 * x[:, 1], 0 * x[:, 2], 0.6 * x[:, 3]])


@pytest.mark.parametrize("gradient", [None, slope_of_bowl])
@pytest.mark.parametrize("jacobian", [None, "given"])
def test_faces_of_equations_are_solved_with_them(gradient, jacobian, rng):
    """Nearest points of a torus in R^4 where walls are zero: curves, and where two cross, points."""

    def f(x):
        return np.column_stack([x[:, 0] ** 2 + x[:, 1] ** 2 - 1, x[:, 2] ** 2 + x[:, 3] ** 2 - 1])

    def slopes(x):
        zero = 0 * x[:, :2]
        rows = [np.hstack([2 * x[:, :2], zero]), np.hstack([zero, 2 * x[:, 2:]])]
        return np.stack(rows, axis=1)

    def bowl(x):
        return x[:, 0] + 0.3 * x[:, 3] ** 2

    m = stellate.ImplicitManifold(
        f,
        slopes if jacobian else None,
        ambient_dimension=4,
        dimension=2,
        bounding_box=(-1.5 * np.ones(4), 1.5 * np.ones(4)),
    )
    half = stellate.oracles.HalfSpace([0.0, 0.0, 1.0, 0.2])
    clipped = stellate.oracles.Clipped(m, [bowl, half], gradients=[gradient, None])
    on = m.closest_point(rng.uniform(-1, 1, (300, 4)))
    curve = found_of(clipped.face_point, on, (0,))
    x = curve + rng.uniform(-0.05, 0.05, curve.shape)
    p = clipped.face_point(x, (0,))
    assert np.abs(f(p)).max() < 1e-11 and np.abs(bowl(p)).max() < 1e-11
    across = np.concatenate([slopes(p), slope_of_bowl(p)[:, None]], axis=1)
    along = np.linalg.svd(across)[2][:, 3]
    assert np.abs(((x - p) * along).sum(axis=1)).max() < 1e-9
    parts = [clipped.face_point(part, (0,)) for part in np.split(x, [1, 2, 50])]
    assert np.concatenate(parts).tobytes() == p.tobytes()
    corners = found_of(clipped.face_point, p, (0, 1))
    assert np.abs(f(corners)).max() < 1e-11
    assert np.abs(clipped.clearances(corners)).max() < 1e-11


def cubic(x):
    return (x[:, 2] - x[:, 0] ** 3 + x[:, 0])[:, None]


CUT = {
    "cubic": (cubic, 3),
    "torus": (lambda x: ((np.hypot(x[:, 0], x[:, 1]) - 1) ** 2 + x[:, 2] ** 2 - 0.16)[:, None], 3),
    "S^3": (lambda x: (x * x).sum(axis=1, keepdims=True) - 1, 4),
    "T^2": (lambda x: np.stack([(x[:, i : i + 2] ** 2).sum(axis=1) - 1 for i in (0, 2)], 1), 4),
    "steep": (lambda x: np.tanh(50 * ((x * x).sum(axis=1, keepdims=True) - 1)), 3),
}


@pytest.mark.parametrize("name", CUT)
def test_what_is_found_on_walls_is_on_them(name, rng):
    """Walls that never meet on M among them: their equations have no Jacobian of full rank there."""
    f, d = CUT[name]
    m = len(f(np.zeros((1, d)))[0])
    whole = stellate.ImplicitManifold(
        f, ambient_dimension=d, dimension=d - m, bounding_box=([-1.4] * d, [1.4] * d)
    )
    walls = [lambda x, i=i, s=s: s * x[:, i] + 0.7 for i in range(d) for s in (1, -1)]
    cut = stellate.oracles.Clipped(whole, walls)
    points, total = rng.uniform(-1.4, 1.4, (30, d)), 0
    for count in range(1, min(d - m, 2) + 1):
        for face in itertools.combinations(range(2 * d), count):
            try:
                y = cut.face_point(points, face)
            except stellate.NotConverged as error:
                y = error.points[error.converged]
            values = np.column_stack([f(y), *(walls[wall](y) for wall in face)])
            assert np.abs(values).max(initial=0) < 1e-9, face
            total += len(y)
    assert total >= 10


def test_more_walls_than_dimensions_are_refused():
    cut = stellate.oracles.Clipped(
        stellate.ImplicitManifold(
            cubic, ambient_dimension=3, dimension=2, bounding_box=([-1.4] * 3, [1.4] * 3)
        ),
        [lambda x, i=i: x[:, i] for i in range(3)],
    )
    with pytest.raises(stellate.InvalidArgument, match="3 equations on a manifold of dimension 2"):
        cut.face_point(np.zeros((1, 3)), (0, 1, 2))


@pytest.mark.parametrize("axes", [(1.0, 1.0, 3.0), (1.0, 1.0, 0.3)])
def test_feet_are_the_nearest_up_to_where_two_are_as_near(axes, rng):
    ellipsoid = manifolds.ellipsoid(axes)
    lower, upper = ellipsoid.bounding_box
    p = ellipsoid.closest_point(rng.uniform(lower, upper, (1000, 3)))
    normals = p / np.square(axes)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    inside = p - 0.99 * ellipsoid.local_size(p)[:, None] * normals
    assert np.abs(ellipsoid.closest_point(inside) - p).max() < 1e-6
