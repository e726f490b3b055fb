"""Manifolds with boundary, clipped in Python; what the server makes of each kind: ../walls_test.cc."""

import numpy as np
import pytest
import stellate
from stellate import manifolds, oracles
from topology import euler_characteristic, rim


def hold(mesh, chi, walls):
    assert mesh.certified, mesh.report
    assert (
        euler_characteristic(mesh.simplices) == chi == mesh.report.certificate.euler_characteristic
    )
    boundary = np.concatenate([face.simplices for face in mesh.boundary])
    assert {face.walls for face in mesh.boundary} == walls
    assert sorted(map(tuple, boundary)) == sorted(map(tuple, rim(mesh.simplices)))


def test_an_octant_has_corners(server):
    oracle = oracles.Clipped(manifolds.Sphere(2), box=([0, 0, 0], [np.inf] * 3))
    mesh = stellate.mesh(oracle, 0.25, server=server)
    hold(mesh, 1, {(0,), (1,), (2,)})
    assert {face.walls for face in mesh.corners} == {(0, 1), (0, 2), (1, 2)}
    (corner,) = mesh.corners[0].simplices[:, 0]
    assert np.allclose(mesh.points[corner], [0, 0, 1])


def test_a_wall_that_cuts_nothing_is_allowed(server):
    mesh = stellate.mesh(
        oracles.Clipped(manifolds.Sphere(2), [lambda x: x[:, 2] + 5]), 0.3, server=server
    )
    assert mesh.certified and mesh.boundary == ()
    assert "no wall cuts it" in mesh.report.certificate.verdict


class Turned(oracles.Clipped):
    """The conormals of a lying client: scaled, and across the manifold."""

    def __init__(self, length, across):
        super().__init__(manifolds.Sphere(2), [lambda x: x[:, 2] + 0.1])
        self.length, self.across = length, across

    def conormals(self, points, face):
        honest = super().conormals(points, face)
        normals = points / np.linalg.norm(points, axis=1)[:, None]
        return self.length * (honest + self.across * normals[:, None, :])


@pytest.mark.parametrize(
    ("oracle", "words"),
    [
        (Turned(2.0, 0.0), "unit vector"),
        (Turned(0.5**0.5, 1.0), "not tangent"),
        (
            oracles.Clipped(
                manifolds.Sphere(2),
                [lambda x: x[:, 2] + 0.1, lambda x: x[:, 2] + 0.1 + 0.05 * x[:, 0]],
            ),
            "nearly tangentially",
        ),
        (
            oracles.Clipped(manifolds.Sphere(2), [lambda x: x[:, 2] - 5]),
            "leave nothing of the manifold",
        ),
    ],
)
def test_bad_walls_are_refused(server, oracle, words):
    with pytest.raises(stellate.OracleError, match=words):
        stellate.mesh(oracle, 0.3, server=server)


def test_inverted_walls_are_never_certified_as_what_was_meant(server):
    """A wall the other way round is another manifold: the cap instead of the rest."""
    cap = oracles.Clipped(manifolds.Sphere(2), [lambda x: -(x[:, 2] + 0.5)])
    mesh = stellate.mesh(cap, 0.2, server=server)
    hold(mesh, 1, {(0,)})
    assert mesh.points[:, 2].max() < -0.5 + 1e-9


def test_bad_declarations_are_refused():
    with pytest.raises(stellate.InvalidArgument, match="tangent_basis"):
        oracles.Clipped(
            type(
                "O", (), {"dimension": 1, "ambient_dimension": 2, "closest_point": lambda s, x: x}
            )(),
            [lambda x: x[:, 0]],
        )
    with pytest.raises(stellate.InvalidArgument, match="0 walls"):
        oracles.Clipped(manifolds.Sphere(2))
    with pytest.raises(stellate.InvalidArgument, match="two corners"):
        oracles.Clipped(manifolds.Sphere(2), box=([1, 1, 1], [0, 2, 2]))


def test_it_survives_a_checkpoint(server, tmp_path):
    oracle = oracles.Clipped(manifolds.Torus(), [lambda x: x[:, 0]])
    mesh = stellate.mesh(oracle, 0.2, server=server)
    again = stellate.mesh(oracle, 0.2, checkpoint=tmp_path / "kept")
    once_more = stellate.mesh(oracle, 0.2, checkpoint=tmp_path / "kept")
    for other in (again, once_more):
        assert np.array_equal(mesh.points, other.points)
        assert np.array_equal(mesh.simplices, other.simplices)
        assert np.array_equal(mesh.walls, other.walls)
