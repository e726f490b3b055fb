"""The ready oracles through the real server: closed manifolds of the right topology, certified."""

import numpy as np
import pytest
import stellate
from ready_shapes import ALL
from stellate import oracles

# name: epsilon, Euler characteristic. One of each kind; test_languages_agree.py meshes those that C++ has,
# too, with charts, level sets, constraints, linkages, clouds and triangles. Laws of all: test_oracles.py.
MESHED = {
    "parametrized": (0.2, 0),
    "transformed": (0.4, 0),
    "signed_distance": (0.15, 0),
    "network": (0.2, 0),
    "projective_plane": (0.3, 1),
}


@pytest.mark.parametrize("name", MESHED)
def test_is_meshed(server, name):
    epsilon, euler = MESHED[name]
    mesh = stellate.mesh(ALL[name][0](), epsilon=epsilon, server=server)
    assert mesh.certified, mesh.report
    assert mesh.report.certificate.euler_characteristic == euler
    assert mesh.report.certificate.orientable is (name != "projective_plane")


# Those that C++ has, too, are examined there (ready_oracles_test.cc), where it takes less.
@pytest.mark.parametrize("name", ["parametrized", "network", "projective_plane"])
def test_the_doctor_finds_no_fault(name):
    report = stellate.check(ALL[name][0]())
    assert report.ok, report


def test_a_product_of_circles_is_a_torus(server):
    circle = stellate.manifolds.Sphere(1)
    mesh = stellate.mesh(oracles.Product(circle, circle), epsilon=0.3, server=server)
    assert mesh.certified
    assert mesh.report.certificate.euler_characteristic == 0
    assert np.abs(np.hypot(mesh.points[:, 0], mesh.points[:, 1]) - 1).max() < 1e-12


def test_a_mesh_is_meshed_anew(server, tmp_path):
    torus = stellate.manifolds.Torus()
    fine = stellate.mesh(torus, epsilon=0.05, server=server)
    coarse = stellate.mesh(oracles.TriangleMesh(fine), epsilon=0.15, server=server)
    assert coarse.certified
    assert len(coarse.points) < len(fine.points) / 4
    assert np.linalg.norm(coarse.points - torus.closest_point(coarse.points), axis=1).max() < 0.001


def test_a_four_bar_linkage(server):
    linkage = oracles.Linkage(
        [("a", "p", 1.0), ("p", "q", 1.3), ("q", "b", 1.1)], {"a": (0, 0), "b": (1.5, 0)}
    )
    mesh = stellate.mesh(linkage, epsilon=0.1, components=1, server=server)
    at = linkage.joints(mesh.points)
    assert np.abs(np.linalg.norm(at["p"], axis=1) - 1).max() < 1e-9
    assert mesh.certified, mesh.report
