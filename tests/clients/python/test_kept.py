"""oracles.kept: which points are kept, and what cannot be."""

import pickle

import numpy as np
import pytest
import stellate
from shapes import equation
from stellate import manifolds, oracles

BOX = [-1.5] * 3, [1.5] * 3


def answered(oracle, x):
    try:
        return oracle.closest_point(x), np.ones(len(x), dtype=bool)
    except stellate.NotConverged as error:
        return error.points, error.converged


@pytest.mark.parametrize(
    "manifold, seed",
    [
        (manifolds.Torus(), [1.4, 0, 0]),
        (manifolds.Torus(1, 0.1), [1.1, 0, 0]),
        (manifolds.Sphere(3), [1, 0, 0, 0]),
        (manifolds.Sphere(1), [1, 0]),
    ],
)
def test_all_of_a_component_is_kept(manifold, seed, rng):
    part = oracles.kept(manifold, "seeds", [seed])
    lower, upper = manifold.bounding_box
    x = lower + rng.random((5000, len(lower))) * (np.asarray(upper) - lower)
    y, found = answered(part, x)
    assert found.all()
    np.testing.assert_array_equal(y, manifold.closest_point(x))


@pytest.mark.parametrize("unit", [1e-9, 1e6])
def test_a_seed_is_enough_in_any_unit(unit, rng):
    whole = oracles.Transformed(manifolds.Torus(), scale=unit)
    part = oracles.kept(without(whole, "bounding_box"), "seeds", [[1.4 * unit, 0, 0]])
    x = unit * rng.uniform(-1.5, 1.5, (1000, 3))
    assert answered(part, x)[1].all()


@pytest.mark.parametrize("gap", [0.3, 0.1, 0.05])
@pytest.mark.parametrize("outer", [False, True])
def test_nothing_of_a_sheet_beside_it_is_kept(gap, outer, rng):
    shells = equation(
        lambda x: (np.linalg.norm(x, axis=1) - 1) * (np.linalg.norm(x, axis=1) - 1 - gap)
    )
    radius = 1 + gap * outer
    part = oracles.kept(shells, "seeds", [[0, 0, radius]])
    x = rng.uniform(-1.5, 1.5, (3000, 3))
    y, found = answered(shells, x)
    kept, there = answered(part, x)
    wanted = found & (np.abs(np.linalg.norm(y, axis=1) - radius) < gap / 2)
    np.testing.assert_array_equal(there, wanted)
    np.testing.assert_array_equal(kept[there], y[there])


def test_an_answer_depends_on_its_question_alone(rng):
    part = pickle.loads(pickle.dumps(oracles.kept(manifolds.Torus(), "seeds", [[1.4, 0, 0]])))
    x = rng.uniform(-1, 1, (200, 3))
    apart = np.concatenate([part.closest_point(row[None]) for row in x])
    np.testing.assert_array_equal(part.closest_point(x), apart)
    assert part.closest_point(x[:0]).shape == (0, 3)


def graph():
    return equation(lambda x: x[:, 2] - x[:, 0] ** 3 + x[:, 0])


def without(oracle, *names):
    """The oracle's closest points, and nothing of `names`."""
    kept = {"dimension", "ambient_dimension", "closest_point", "tangent_basis", "bounding_box"}
    own = {name: getattr(oracle, name) for name in kept - set(names)}
    return type("Bare", (), {**own, "closest_point": staticmethod(oracle.closest_point)})()


@pytest.mark.parametrize(
    "oracle, keep, seeds, words",
    [
        (manifolds.Torus(), "boxes", None, "keep has to be 'box'.*'boxes'"),
        (manifolds.Torus(), "seeds", None, "there are none: give seeds, or keep='box'"),
        (
            without(manifolds.Torus(), "bounding_box"),
            "box",
            None,
            "bounding_box, and Bare has none",
        ),
        (without(manifolds.Torus(), "tangent_basis"), "seeds", [[1, 0, 0]], "its tangent_basis"),
        (
            oracles.Clipped(manifolds.Torus(), ball=([1, 0, 0], 0.5)),
            "seeds",
            [[1, 0, 0]],
            "keep the components first",
        ),
        (graph(), "seeds", [[0, 0, 0]], "leaves the bounding box near .*keep='box'"),
        (
            oracles.SignedDistance(lambda x: np.abs(x).max(axis=1) - 1, bounding_box=BOX),
            "seeds",
            [[1, 0, 0]],
            "cannot follow the manifold beyond .*crease",
        ),
    ],
)
def test_what_cannot_be_kept_is_refused_in_words(oracle, keep, seeds, words):
    with pytest.raises(stellate.InvalidArgument, match=words):
        oracles.kept(oracle, keep, seeds)


def test_declaring_a_mesh_wants_the_oracle_of_what_is_kept():
    with pytest.raises(TypeError, match="oracles.kept"):
        stellate._wire.spec.mesh_spec(
            stellate.oracle.CheckedOracle(manifolds.Torus()), 0.1, {"keep": "box"}
        )
