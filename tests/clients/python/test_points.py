"""What stellate.reconstruct takes, and what it says of what it does not take; no server."""

import pathlib
import sys

import numpy as np
import pytest
import stellate
from stellate._generated import mesh_pb2 as pb
from stellate._points import CheckedPoints


def checked(points, dimension=1, tangents=None, noise="auto", reach=None, drop=0.001):
    return CheckedPoints(points, dimension, tangents, noise, reach, drop, True, {}, None)


@pytest.mark.parametrize(
    "points, words",
    [
        ([[0, 1], [2, 3], [4, np.nan]], "row 2 of points is"),
        ([[0, 1], [2, np.inf], [4, 5]], "row 1 of points is"),
        ([[0, 1], [2, 3], [4]], "row 2 has 1 and row 0 has 2"),
        ([0, 1, 2], "have 1 axes, and need 2"),
        (np.zeros((3, 2, 2)), "have 3 axes"),
        (np.zeros((0, 3)), "points is 0 but"),
        ([["a", "b"]], "have to be numbers"),
        (np.ma.masked_array([[0, 1], [2, 3]], [[0, 0], [0, 1]]), "row 1 of points"),
    ],
)
def test_the_row_that_is_wrong_is_named(points, words):
    with pytest.raises(stellate.InvalidArgument, match=words):
        stellate.reconstruct(points, 1)


@pytest.mark.parametrize("dimension", [1.5, "2", True, -1])
def test_a_dimension_is_a_whole_number(dimension):
    with pytest.raises(stellate.InvalidArgument, match="dimension"):
        checked([[0, 1], [2, 3]], dimension)


@pytest.mark.parametrize(
    "name, value", [("noise", "much"), ("noise", [1]), ("reach", "x"), ("drop", None)]
)
def test_numbers_are_numbers(name, value):
    with pytest.raises(stellate.InvalidArgument, match=name):
        checked([[0, 1], [2, 3]], **{name: value})


def test_options_of_weights_and_of_added_points():
    points = [[0, 1], [2, 3]]
    assert not checked(points).spec.steiner
    spec = CheckedPoints(
        points, 1, None, "auto", None, 0, True, {}, None, weights="only", steiner=True
    ).spec
    assert spec.weights == pb.WEIGHTING_ONLY and spec.steiner
    with pytest.raises(stellate.InvalidArgument, match="weights has to be 'auto' or 'only'"):
        stellate.reconstruct(points, 1, weights="none")


def test_tangents_are_made_orthonormal_or_refused():
    points = np.zeros((3, 3))
    tangents = np.array(
        [[[1, 0], [0, 1], [0, 0]], [[2, 1], [0, 3], [0, 0]], [[0, 0], [1, 1], [1, 2]]]
    )
    given = checked(points, 2, tangents)
    products = np.einsum("nia,nib->nab", given.tangents, given.tangents)
    assert np.allclose(products, np.eye(2), atol=1e-14)
    assert (given.tangents[0] == tangents[0]).all()  # as they are, to the last bit
    assert np.allclose(given.tangents[1][2], 0)  # the space stays
    with pytest.raises(stellate.InvalidArgument, match="row 1 of tangents does not span 2"):
        checked(
            points,
            2,
            np.where(np.arange(3)[:, None, None] == 1, [[1, 2], [1, 2], [0, 0]], tangents),
        )
    with pytest.raises(stellate.InvalidArgument, match=r"shape \(3, 2, 3\)"):
        checked(points, 2, tangents.transpose(0, 2, 1))


def test_the_specification():
    spec = checked(np.zeros((5, 3), np.float32), 2, noise=0.5, reach=2, drop=0.1).spec
    assert (spec.dimension, spec.ambient_dimension, spec.points) == (2, 3, 5)
    assert (spec.noise, spec.declared_reach, spec.drop, spec.open) == (0.5, 2, 0.1, False)
    assert not checked([[0, 1], [2, 3]]).spec.HasField("noise")


def test_what_a_file_cannot_hold_is_known_before_the_server_is(tmp_path):
    with pytest.raises(stellate.SaveError, match="stl"):
        stellate.reconstruct(np.zeros((9, 4)), 2, save=tmp_path / "a.stl", server="unix:/nowhere")


class Tree:
    """What stellate asks of gudhi.SimplexTree, where that is not installed."""

    def __init__(self):
        self.simplices = []

    def insert(self, simplex, filtration):
        self.simplices.append((simplex, filtration))


def test_a_simplex_tree(monkeypatch):
    mesh = stellate.Mesh(np.eye(3), np.array([[0, 1], [0, 2], [1, 2]]))
    monkeypatch.setitem(sys.modules, "gudhi", type("gudhi", (), {"SimplexTree": Tree}))
    assert mesh.simplex_tree().simplices == [([0, 1], 0.0), ([0, 2], 0.0), ([1, 2], 0.0)]
    monkeypatch.setitem(sys.modules, "gudhi", None)
    with pytest.raises(ImportError, match="pip install gudhi"):
        mesh.simplex_tree()


def test_the_name_of_a_file_is_no_points():
    with pytest.raises(stellate.InvalidArgument, match="'scan.ply': read it first.*in the shell"):
        stellate.reconstruct("scan.ply", 2)
    with pytest.raises(stellate.InvalidArgument, match="name of a file: read it first"):
        stellate.oracles.PointCloud(pathlib.Path("scan.xyz"), 2)
