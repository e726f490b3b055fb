"""Functions of users whose zero sets are no manifolds: the run ends, and says what there is and where."""

import re

import numpy as np
import pytest
import stellate
from stellate import oracles

BOX = [-1.5] * 3, [1.5] * 3


def place(verdict, words):
    found = re.search(words + r" near \(([^)]*)\)", verdict)
    assert found and "no epsilon will do" in verdict, verdict
    return np.array([float(x) for x in found[1].split(",")])


def test_the_union_of_a_block_and_a_ball_has_creases(server):
    half = np.array([1.0, 1.0, 0.3])

    def f(p):
        q = np.abs(p) - half
        block = np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0)
        return np.minimum(block, np.linalg.norm(p - [0, 0, 0.6], axis=1) - 0.6)

    mesh = stellate.mesh(stellate.oracles.SignedDistance(f, bounding_box=BOX), 0.12, server=server)
    at = place(mesh.report.certificate.verdict, "has a crease or a tip")
    gaps = np.sort(np.abs(np.abs(at) - half))
    edge = np.hypot(gaps[0], gaps[1])
    seam = np.hypot(at[2] - 0.3, np.hypot(at[0], at[1]) - np.sqrt(0.27))
    assert min(edge, seam) < 1e-3, at


def test_cylinders_of_one_radius_cross(server):
    curves = stellate.ImplicitManifold(
        lambda x: np.stack([x[:, 0] ** 2 + x[:, i] ** 2 - 1 for i in (1, 2)], axis=1),
        ambient_dimension=3,
        dimension=1,
        bounding_box=BOX,
    )
    mesh = stellate.mesh(curves, 0.05, server=server)
    at = place(mesh.report.certificate.verdict, "crosses itself or is singular")
    np.testing.assert_allclose([abs(at[0]), at[1], at[2]], [1, 0, 0], atol=1e-3)


@pytest.mark.parametrize("epsilon", [0.2, 0.05, 0.005])
def test_a_square_has_corners_however_fine_its_mesh(server, epsilon):
    # f's differences, from which the tangent spaces come, take both sides of a corner together.
    square = stellate.ImplicitManifold(
        lambda x: np.abs(x).sum(axis=1, keepdims=True) - 1,
        ambient_dimension=2,
        dimension=1,
        bounding_box=([-2, -2], [2, 2]),
    )
    mesh = stellate.mesh(square, epsilon, server=server)
    at = place(mesh.report.certificate.verdict, "has a crease or a tip")
    np.testing.assert_allclose(np.sort(np.abs(at)), [0, 1], atol=1e-4)


@pytest.mark.parametrize("epsilon", [0.05, 0.0053])
def test_a_curve_with_kinks_is_not_called_too_coarse(server, epsilon):
    def f(x):
        a, b, c, p, q = x.T
        return np.stack([a**2 + b**2 - 1, c - a * b, p - a**3, q - np.abs(b)], axis=1)

    curve = stellate.ImplicitManifold(
        f, ambient_dimension=5, dimension=1, bounding_box=([-2] * 5, [2] * 5)
    )
    mesh = stellate.mesh(curve, epsilon, server=server)
    at = place(mesh.report.certificate.verdict, "has a crease or a tip")
    np.testing.assert_allclose([abs(at[0]), *at[[1, 2, 4]]], [1, 0, 0, 0], atol=1e-4)


def cube(x):
    return np.abs(x).max(axis=1) - 1


def cylinder(x):
    return np.maximum(np.hypot(x[:, 0], x[:, 1]) - 1, np.abs(x[:, 2]) - 0.8)


def cut_ball(x):
    return np.maximum(np.linalg.norm(x, axis=1) - 1.1, -x[:, 2] - 0.2)


def off_the_edge(f, at):
    """How far a place is from the nearest edge of these solids."""
    if f is cube:
        return np.hypot(*np.sort(np.abs(np.abs(at) - 1))[:2])
    height, radius = (0.8, 1) if f is cylinder else (0.2, np.sqrt(1.1**2 - 0.2**2))
    return np.hypot(abs(at[2]) - height, np.hypot(at[0], at[1]) - radius)


@pytest.mark.parametrize("f", [cube, cylinder, cut_ball])
@pytest.mark.parametrize("epsilon", [0.3, 0.5])
def test_edges_of_a_maximum_are_named_at_any_epsilon(f, epsilon, server):
    """Gradients find nothing beyond such an edge, which once left what it is unsaid."""
    oracle = stellate.ImplicitManifold(f, ambient_dimension=3, dimension=2, bounding_box=BOX)
    verdict = stellate.mesh(oracle, epsilon, server=server).report.certificate.verdict
    assert "smaller epsilon" not in verdict
    assert off_the_edge(f, place(verdict, "has a crease or a tip")) < 1e-3, verdict


def drop(x):
    return np.hypot(x[:, 0], x[:, 1]) - x[:, 2] * np.sqrt(np.clip(1 - x[:, 2], 0, None))


def both_cones(x):
    return x[:, 0] ** 2 + x[:, 1] ** 2 - x[:, 2] ** 2


def ding_dong(x):
    return x[:, 0] ** 2 + x[:, 1] ** 2 - (1 - x[:, 2]) * x[:, 2] ** 2


@pytest.mark.parametrize(
    "f, wall, words",
    [
        (drop, None, "has a crease or a tip"),
        (both_cones, lambda x: 1 - (x**2).sum(axis=1), "crosses itself or is singular"),
        (ding_dong, lambda x: x[:, 2] + 1, "crosses itself or is singular"),
    ],
)
def test_the_tip_of_a_cone_is_named(f, wall, words, server):
    """Tangent spaces at two points of a cone meet in a line, which leads elsewhere."""
    oracle = stellate.ImplicitManifold(f, ambient_dimension=3, dimension=2, bounding_box=BOX)
    if wall:
        oracle = oracles.Clipped(oracle, [wall])
    verdict = stellate.mesh(oracle, 0.1, server=server).report.certificate.verdict
    assert "smaller epsilon" not in verdict
    assert np.linalg.norm(place(verdict, words)) < 1e-3, verdict


def test_a_root_ends_on_the_manifold(server):
    def f(x):
        with np.errstate(invalid="ignore"):
            return x[:, 2] - np.sqrt(1 - x[:, 0] ** 2 - x[:, 1] ** 2)

    def slope(x):
        with np.errstate(invalid="ignore"):
            root = np.sqrt(1 - x[:, 0] ** 2 - x[:, 1] ** 2)
        return np.stack([x[:, 0] / root, x[:, 1] / root, np.ones(len(x))], axis=1)

    def half(*slopes, **more):
        space = {"ambient_dimension": 3, "dimension": 2, "bounding_box": ([-2] * 3, [2] * 3)}
        return stellate.ImplicitManifold(f, *slopes, **space, **more)

    mesh = stellate.mesh(half(slope), 0.3, server=server)
    assert not mesh.report.certified
    verdict = mesh.report.certificate.verdict
    assert "ends where f does, near" in verdict and "cut it by a wall" in verdict, verdict
    with pytest.raises(stellate.OracleError, match="ends where f does"):
        stellate.mesh(half(), 0.3, server=server)
    cut = half(inequalities=[lambda x: x[:, 2] - 0.3])
    assert stellate.mesh(cut, 0.2, server=server).report.certified
