"""A declared reach through the real server: proved, refuted, refused."""

import pytest
import stellate
from stellate import manifolds


def test_a_true_reach_proves_the_mesh():
    mesh = stellate.mesh(manifolds.Torus(1.0, 0.4), 0.1, reach=0.4)
    certificate = mesh.report.certificate
    assert certificate.level == "PROVED"
    assert certificate.declared_reach == 0.4
    assert certificate.max_barycentre_distance <= certificate.proved_distance < 0.02
    assert "as declared" in certificate.verdict
    assert "PROVED" in str(mesh.report)
    assert mesh.report.to_dict()["certificate"]["level"] == "PROVED"


def test_a_reach_that_is_too_large_is_refuted():
    mesh = stellate.mesh(manifolds.Torus(1.0, 0.4), 0.1, reach=0.9)
    certificate = mesh.report.certificate
    assert certificate.level == "REFUSED"
    assert certificate.reach_refuted
    assert not mesh.certified
    assert "refuted" in str(mesh.report)


def test_without_a_reach_a_mesh_is_sampled():
    certificate = stellate.mesh(manifolds.Torus(1.0, 0.4), 0.2).report.certificate
    assert certificate.level == "SAMPLED"
    assert certificate.declared_reach == 0


class SphereInABox:
    dimension, ambient_dimension = 2, 3
    bounding_box = [-1.2] * 3, [1.2] * 3

    def closest_point(self, x):
        return x / (abs(x) ** 2).sum(axis=1, keepdims=True) ** 0.5


def test_a_covered_box_leaves_no_component_out():
    certificate = stellate.mesh(SphereInABox(), 0.3, reach=1.0, cover_box=True).report.certificate
    assert certificate.level == "PROVED"
    assert "all components" in certificate.verdict


@pytest.mark.parametrize(
    ("keywords", "words"),
    [({"reach": -1.0}, "declared_reach"), ({"cover_box": True}, "cover_box")],
)
def test_what_makes_no_sense_is_refused(keywords, words):
    with pytest.raises(stellate.InvalidArgument, match=words):
        stellate.mesh(SphereInABox(), 0.3, **keywords)


def test_a_box_that_takes_too_many_seeds_is_refused_with_their_number():
    with pytest.raises(stellate.LimitExceeded, match="cover_box has to place"):
        stellate.mesh(SphereInABox(), 0.3, reach=1e-3, cover_box=True)
