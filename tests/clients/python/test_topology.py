"""Betti numbers and turning, of complexes known beforehand."""

import numpy as np
import pytest
import shapes
import stellate
from stellate import _betti

KNOWN = [
    (shapes.torus(), 2, (1, 2, 1)),
    (shapes.torus(), 3, (1, 2, 1)),
    (shapes.projective_plane(), 2, (1, 1, 1)),
    (shapes.projective_plane(), 3, (1, 0, 0)),
    (shapes.polygon(7), 2, (1, 1)),
    (shapes.simplex_boundary(4), 2, (1, 0, 0, 0, 1)),
]


@pytest.mark.parametrize("mesh, modulus, known", KNOWN)
def test_betti_numbers_with_and_without_gudhi(mesh, modulus, known, monkeypatch):
    assert _betti.reduced(mesh.simplices, modulus) == known

    def missing(mesh):
        raise ImportError("no gudhi")

    pytest.importorskip("gudhi")
    assert mesh.betti(modulus) == known
    monkeypatch.setattr(_betti, "to_simplex_tree", missing)
    assert mesh.betti(modulus) == known


def test_betti_numbers_of_parts_and_of_nothing():
    torus = shapes.torus()
    two = stellate.Mesh(
        np.vstack([torus.points, torus.points + 5]),
        np.vstack([torus.simplices, torus.simplices + len(torus.points)]),
    )
    assert two.betti() == _betti.reduced(two.simplices, 2) == (2, 4, 2)
    assert stellate.Mesh(torus.points, torus.simplices[:0]).betti() == (0, 0, 0)
    assert stellate.Mesh(torus.points, torus.simplices[:1]).betti() == (1, 0, 0)


@pytest.mark.parametrize("modulus", [0, 1, 4, -3])
def test_a_field_has_a_prime_number_of_elements(modulus):
    with pytest.raises(stellate.InvalidArgument, match="prime"):
        shapes.torus().betti(modulus)


def test_what_is_too_large_is_refused_with_the_cure(monkeypatch):
    monkeypatch.setattr(_betti, "_MOST", 100)
    with pytest.raises(stellate.InvalidArgument, match="python3-gudhi"):
        _betti.reduced(shapes.torus().simplices, 2)


def test_minkowski_functionals_of_polyhedra():
    # A regular tetrahedron of edge s turns by pi - acos(1/3) at each of its six edges.
    points = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]])
    solid = stellate.Mesh(points, np.array([[0, 1, 2, 3]]))
    side = 8**0.5
    for mesh in (solid, solid.boundary_mesh()):
        found = mesh.minkowski()
        assert found.volume == pytest.approx(side**3 / (6 * 2**0.5))
        assert found.area == pytest.approx(3**0.5 * side**2)
        assert found.mean_curvature == pytest.approx(3 * side * (np.pi - np.arccos(1 / 3)))
        assert found.euler == 1
    moved = stellate.Mesh(points + 1e4, solid.simplices).minkowski()
    assert moved.volume == pytest.approx(side**3 / (6 * 2**0.5))


def test_minkowski_functionals_of_what_has_no_inside():
    torus = shapes.torus()
    with pytest.raises(stellate.InvalidArgument, match="boundary"):
        stellate.Mesh(torus.points, torus.simplices[1:]).minkowski()
    with pytest.raises(stellate.InvalidArgument, match="R\\^5"):
        shapes.projective_plane().minkowski()
    # Two tetrahedra that have an edge alone in common: four triangles meet along it.
    points = np.array(
        [[0, 0, 1], [0, 0, -1], [1, 0.2, 0], [1, -0.2, 0], [-1, 0.2, 0], [-1, -0.2, 0]]
    )
    touching = stellate.Mesh(points, np.array([[0, 1, 2, 3], [0, 1, 4, 5]]))
    with pytest.raises(stellate.InvalidArgument):
        touching.minkowski()
