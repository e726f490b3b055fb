"""Equations whose values touch zero, jump over it, or do not say where they lead, and their Jacobians."""

import contextlib

import numpy as np
import pytest
import stellate
from ready_shapes import norm2
from takers import CUBE, TAKERS, ask, implicit, sphere

TOUCHING = {
    "square": lambda x: sphere(x) ** 2,
    "minus a square": lambda x: -(sphere(x) ** 2),
    "fourth power": lambda x: sphere(x) ** 4,
    "distance without a sign": lambda x: np.abs(sphere(x)),
}


@pytest.mark.parametrize("name", TOUCHING)
@pytest.mark.parametrize("taker", ["ImplicitManifold", "SignedDistance"])
def test_a_minimum_at_zero_is_told(taker, name):
    make, _ = TAKERS[taker]
    oracle = make(TOUCHING[name])
    for _ in range(2):  # the second time as the first
        with pytest.raises(stellate.OracleError, match="touches zero without changing") as caught:
            ask(oracle)
    assert caught.value.reason == "ORACLE_TOUCHES_ZERO"
    place = str(caught.value).split("near [")[1].split("]")[0]
    assert np.linalg.norm([float(c) for c in place.split(",")]) == pytest.approx(1, abs=1e-2)
    report = stellate.check(make(TOUCHING[name]))
    assert report.codes[0] == "TOUCHES_ZERO"


def test_the_equation_that_touches_zero_is_named():
    def f(x):
        return np.stack([norm2(x[:, :2]) - 1, (norm2(x[:, 2:]) - 1) ** 2], axis=1)

    oracle = stellate.ImplicitManifold(
        f, ambient_dimension=4, dimension=2, bounding_box=([-1.5] * 4, [1.5] * 4)
    )
    with pytest.raises(stellate.OracleError, match="f's value 1 touches zero"):
        ask(oracle)


def test_a_cube_is_flat_where_it_is_zero():
    with pytest.raises(stellate.OracleError, match="f is flat where it is zero"):
        ask(implicit(lambda x: sphere(x) ** 3))


def small_torus(x):
    return ((np.sqrt(norm2(x[:, :2])) - 1) ** 2 + x[:, 2] ** 2 - 0.16)[:, None]


HALVES = [1e3, 1e4, 1e5, 1e6, 1e7]


def in_a_box_of(half, f):
    oracle = stellate.ImplicitManifold(
        f, ambient_dimension=3, dimension=2, bounding_box=([-half] * 3, [half] * 3)
    )
    oracle.closest_point(np.random.default_rng(1).uniform(-half, half, (20, 3)))


@pytest.mark.parametrize("half", HALVES)
def test_an_equation_is_not_called_flat_because_its_box_is_far_too_large(half):
    if half < 1e5:
        with contextlib.suppress(stellate.NotConverged):
            in_a_box_of(half, small_torus)
        return
    with pytest.raises(stellate.OracleError, match="the box is far too large.*near") as caught:
        in_a_box_of(half, small_torus)
    place = str(caught.value).split("near [")[1].split("]")[0]
    x = np.array([[float(c) for c in place.split(",")]])
    assert abs(small_torus(x)) < 0.01


@pytest.mark.parametrize("half", HALVES[:3])
def test_a_cube_is_called_flat_in_a_large_box(half):
    with pytest.raises(stellate.OracleError, match="f is flat where it is zero"):
        in_a_box_of(half, lambda x: small_torus(x) ** 3)


PASSING = {
    "label": lambda x: (sphere(x) < 0) - 0.5,
    "sign": lambda x: np.sign(sphere(x)),
    "quotient": lambda x: 1 / sphere(x),
    "cube root": lambda x: np.cbrt(sphere(x)),
    "square root": lambda x: np.sign(sphere(x)) * np.sqrt(np.abs(sphere(x))),
}


@pytest.mark.parametrize("name", PASSING)
def test_a_function_that_jumps_over_zero_or_is_steep_without_end_is_told(name):
    with pytest.raises(stellate.OracleError, match="passes zero without being zero, or") as caught:
        ask(implicit(PASSING[name]))
    assert caught.value.reason == "ORACLE_PRECISION"
    place = str(caught.value).split("near [")[1].split("]")[0]
    assert np.linalg.norm([float(c) for c in place.split(",")]) == pytest.approx(1, abs=1e-9)


def in_box(f, half):
    return stellate.ImplicitManifold(
        f, ambient_dimension=3, dimension=2, bounding_box=([-half] * 3, [half] * 3)
    )


@pytest.mark.parametrize(
    "oracle",
    [
        in_box(
            lambda x: norm2(x) - 1, 1e6
        ),  # M is much smaller than what is looked at around a zero
        in_box(lambda x: sphere(x) * np.exp(7 * x[:, 0]), 1.5),  # all but zero in half of the box
        in_box(lambda x: np.exp(-norm2(x)), 1.5),  # tends to zero, far away
    ],
    ids=["a large box", "fades", "is never zero"],
)
def test_what_passes_zero_or_is_not_zero_is_not_said_to_touch_it(oracle):
    try:
        ask(oracle)
    except stellate.NotConverged:
        pass


def test_equations_that_say_the_same_are_told():
    def twice(x):
        return np.stack([sphere(x), 2 * sphere(x)], axis=1)

    oracle = stellate.ImplicitManifold(twice, ambient_dimension=3, dimension=1, bounding_box=CUBE)
    with pytest.raises(stellate.OracleError, match="the 2 values of f are not independent"):
        ask(oracle)


def slopes(x):
    return x / np.sqrt(norm2(x))[:, None]


@pytest.mark.parametrize(
    "jacobian",
    [
        lambda x: -slopes(x),
        lambda x: slopes(x)[:, ::-1],
        lambda x: slopes(x) * [1, 1, 1.2],
        lambda x: 0 * x,
        lambda x: np.where(x[:, :1] > 0.3, np.nan, slopes(x)),
    ],
    ids=["sign", "order", "factor", "zero", "not finite"],
)
def test_a_jacobian_that_is_not_the_derivative_is_told(jacobian):
    with pytest.raises(stellate.OracleError, match="jacobian is not f's derivative, as") as caught:
        ask(implicit(sphere, jacobian))
    assert caught.value.reason == "ORACLE_DERIVATIVE"


def test_a_jacobian_is_not_accused_where_the_function_has_a_crease_or_an_end():
    with np.errstate(invalid="ignore"), pytest.raises(stellate.NotConverged):
        implicit(sphere, slopes).closest_point(np.zeros((3, 3)))

    def half(x):
        return np.where(x[:, 2] > 0.2, np.nan, sphere(x))

    def crease(x):
        return np.abs(x).max(axis=1) - 1

    def beside(x):
        axis = np.abs(x).argmax(axis=1)
        return np.eye(3)[axis] * np.sign(x)

    x = np.random.default_rng(1).uniform(-1, 1, (200, 3))
    with np.errstate(invalid="ignore"), pytest.raises(stellate.NotConverged):
        implicit(half, slopes).closest_point(x)
    try:
        implicit(crease, beside).closest_point(x)
    except stellate.NotConverged:
        pass


def test_solvers_that_fail_elsewhere_accuse_nobody():
    with pytest.raises(stellate.NotConverged):
        implicit(lambda x: norm2(x) - 1, lambda x: 2 * x).closest_point(np.zeros((3, 3)))
    with pytest.raises(stellate.NotConverged):
        ask(implicit(lambda x: norm2(x) + 1))
