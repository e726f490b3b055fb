"""Functions that users write: how they are called, what they may return, how exact they have to be."""

import pickle

import numpy as np
import pytest
import stellate
from ready_shapes import ALL, TORUS, TURN, closest, near, norm2, torus_map
from stellate import manifolds, oracles
from takers import CUBE, SEVERAL, TAKERS, ask, implicit, sphere


def half_of_a_sphere(clearance):
    rim = oracles.Transformed(manifolds.Sphere(1), rotation=np.eye(3, 2))
    return oracles.ManifoldWithBoundary(manifolds.Sphere(2), rim, clearance=clearance)


@pytest.mark.parametrize("taker", TAKERS)
@pytest.mark.parametrize(
    "cast, words",
    [
        (lambda f: lambda x: f(x).astype(np.float32), r"returned float32 numbers; .*\.double\(\)"),
        (lambda f: lambda x: f(x.astype(np.float32)).astype(float), "is exact to .*e-0[789] of"),
    ],
    ids=["single", "single and back"],
)
def test_single_precision_is_told_whoever_takes_the_function(taker, cast, words):
    make, f = TAKERS[taker]
    ask(make(f))
    with pytest.raises(stellate.OracleError, match=words) as caught:
        ask(make(cast(f)))
    assert caught.value.reason == "ORACLE_PRECISION"


def test_single_precision_is_told_of_clearances_too():
    x = np.random.default_rng(1).uniform(-1, 1, (20, 3))
    half_of_a_sphere(lambda x: x[:, 2]).clearances(x)
    with pytest.raises(stellate.OracleError, match="clearance returned float32"):
        half_of_a_sphere(lambda x: x[:, 2].astype(np.float32)).clearances(x)


@pytest.mark.parametrize("center", [0.0, 3e3], ids=["at the origin", "far from it"])
def test_exactness_is_measured_where_the_box_is(center):
    low, high = np.full(3, center - 1.5), np.full(3, center + 1.5)

    def made(f):
        return oracles.SignedDistance(f, bounding_box=(low, high))

    ask_at = np.full((1, 3), center + 0.4)
    made(lambda x: sphere(x - center)).closest_point(ask_at)
    with pytest.raises(stellate.OracleError, match="is exact to"):
        made(lambda x: sphere(x.astype(np.float32).astype(float) - center)).closest_point(ask_at)


@pytest.mark.parametrize(
    "f",
    [
        lambda x: np.minimum(sphere(x), np.abs(x).max(axis=1) - 0.9),  # creases
        lambda x: np.clip(sphere(x), -0.2, 0.2),  # constant in most places
        lambda x: np.where(x[:, 0] > 0.5, np.nan, sphere(x)),
        lambda x: 1e-12 * sphere(x),
        lambda x: np.sin(40 * sphere(x)),
        lambda x: x[:, 2] - 1e-3,
    ],
)
def test_what_is_exact_is_not_accused(f):
    f_twice = implicit(f)
    with np.errstate(invalid="ignore"):
        try:
            f_twice.closest_point(np.random.default_rng(1).uniform(-1, 1, (50, 3)))
        except stellate.NotConverged:
            pass


def test_what_a_mask_hides_is_no_value():
    """Masked arrays of a detector, say: what lies behind the mask is not data."""

    def half(x):
        return np.ma.masked_where(x[:, 0] > 0.2, sphere(x))

    x = np.random.default_rng(1).uniform(-1, 1, (200, 3))
    with np.errstate(invalid="ignore"), pytest.raises(stellate.NotConverged) as caught:
        implicit(half).closest_point(x)
    y = caught.value.points[caught.value.converged]
    assert len(y) > 20 and y[:, 0].max() <= 0.2 + 1e-6


@pytest.mark.parametrize("taker", [t for t in TAKERS if t not in SEVERAL])
def test_a_function_of_one_point_is_told_how_it_is_called(taker):
    make, _ = TAKERS[taker]

    def one_point(x):
        return float(x[0]) ** 2 + float(x[1]) ** 2 + float(x[2]) ** 2 - 1

    with pytest.raises(TypeError, match=r"called with a whole batch, .*\(n, 3\).*returns \(n"):
        ask(make(one_point))
    kinds = (stellate.OracleError, IndexError)  # by how many points the first batch has
    with pytest.raises(kinds, match=r"called with a whole batch, .*\(n, 3\)"):
        ask(make(lambda x: x[0] ** 2 + x[1] ** 2 + x[2] ** 2 - 1))


@pytest.mark.parametrize(
    "f, words",
    [
        (lambda x: sphere(x) + 0j, "returned complex128 numbers, where real ones are taken"),
        (lambda x: sphere(x) > 0, "returned truth values, .* in place of the comparison"),
        (lambda x: sphere(x).astype(object), "returned an array of object, where float64"),
        (
            lambda x: (10 * sphere(x)).astype(int),
            "returned int64 numbers; .* whole numbers have steps",
        ),
        (lambda x: sphere(x) * np.nan, "f is not finite at any of 64 places of its box"),
    ],
)
def test_values_that_are_no_smooth_numbers_are_told_by_what_they_are(f, words):
    with pytest.raises(stellate.OracleError, match=words):
        ask(implicit(f))


def test_equations_of_matrices_and_of_complex_numbers_are_said_what_to_do_with():
    def projections(x):  # of rank 1 in the plane: nine equations, of which three would do
        p = x.reshape(-1, 2, 2)
        rows = [(p @ p - p).reshape(-1, 4), (p - p.transpose(0, 2, 1)).reshape(-1, 4)]
        return np.concatenate([*rows, np.trace(p, axis1=1, axis2=2)[:, None] - 1], axis=1)

    def curve(x):  # w^2 = z^3 - z
        z, w = x[:, 0] + 1j * x[:, 1], x[:, 2] + 1j * x[:, 3]
        return w**2 - z**3 + z

    for f, k, words in (
        (projections, 1, "follow from others.*closest_point"),
        (curve, 2, r"np.stack\(\[w.real, w.imag\], axis=1\)"),
    ):
        oracle = stellate.ImplicitManifold(
            f, ambient_dimension=4, dimension=k, bounding_box=([-1] * 4, [1] * 4)
        )
        with pytest.raises(stellate.OracleError, match=words):
            ask(oracle)


@pytest.mark.parametrize("size", [1e-3, 1e-9])
def test_a_function_that_draws_random_numbers_is_not_called_single_precision(size):
    random = np.random.default_rng(1)
    with pytest.raises(
        stellate.OracleError, match="not a function of the point alone: asked twice"
    ):
        ask(implicit(lambda x: sphere(x) + size * random.standard_normal(len(x))))


def test_a_spline_is_not_called_inexact_where_its_pieces_meet():
    random = np.random.default_rng(1)
    places = np.arange(400.0)
    distances = np.hypot(places[:, None] - 200, places - 200) - 100
    values = distances + 0.05 * random.standard_normal(distances.shape)
    made = oracles.SignedDistance.of_volume(values)
    ways = random.standard_normal((20, 2))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    found = made.closest_point(200 + 103 * ways)
    assert np.abs(np.linalg.norm(found - 200, axis=1) - 100).max() < 0.5

    def single(x):
        return made._distance(x.astype(np.float32).astype(float))

    with pytest.raises(stellate.OracleError, match="is exact to"):
        oracles.SignedDistance(single, bounding_box=made.bounding_box).closest_point(200 + ways)


def test_a_density_is_exact_enough_though_it_is_flat_far_from_what_it_is_dense_in():
    centers = np.random.default_rng(1).standard_normal((50, 3))

    def density(x):
        return np.exp(-2 * ((x[:, None] - centers) ** 2).sum(axis=2)).mean(axis=1) - 0.02

    box = [-5.0] * 3, [5.0] * 3

    def made(f):
        return oracles.SignedDistance(f, bounding_box=box)

    near_by = np.full((1, 3), 0.5)
    made(density).closest_point(near_by)
    with pytest.raises(stellate.OracleError, match="is exact to"):
        made(lambda x: density(x.astype(np.float32)).astype(float)).closest_point(near_by)


@pytest.mark.parametrize("taker", TAKERS)
def test_a_function_may_write_into_its_argument(taker):
    make, f = TAKERS[taker]

    def scribbles(x):
        value = f(x)
        x *= 7
        return value

    x = np.random.default_rng(1).uniform(-1, 1, (20, make(f).ambient_dimension))
    assert (make(scribbles).closest_point(x) == make(f).closest_point(x)).all()


def test_how_many_equations_there_have_to_be_is_said():
    curve = stellate.ImplicitManifold(sphere, ambient_dimension=3, dimension=1, bounding_box=CUBE)
    with pytest.raises(
        stellate.OracleError, match=r"dimension 1 in R\^3 is given by 3 - 1 = 2 equations"
    ):
        ask(curve)


def test_a_formula_in_words_is_no_function():
    with pytest.raises(stellate.InvalidArgument, match="f has to be a function, and is 'x - 1'"):
        implicit("x - 1")


def test_an_exception_of_a_function_that_worked_is_left_alone():
    calls = []

    def f(x):
        calls.append(len(x))
        if len(calls) > 3:
            raise ValueError("a licence ran out")
        return sphere(x)

    with pytest.raises(ValueError) as caught:
        ask(implicit(f))
    assert caught.value.args == ("a licence ran out",)


def test_one_equation_may_return_a_number_a_point():
    x = np.random.default_rng(1).uniform(-1, 1, (30, 3))
    flat = implicit(sphere, lambda x: x / np.sqrt(norm2(x))[:, None])
    column = implicit(
        lambda x: sphere(x)[:, None], lambda x: (x / np.sqrt(norm2(x))[:, None])[:, None]
    )
    assert (flat.closest_point(x) == column.closest_point(x)).all()


@pytest.mark.parametrize("name", [*ALL, "clipped", "solid", "bounded"])
def test_no_rows_are_answered_with_no_rows(name):
    more = {
        "clipped": lambda: oracles.Clipped(TORUS, [lambda x: x[:, 0]], ball=([0, 0, 0], 1.2)),
        "solid": lambda: oracles.Solid(lambda x: 1 - norm2(x), CUBE),
        "bounded": lambda: half_of_a_sphere(lambda x: x[:, 2]),
    }
    oracle = more[name]() if name in more else ALL[name][0]()
    d, k = oracle.ambient_dimension, oracle.dimension
    none = np.empty((0, d))
    for _ in range(2):  # before it was asked anything else, and after
        assert oracle.closest_point(none).shape == (0, d)
        assert oracle.tangent_basis(none).shape == (0, d, k)
        if hasattr(oracle, "intersect_flat"):
            points, found = oracle.intersect_flat(none, np.empty((0, d, k)), np.empty(0))
            assert points.shape == (0, d) and found.shape == (0,)
        if getattr(oracle, "local_size", None) is not None:
            assert oracle.local_size(none).shape == (0,)
        if getattr(oracle, "walls", 0):
            assert oracle.clearances(none).shape == (0, oracle.walls)
            assert oracle.face_point(none, (0,)).shape == (0, d)
            assert oracle.conormals(none, (0,)).shape == (0, 1, d)
        ask(oracle) if name in more else near(oracle, ALL[name][1], 5)


@pytest.mark.parametrize(
    "f, near_to",
    [
        (lambda u: np.stack([u[:, 0], u[:, 1], u[:, 2] ** 2], axis=1), lambda u: abs(u[2])),
        (
            lambda u: np.stack(
                [u[:, 0] ** 2 - u[:, 1] ** 2, 2 * u[:, 0] * u[:, 1], u[:, 2]], axis=1
            ),
            lambda u: np.hypot(u[0], u[1]),
        ),
    ],
    ids=["a reflection", "a rotation that has fixed points"],
)
def test_what_is_no_immersion_is_refused_with_the_place(f, near_to):
    with pytest.raises(stellate.InvalidArgument, match="not an immersion near") as caught:
        oracles.Quotient(manifolds.Sphere(2), f)
    place = str(caught.value).split("near [")[1].split("]")[0]
    assert near_to([float(number) for number in place.split(",")]) < 1e-3


def half_space(x):
    return x[:, 0] - 0.2


PICKLED = {
    "ellipsoid": lambda: manifolds.ellipsoid(),
    "tanglecube": lambda: manifolds.tanglecube(),
    "signed distance": lambda: oracles.SignedDistance(sphere, bounding_box=CUBE),
    "clipped": lambda: oracles.Clipped(TORUS, [half_space], ball=([0, 0, 0], 1.2)),
    "solid": lambda: oracles.Solid(half_space, box=CUBE),
    "level set": lambda: oracles.LevelSet(TORUS, half_space),
    "parametrized": lambda: oracles.Parametrized(torus_map, None, [0, 0], [TURN] * 2, True),
    **{
        name: ALL[name][0]
        for name in ("product", "transformed", "signed_distance", "projective_plane", "linkage")
    },
    "point_cloud": ALL["point_cloud"][0],
}


@pytest.mark.parametrize("name", PICKLED)
def test_ready_oracles_go_to_other_processes(name):
    oracle = PICKLED[name]()
    x = np.random.default_rng(1).uniform(-1, 1, (20, oracle.ambient_dimension))
    before, found = closest(oracle, x)
    for copy in (pickle.loads(pickle.dumps(PICKLED[name]())), pickle.loads(pickle.dumps(oracle))):
        after, again = closest(copy, x)
        assert (again == found).all() and (after[found] == before[found]).all()
        if getattr(oracle, "walls", 0):
            assert (copy.clearances(x) == oracle.clearances(x)).all()
            assert (copy.face_point(x[:3], (0,)) == oracle.face_point(x[:3], (0,))).all()


@pytest.mark.parametrize("module", [manifolds, oracles])
def test_a_module_offers_what_it_is_for_and_nothing_else(module):
    assert [name for name in dir(module) if not name.startswith("_")] == sorted(module.__all__)


def test_credentials_say_where_they_are_given(capsys):
    help(stellate.Credentials)
    shown = capsys.readouterr().out
    for words in ("stellate.mesh(oracle", "credentials=", "InvalidArgument", "not shown by repr"):
        assert words in shown
