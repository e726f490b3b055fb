"""What is said before a mesh begins: solids without an end, and lengths that cannot be meant."""

import warnings

import numpy as np
import pytest
import stellate
from stellate import manifolds, oracles, solids
from stellate._extent import insist_on_an_end, warn_of_count
from stellate.oracle import CheckedOracle

CUBE = ([-1] * 3, [1] * 3)
MOST = 10_000_000


def squared(x):
    return (x**2).sum(axis=1)


WITHOUT_END = {
    "the function has no zero there .* as a square has none": lambda: stellate.ImplicitSolid(
        squared, bounding_box=CUBE
    ),
    "is a sign the wrong way round": lambda: solids.Implicit(
        lambda x: squared(x) - 0.5, bounding_box=CUBE
    ),
    "as at .3.9, 0.0, 0.0.*solids.Implicit.g. & solids.Box": lambda: solids.Implicit(
        lambda x: 0.1 - x[:, 1] ** 2 - x[:, 2] ** 2, bounding_box=CUBE
    ),
    "the solid goes on": lambda: oracles.Solid([lambda x: squared(x) - 0.5], CUBE, labels=[0, 1]),
}


@pytest.mark.parametrize("words", WITHOUT_END)
def test_a_solid_without_an_end_is_refused(words):
    with pytest.raises(stellate.OracleError, match=words) as caught:
        insist_on_an_end(CheckedOracle(WITHOUT_END[words]()))
    assert caught.value.reason == "ORACLE_UNBOUNDED"


def far_refused(x):
    if np.abs(x).max() > 1.2:
        raise ValueError("outside of the data")
    return 0.5 - squared(x)


@pytest.mark.parametrize(
    "solid",
    [
        solids.Ball() - solids.Ball(0.5),
        solids.Implicit(
            lambda x: 1.2 - squared(x), bounding_box=CUBE
        ),  # it leaves its box a little
        solids.Implicit(lambda x: squared(x) - 0.5) & solids.Box(-1, 1),
        solids.Labels(matrix=solids.Box(-1, 1), grain=solids.Ball(0.5)),
        oracles.Solid([lambda x: squared(x) - 0.5], CUBE, labels=[1, 0]),
        stellate.ImplicitSolid(far_refused, bounding_box=CUBE),
        manifolds.Sphere(2),
    ],
)
def test_what_ends_is_not_refused(solid):
    insist_on_an_end(CheckedOracle(solid))


def said(oracle, epsilon, is_graded=False, most=MOST):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        warn_of_count(CheckedOracle(oracle), epsilon, is_graded, lambda: most)
    return " ".join(str(it.message) for it in caught)


def torus(tube):
    return stellate.ImplicitManifold(
        lambda x: (np.hypot(x[:, 0], x[:, 1]) - 1) ** 2 + x[:, 2] ** 2 - tube**2,
        ambient_dimension=3,
        dimension=2,
        bounding_box=([-1.5] * 3, [1.5] * 3),
    )


# (oracle, an epsilon, how many vertices a mesh of it had)
@pytest.mark.parametrize(
    ("oracle", "epsilon", "had"),
    [
        (manifolds.Torus(), 0.1, 874),
        (manifolds.Sphere(2), 0.25, 139),
        (manifolds.Sphere(3), 0.3, 552),
        (manifolds.SpecialOrthogonal3(), 0.4, 2240),
        (torus(0.1), 0.03, 2288),
        (torus(0.02), 0.007, 7902),
    ],
)
def test_vertices_are_foreseen_within_a_factor_that_is_allowed_for(oracle, epsilon, had):
    k = oracle.dimension
    finer = epsilon * (had / 1e9) ** (1 / k)  # a thousand million
    assert "vertices" in said(oracle, finer / 2 ** (1 / k), most=10**8 - 1)
    assert said(oracle, finer * 2 ** (1 / k), most=10**8) == ""


def test_an_epsilon_for_too_many_vertices_is_said_with_one_that_will_do():
    words = said(manifolds.Torus(), 1e-9)
    assert "epsilon = 1e-09 asks for about 9e+18 vertices" in words
    assert "10,000,000" in words and "An epsilon of 0.0013 takes about half" in words
    assert "vertices" in said(solids.Ball(), 1e-5)
    assert "vertices" in said(manifolds.Torus(), 1e-9, is_graded=True)  # it has more then


def test_axes_of_different_units_are_thought_of():
    terrain = stellate.ImplicitManifold(
        lambda x: x[:, 2] - 1500 - 100 * np.sin(9 * x[:, 0]) * np.cos(9 * x[:, 1]),
        ambient_dimension=3,
        dimension=2,
        bounding_box=([7.5, 45.8, 1300], [8.1, 46.2, 1700]),
    )
    assert "different units, scale=[0.6, 0.4, 400.0] divides" in said(terrain, 0.01, most=1000)


def test_an_epsilon_beyond_the_box_is_said():
    assert "larger than the bounding box, whose corners are 5.2 apart" in said(torus(0.4), 300.0)
    assert said(torus(0.4), 300.0, is_graded=True) == ""


def test_usual_lengths_cost_no_question():
    class Counting(manifolds.Sphere):
        asked = 0

        def closest_point(self, points):
            Counting.asked += 1
            return super().closest_point(points)

    assert said(Counting(2), 0.1) == "" and Counting.asked == 0
