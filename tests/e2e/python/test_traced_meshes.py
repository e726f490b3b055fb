"""Formulas of the distance-function world, meshed with their edges by the real server."""

import distance_formulas
import numpy as np
import pytest
import stellate
import test_traced as formulas
from stellate import solids as s
from topology import euler_characteristic

BOX = formulas.BOX


def volume(mesh):
    corners = mesh.points[mesh.simplices]
    return np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])).sum() / 6


def share(f):
    """Of the box, by points that are thrown into it."""
    x = np.random.default_rng(4).random((400_000, 3)) * 2.6 - 1.3
    return (np.reshape(f(x), -1) < 0).mean() * 2.6**3


def block_and_ball(p):
    """A plate with a ball on it, as users of signed distances begin: a crease is its seam."""
    block = distance_formulas.box(p, [1.0, 1.0, 0.3])
    return np.minimum(block, distance_formulas.ball(p, 0.6, (0, 0, 0.6)))


CASES = [
    (block_and_ball, 0.12, 4, 1),
    (distance_formulas.tray, 0.2, 6, 1),
    (distance_formulas.pyramid, 0.2, 5, 1),
    (distance_formulas.chamfered_union, 0.12, 7, 1),
    (formulas.box([0.8, 0.6, 0.5]), 0.2, 3, 1),
    (formulas.capped_cylinder, 0.2, 2, 1),
    (formulas.drilled, 0.1, 7, -4),
    (formulas.octahedron, 0.25, 8, 1),
    (formulas.cut_shell, 0.08, 2, None),
    (formulas.gyroid_sheet, 0.08, 2, None),
    (formulas.round_box, 0.07, 1, 1),
]


@pytest.mark.parametrize("f, epsilon, walls, chi", CASES, ids=formulas.named)
def test_a_traced_function_is_certified_with_its_edges(server, f, epsilon, walls, chi):
    solid = s.traced(f, BOX)
    mesh = stellate.mesh(solid, epsilon, server=server)
    assert mesh.certified, mesh.report
    assert solid.walls == walls
    found = euler_characteristic(mesh.simplices)
    assert found == mesh.report.certificate.euler_characteristic
    assert chi is None or found == chi
    assert volume(mesh) == pytest.approx(share(f), rel=0.04)
    # Vertices of the boundary lie where f is zero, and all others inside.
    skin = np.unique(np.concatenate([face.simplices for face in mesh.boundary]))
    inner = np.setdiff1d(np.arange(len(mesh.points)), skin)
    with np.errstate(all="ignore"):
        assert np.abs(np.reshape(f(mesh.points[skin]), -1)).max() < 1e-8
        assert (np.reshape(f(mesh.points[inner]), -1) < 0).all()
        middles = mesh.points[mesh.simplices].mean(axis=1)
        assert (np.reshape(f(middles), -1) < 10 * epsilon**2).all()
