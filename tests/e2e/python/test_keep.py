"""Parts of zero sets: what lies in the box, and the components that seeds lie on."""

import numpy as np
import pytest
import stellate
from shapes import equation
from stellate import oracles

SIDE = 1.4  # half of the box of `equation`


def two_spheres(gap):
    """Unit spheres about the origin and beside it, outside of the box from a gap of 0.4 on."""
    far = np.array([2 + gap, 0, 0])
    return equation(lambda x: ((x * x).sum(axis=1) - 1) * (((x - far) ** 2).sum(axis=1) - 1))


def oval_and_branch():
    """y^2 = x^3 - x: an oval between -1 and 0, and a branch without end from 1 on."""
    return stellate.ImplicitManifold(
        lambda x: x[:, 1] ** 2 - x[:, 0] ** 3 + x[:, 0],
        ambient_dimension=2,
        dimension=1,
        bounding_box=([-1.5, -1.5], [0.5, 1.5]),
    )


def shape(mesh):
    certificate = mesh.report.certificate
    assert mesh.certified, certificate.verdict
    return certificate.components, certificate.euler_characteristic


def test_without_keep_other_components_are_meshed_or_run_after(server):
    assert shape(stellate.mesh(two_spheres(1), 0.3, server=server)) == (2, 4)
    mesh = stellate.mesh(oval_and_branch(), 0.1, server=server)
    verdict = mesh.report.certificate.verdict
    assert not mesh.certified and "leaves the bounding box and goes on" in verdict
    assert 'keep="box"' in verdict and 'keep="seeds"' in verdict


@pytest.mark.parametrize("keep, seeds", [("box", None), ("seeds", [[-1.0, 0, 0]])])
def test_a_sphere_of_two_is_kept(server, keep, seeds):
    mesh = stellate.mesh(two_spheres(1), 0.3, server=server, keep=keep, seeds=seeds)
    assert shape(mesh) == (1, 2)
    np.testing.assert_allclose(np.linalg.norm(mesh.points, axis=1), 1, atol=1e-9)
    assert not mesh.report.certificate.warnings


@pytest.mark.parametrize("keep, seeds", [("box", None), ("seeds", [[-1.0, 0]])])
def test_an_oval_is_kept_from_a_branch_without_end(server, keep, seeds):
    mesh = stellate.mesh(oval_and_branch(), 0.1, server=server, keep=keep, seeds=seeds)
    assert shape(mesh) == (1, 0)
    assert mesh.points[:, 0].max() <= 1e-9


def test_the_box_cuts_what_leaves_it(server):
    graph = equation(lambda x: x[:, 2] - x[:, 0] ** 3 + x[:, 0])  # goes on without end
    mesh = stellate.mesh(graph, 0.15, server=server, keep="box")
    assert shape(mesh) == (1, 1)
    assert np.abs(mesh.points).max() <= SIDE + 1e-9
    ends = np.concatenate([np.unique(face.simplices) for face in mesh.boundary])
    np.testing.assert_allclose(np.abs(mesh.points[ends]).max(axis=1), SIDE, atol=1e-9)


def test_seeds_choose_either_of_two_sheets_that_are_near(server):
    gap = 0.1
    shells = equation(
        lambda x: (np.linalg.norm(x, axis=1) - 1) * (np.linalg.norm(x, axis=1) - 1 - gap)
    )
    for radius in (1, 1 + gap):
        mesh = stellate.mesh(
            shells, 0.2, server=server, keep="seeds", seeds=[[0, 0, radius]], audit="thorough"
        )
        assert shape(mesh) == (1, 2)
        np.testing.assert_allclose(np.linalg.norm(mesh.points, axis=1), radius, atol=1e-9)


def test_seeds_on_each_keep_both(server):
    seeds = [[-1.0, 0, 0], [4, 0, 0]]
    mesh = stellate.mesh(two_spheres(1), 0.3, server=server, keep="seeds", seeds=seeds)
    assert shape(mesh) == (2, 4)


def test_epsilon_is_chosen_by_what_is_kept(server):
    far = np.array([1.3, 0, 0])  # where a sphere is that would take a far smaller epsilon
    both = equation(lambda x: ((x * x).sum(axis=1) - 1) * (((x - far) ** 2).sum(axis=1) - 0.01))
    mesh = stellate.mesh(both, "auto", server=server, keep="seeds", seeds=[[-1.0, 0, 0]])
    assert shape(mesh) == (1, 2)
    assert mesh.report.epsilon > 0.2


def test_what_is_kept_grows_and_is_clipped(server):
    part = oracles.kept(two_spheres(1), "seeds", [[-1.0, 0, 0]])
    half = oracles.Clipped(part, [oracles.HalfSpace([0, 0, 1])])
    *_, last = stellate.watch(half, 0.3, server=server)
    assert shape(last) == (1, 1)
    *_, last = stellate.watch(two_spheres(1), 0.3, server=server, keep="box")
    assert shape(last) == (1, 2)
