"""What is checked of an oracle and its answers before anything is sent."""

import threading

import numpy as np
import pytest
import stellate
from stellate._generated import oracle_pb2
from stellate._wire.arrays import from_wire, to_wire
from stellate._wire.spec import mesh_spec
from stellate._worker import answer
from stellate.manifolds import Sphere, Torus
from stellate.oracle import CheckedOracle


class Odd(Torus):
    """A torus whose methods can be replaced."""

    def __init__(self, **methods):
        super().__init__()
        for name, method in methods.items():
            setattr(self, name, method)


POINTS = np.array([[1.0, 0, 0.1], [0, 1.5, 0], [-0.5, 0.3, 0.2]])


@pytest.mark.parametrize(
    "value, reason, words",
    [
        (np.ones((2, 3)), "ORACLE_SHAPE", r"shape \(2, 3\) for a batch of 3.*\(3, 3\)"),
        (np.ones(9), "ORACLE_SHAPE", r"\(9,\)"),
        (None, "ORACLE_SHAPE", "NoneType"),
        ([[1, 2], [3]], "ORACLE_SHAPE", "list"),
        (np.ones((3, 3), dtype=complex), "ORACLE_SHAPE", "complex128"),
        (np.full((3, 3), "a"), "ORACLE_SHAPE", "<U1"),
        (
            np.array([[1, 0, 0], [0, np.nan, 0], [0, 0, np.inf]]),
            "ORACLE_NOT_FINITE",
            "query 1.*2 answ",
        ),
    ],
)
def test_bad_closest_points(value, reason, words):
    oracle = CheckedOracle(Odd(closest_point=lambda x: value))
    with pytest.raises(stellate.OracleError, match=words) as caught:
        oracle.closest_points(POINTS)
    assert caught.value.reason == reason


@pytest.mark.parametrize(
    "value, words",
    [
        (np.ones((3, 3)), "pair"),
        ((np.ones((3, 3)), np.ones(2, bool)), "found"),
        ((np.ones((3, 3)), np.ones(3)), "float64.*found"),
        ((np.ones((3, 2)), np.ones(3, bool)), r"\(3, 2\)"),
        ((np.full((3, 3), np.nan), np.array([False, True, False])), "query 1"),
    ],
)
def test_bad_intersections(value, words):
    oracle = CheckedOracle(Odd(intersect_flat=lambda c, t, r: value))
    with pytest.raises(stellate.OracleError, match=words):
        oracle.intersections(POINTS, np.zeros((3, 3, 2)), np.ones(3))


def test_nan_where_nothing_is_found_is_fine():
    found = np.array([True, False, True])
    answers = np.where(found[:, None], POINTS, np.nan)
    oracle = CheckedOracle(Odd(intersect_flat=lambda c, t, r: (answers, found)))
    points, flags = oracle.intersections(POINTS, np.zeros((3, 3, 2)), np.ones(3))
    assert flags.tolist() == [True, False, True]
    assert np.isfinite(points).all() and np.array_equal(points[found], POINTS[found])


def test_bad_tangents():
    oracle = CheckedOracle(Odd(tangent_basis=lambda p: np.ones((len(p), 2, 3))))
    with pytest.raises(stellate.OracleError, match=r"tangent_basis.*\(3, 2, 3\).*\(3, 3, 2\)"):
        oracle.tangents(POINTS, np.ones(3, bool))


def test_not_converged_becomes_not_found_and_its_tangents_are_not_asked_for():
    asked = []

    def closest_point(x):
        raise stellate.NotConverged(x * 2, x[:, 0] > 0)

    def tangent_basis(p):
        asked.append(p)
        return np.broadcast_to(np.eye(3, 2), (len(p), 3, 2))

    oracle = CheckedOracle(Odd(closest_point=closest_point, tangent_basis=tangent_basis))
    chunk = oracle_pb2.QueryChunk(
        lease=7,
        kind=oracle_pb2.QUERY_KIND_CLOSEST_POINT,
        points=to_wire(POINTS),
        want_tangents=True,
    )
    reply = answer(oracle, chunk).answers
    assert reply.lease == 7
    assert reply.found == bytes([1, 0, 0])
    assert np.array_equal(from_wire(reply.points, 3, 3)[0], POINTS[0] * 2)
    assert np.array_equal(asked[0], POINTS[:1] * 2) and len(asked) == 1
    bases = from_wire(reply.tangents, 3, 3, 2)
    assert np.allclose(bases.transpose(0, 2, 1) @ bases, np.eye(2))


def test_lists_and_integers_are_taken_as_numbers():
    oracle = CheckedOracle(Odd(closest_point=lambda x: [[1, 2, 3]] * len(x)))
    points, found = oracle.closest_points(POINTS)
    assert points.dtype == np.float64 and found.all()


def test_queries_cannot_be_scribbled_on():
    def closest_point(x):
        x -= 1
        return x

    chunk = oracle_pb2.QueryChunk(kind=oracle_pb2.QUERY_KIND_CLOSEST_POINT, points=to_wire(POINTS))
    with pytest.raises(ValueError, match="read-only; the arrays that closest_point .*: copy them"):
        answer(CheckedOracle(Odd(closest_point=closest_point)), chunk)


@pytest.mark.parametrize("thread_safe", [False, True])
def test_calls_overlap_only_where_that_is_allowed(thread_safe):
    second_inside, overlap = threading.Event(), []

    def closest_point(x):
        if threading.current_thread() is second:
            second_inside.set()
        else:
            second.start()
            # A call that must not come cannot be waited for without a limit.
            overlap.append(second_inside.wait(60 if thread_safe else 0.3))
        return x

    oracle = CheckedOracle(Odd(closest_point=closest_point, thread_safe=thread_safe))
    second = threading.Thread(target=oracle.closest_points, args=(POINTS,))
    oracle.closest_points(POINTS)
    second.join()
    assert overlap == [thread_safe] and second_inside.is_set()


class Bare:
    dimension, ambient_dimension = 2, 3

    def closest_point(self, x):
        return x


def test_capabilities_are_what_the_oracle_has():
    spec = mesh_spec(CheckedOracle(Bare()), 0.1, {})
    assert not spec.oracle.intersect_flat and not spec.oracle.tangent_basis
    assert not spec.HasField("bounding_box") and not spec.HasField("seeds")
    assert not spec.criteria.HasField("candidates")
    spec = mesh_spec(CheckedOracle(stellate.manifolds.tanglecube()), 0.1, {})
    assert spec.oracle.intersect_flat and spec.oracle.tangent_basis
    assert list(spec.bounding_box.lower.shape) == [3]


def test_keywords_reach_their_fields():
    values = {"candidates": 7, "max_vertices": np.int64(9), "label": "x", "seeds": [[1, 2, 3]]}
    spec = mesh_spec(CheckedOracle(Bare()), np.float32(0.5), {**values, "random_seed": None})
    assert (spec.criteria.candidates, spec.limits.max_vertices, spec.label) == (7, 9, "x")
    assert spec.epsilon == 0.5 and spec.random_seed == 0
    assert list(spec.seeds.shape) == [1, 3]


@pytest.mark.parametrize(
    "keywords, error, words",
    [
        ({"candidate": 3}, TypeError, "did you mean 'candidates'"),
        ({"seed": 3}, TypeError, "did you mean 'seeds' or 'random_seed'"),
        ({"vertices": 3}, TypeError, "did you mean .*'max_vertices'"),
        ({"qqqq": 3}, TypeError, "known: .*radius_edge_bound"),
        ({"epsilom": 3}, TypeError, "did you mean 'epsilon'"),
        ({"checkpint": "x"}, TypeError, "did you mean 'checkpoint'"),
        ({"candidates": -1}, stellate.InvalidArgument, "candidates cannot be -1"),
        ({"candidates": 1.5}, stellate.InvalidArgument, "candidates cannot be 1.5"),
        ({"radius_edge_bound": "two"}, stellate.InvalidArgument, "radius_edge_bound"),
        ({"seeds": "here"}, stellate.InvalidArgument, "seeds"),
        ({"seeds": [1, 0, 0]}, stellate.InvalidArgument, r"shape \(m, 3\).*one is \[\[1, 0, 0\]\]"),
        ({"seeds": []}, stellate.InvalidArgument, r"shape \(m, 3\), and have the shape \(0,\)"),
    ],
)
def test_bad_keywords(keywords, error, words):
    with pytest.raises(error, match=words):
        mesh_spec(CheckedOracle(Bare()), 0.1, keywords)


@pytest.mark.parametrize(
    "changed, words",
    [
        ({"dimension": 1.5}, "whole number, and is 1.5"),
        ({"dimension": "two"}, "whole number"),
        ({"dimension": float("nan")}, "whole number"),
        ({"closest_point": None}, "no method closest_point"),
        ({"bounding_box": 3}, "bounding_box"),
        ({"bounding_box": ["a", "b"]}, "bounding_box"),
        ({"seeds": [[1, 2], [3]]}, "seeds"),
    ],
)
def test_bad_oracles(changed, words):
    with pytest.raises(stellate.InvalidArgument, match=words):
        CheckedOracle(Odd(**changed))


def test_what_is_missing_is_named():
    with pytest.raises(stellate.InvalidArgument, match="int has no attribute dimension"):
        CheckedOracle(3)


@pytest.mark.parametrize(
    "given, words",
    [
        (lambda x: x, "ImplicitManifold"),
        (POINTS, "PointCloud"),
        (POINTS > 0, r"of a mask, .*SignedDistance.of_volume\(array"),
        ("scan.stl", "TriangleMesh"),
    ],
)
def test_what_makes_an_oracle_of_something_else_is_said(given, words):
    with pytest.raises(stellate.InvalidArgument, match=words):
        CheckedOracle(given)


def test_a_ready_manifold_is_an_oracle():
    assert isinstance(Sphere(), stellate.Oracle)


@pytest.mark.parametrize(
    "about, told",
    [
        (None, ""),
        ("fitted with 3 knots", "fitted with 3 knots"),
        ("two\nlines\x1b[2J", "two lines [2J"),
        ("long " * 100, "long " * 60),
    ],
)
def test_an_oracle_tells_of_itself_in_a_line_that_is_fit_to_be_shown(about, told):
    oracle = Sphere(2)
    if about is not None:
        oracle.about = about
    assert CheckedOracle(oracle).about == told
