"""The ready oracles of C++, asked through the pipe, are those of Python: the same points, the same
meshes, simplex for simplex as many."""

import os
import pathlib

import numpy as np
import pytest
import stellate
from ready_shapes import (
    ALL,
    TORUS,
    TURN,
    clifford,
    closest,
    near,
    torus_cloud,
    torus_map,
    torus_triangles,
)
from stellate import oracles


def turned_torus():
    rotation = np.eye(5)
    for i in range(4):
        turn = np.eye(5)
        turn[i : i + 2, i : i + 2] = [[0.8, -0.6], [0.6, 0.8]]
        rotation = turn @ rotation
    return oracles.Transformed(TORUS, rotation=rotation[:, :3], scale=2, translation=np.arange(5.0))


def torus_distance():
    return oracles.SignedDistance(
        lambda x: np.hypot(np.hypot(x[:, 0], x[:, 1]) - 1, x[:, 2]) - 0.4,
        bounding_box=([-1.5] * 3, [1.5] * 3),
    )


def uneven_cloud():
    number = np.arange(4000.0)
    u = np.stack([0.7548776662466927 * number % 1, 0.5698402909980532 * number % 1], axis=1)
    u[:, 0] *= u[:, 0]
    return (1 + 0.003 * np.sin(12.9898 * number))[:, None] * torus_map(TURN * u)


def four_bars():
    return oracles.Linkage(
        [("a", "p", 1.0), ("p", "q", 1.3), ("q", "b", 1.1)], {"a": (0, 0), "b": (1.5, 0)}
    )


# As tests/support/ready_oracles.cc makes them; how far from M they are asked; how far the answers may
# be apart: what the tolerances of the solvers leave, where the two stop on either side of a point.
ORACLES = {
    "parametrized": (ALL["parametrized"][0], 0.2, 1e-9),
    "parametrized_differences": (ALL["parametrized_differences"][0], 0.2, 1e-8),
    "charts": (ALL["charts"][0], 0.5, 1e-8),
    "product": (ALL["product"][0], 0.2, 1e-12),
    "transformed": (turned_torus, 0.4, 1e-12),
    "level_set": (ALL["level_set"][0], 0.1, 1e-8),
    "signed_distance": (torus_distance, 0.2, 1e-7),
    "grid": (ALL["signed_distance"][0], 0.2, 1e-7),
    "constraint_set": (clifford, 0.2, 1e-8),
    "linkage": (four_bars, 0.05, 1e-8),
    "point_cloud": (lambda: oracles.PointCloud(torus_cloud(), 2, bandwidth=0.2), 0.1, 1e-9),
    "uneven_cloud": (lambda: oracles.PointCloud(uneven_cloud(), 2), 0.1, 1e-8),
    "triangle_mesh": (lambda: oracles.TriangleMesh(*torus_triangles()), 0.1, 1e-9),
}
OF_THE_CATALOGUE = ("product", "transformed", "level_set")  # whose boxes have margins of their own
MESHED = {"parametrized": 0.2, "charts": 0.5, "level_set": 0.1, "linkage": 0.1,
          "point_cloud": 0.2, "triangle_mesh": 0.2, "constraint_set": 0.3}  # fmt: skip


def in_cpp(name, **more):
    programs = pathlib.Path(os.environ["STELLATED"]).parent
    return stellate.CommandOracle(f"{programs / 'ready_oracle'} {name}", **more)


@pytest.mark.parametrize("name", ORACLES)
def test_points_and_tangents_agree(name):
    make, away, error = ORACLES[name]
    ours = make()
    x = near(ours, away)
    with in_cpp(name) as theirs:
        assert theirs.dimension == ours.dimension
        for ability in ("tangent_basis", "intersect_flat"):
            assert hasattr(theirs, ability) == hasattr(ours, ability), ability
        if name not in OF_THE_CATALOGUE:
            for a, b in zip(theirs.bounding_box, ours.bounding_box):
                assert np.abs(a - b).max() < 1e-9
        y, found = closest(ours, x)
        there, found_there = closest(theirs, x)
        both = found & found_there
        assert both.mean() > 0.95
        assert np.abs(y - there)[both].max() < error
        # A tangent space moves with its point by at most the distance over the reach.
        a, b = ours.tangent_basis(y[both]), theirs.tangent_basis(y[both])
        turned = a @ a.transpose(0, 2, 1) - b @ b.transpose(0, 2, 1)
        assert np.abs(turned).max() < 100 * error + 1e-7


@pytest.mark.parametrize("name", MESHED)
def test_meshes_have_the_same_counts(name, server):
    oracle = ORACLES[name][0]()
    ours = stellate.mesh(oracle, MESHED[name], server)
    with in_cpp(name, bounding_box=oracle.bounding_box) as oracle:
        theirs = stellate.mesh(oracle, MESHED[name], server)
    assert ours.certified and theirs.certified, theirs.report
    assert len(theirs.points) == len(ours.points)
    assert len(theirs.simplices) == len(ours.simplices)
