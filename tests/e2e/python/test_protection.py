"""Protected meshes, judged by Delaunay triangulations that Qhull makes of their points."""

import itertools

import numpy as np
import pytest
import stellate
from scipy.spatial import ConvexHull, Delaunay, cKDTree
from stellate import manifolds


def stars(points, tangents, reach):
    """The simplices of the star of each point in its tangent space.

    The cell of p is { x : T (q - p) . x <= |q - p|^2 / 2 }: its polar body is the hull of 2 T (q - p) / |q - p|^2,
    whose facets are the star's simplices. points (n, d), tangents (n, k, d); `reach`: how far from a point its
    neighbours may be.
    """
    tree = cKDTree(points)
    found = {}
    for p, around in enumerate(tree.query_ball_point(points, reach)):
        ids = np.array([q for q in around if q != p])
        away = points[ids] - points[p]
        hull = ConvexHull(2 * (away @ tangents[p].T) / (away**2).sum(axis=1, keepdims=True))
        assert (hull.equations[:, -1] < 0).all()  # p is inside: the star is closed
        found[p] = {tuple(sorted(map(int, (p, *ids[one])))) for one in hull.simplices}
    return found


def agreed(found):
    """The simplices, if the stars of all vertices of each have it; else None."""
    every = set().union(*found.values())
    return every if all(one in found[v] for one in every for v in one) else None


def simplices_of(mesh):
    return {tuple(map(int, sorted(one))) for one in mesh.simplices}


def bases(oracle, points):
    """(n, k, d)"""
    return oracle.tangent_basis(points).transpose(0, 2, 1)


def shaken(oracle, mesh, length, rng):
    """The vertices moved along the manifold by `length`, each another way, and their tangent spaces."""
    tangents = bases(oracle, mesh.points)
    step = np.einsum("nk,nkd->nd", rng.normal(size=tangents.shape[:2]), tangents)
    step *= length / np.linalg.norm(step, axis=1, keepdims=True)
    moved = oracle.closest_point(mesh.points + step)
    return moved, bases(oracle, moved)


TORUS, FLAT = manifolds.Torus(1.0, 0.4), manifolds.ProductOfCircles()


@pytest.fixture(scope="module")
def torus():
    return stellate.mesh(TORUS, 0.15, reach=0.4, protection=0.1)


def test_a_torus_is_protected_with_few_more_vertices(torus):
    plain = stellate.mesh(TORUS, 0.15, reach=0.4).report
    protection = torus.report.certificate.protection
    assert torus.certified
    assert plain.certificate.protection is None
    assert protection.weak == 0
    assert protection.least >= 0.1 * 0.15 * (1 - 1e-6)
    assert protection.least <= protection.percentile <= protection.median
    assert 0 < protection.stability_radius < protection.least
    assert torus.report.counts.vertices <= 1.2 * plain.counts.vertices
    assert torus.report.counts.inserted_protection > 0
    assert "protection" in str(torus.report)


def test_its_gaps_are_those_that_the_report_gives(torus):
    asked = torus.report.certificate.protection
    tangents, tree = bases(TORUS, torus.points), cKDTree(torus.points)
    least = np.inf
    for simplex in torus.simplices:
        for p in simplex:
            edges = torus.points[[q for q in simplex if q != p]] - torus.points[p]
            flat = edges @ tangents[p].T
            x = np.linalg.solve(flat, (edges**2).sum(axis=1) / 2)
            near, ids = tree.query(torus.points[p] + x @ tangents[p], k=4)
            other = near[~np.isin(ids, simplex)][0]
            least = min(least, other - np.linalg.norm(x))
    assert least == pytest.approx(asked.least, rel=1e-6)


@pytest.mark.parametrize("share", [0.02, "stability_radius"])
def test_shaken_vertices_have_the_same_stars(torus, share):
    proved = torus.report.certificate.protection.stability_radius
    length = proved if share == "stability_radius" else share * 0.15
    want, rng = simplices_of(torus), np.random.default_rng(1)
    for _ in range(5):
        assert agreed(stars(*shaken(TORUS, torus, length, rng), 0.6)) == want


def test_an_unprotected_torus_changes(torus):
    plain = stellate.mesh(TORUS, 0.15)
    rng = np.random.default_rng(1)
    trials = (agreed(stars(*shaken(TORUS, plain, 0.02 * 0.15, rng), 0.6)) for _ in range(5))
    assert any(found != simplices_of(plain) for found in trials)


def test_a_shaken_3_sphere_changes_by_no_less_than_the_report_says():
    """The stars of points of a sphere are their hull. Moves as large as the gaps are use these up."""
    epsilon, protection = 0.4, 0.02
    mesh = stellate.mesh(manifolds.Sphere(3), epsilon, protection=protection)
    proved = mesh.report.certificate.protection.stability_radius
    assert mesh.report.certificate.protection.weak == 0
    assert 0 < proved < protection * epsilon
    want, rng = simplices_of(mesh), np.random.default_rng(1)

    def stays(length):
        moved, _ = shaken(manifolds.Sphere(3), mesh, length, rng)
        return {tuple(map(int, sorted(one))) for one in ConvexHull(moved).simplices} == want

    assert all(stays(proved) for _ in range(20))
    assert not all(stays(protection * epsilon) for _ in range(20))


def intrinsic(points):
    """The Delaunay triangulation of a flat torus, by that of its copies in the plane."""
    angles = np.arctan2(points[:, 1::2], points[:, ::2])
    copies = np.array(list(itertools.product([0, -1, 1], repeat=angles.shape[1])))
    plane = (angles + 2 * np.pi * copies[:, None]).reshape(-1, angles.shape[1])
    inside = Delaunay(plane).simplices
    inside = inside[(inside < len(points)).any(axis=1)]
    return {tuple(map(int, sorted(one % len(points)))) for one in inside}


def restricted(points, candidates):
    """Those of the candidates that have a centre on the flat torus, nearer than all other points."""
    tree, angles = cKDTree(points), np.arctan2(points[:, 1::2], points[:, ::2])
    found = set()
    for one in candidates:
        at = angles[one[0]] + np.remainder(angles[list(one)] - angles[one[0]] + np.pi, 2 * np.pi)
        c = (at - np.pi).mean(axis=0)
        for _ in range(30):  # Newton on |c - v| = |c - v0|, by 2 - 2 cos of each angle
            off = c - at + np.pi
            f = (2 - 2 * np.cos(off)).sum(axis=1)
            c = c - np.linalg.solve(2 * np.sin(off[1:]) - 2 * np.sin(off[0]), f[1:] - f[0])
        place = np.ravel(np.column_stack([np.cos(c), np.sin(c)]))
        if set(tree.query(place, k=len(one))[1]) == set(one):
            found.add(one)
    return found


def test_three_complexes_of_a_flat_torus_are_one_where_the_report_says_so():
    told = []
    for seed in range(2):
        mesh = stellate.mesh(FLAT, 0.12, reach=1.0, protection=0.1, random_seed=seed)
        told.append(mesh.report.certificate.protection.is_delaunay)
        if not told[-1]:
            continue
        want = simplices_of(mesh)
        assert agreed(stars(mesh.points, bases(FLAT, mesh.points), 0.5)) == want
        assert intrinsic(mesh.points) == want
        assert restricted(mesh.points, want) == want
    assert any(told)


def test_too_large_for_the_reach_is_not_called_intrinsic():
    certificate = stellate.mesh(FLAT, 0.4, reach=1.0, protection=0.05).report.certificate
    assert certificate.level == "PROVED"
    assert not certificate.protection.is_delaunay
    assert any("intrinsic Delaunay" in warning for warning in certificate.warnings)


def test_what_is_not_reached_is_called_so():
    mesh = stellate.mesh(manifolds.Sphere(3), 0.4, protection=0.05)
    protection = mesh.report.certificate.protection
    assert mesh.certified
    assert (protection.weak > 0) == any("was not reached" in w for w in mesh.report.warnings)


@pytest.mark.parametrize(
    ("oracle", "keywords", "words"),
    [
        (TORUS, {"protection": 0.2}, "between 0 and 0.1"),
        (TORUS, {"protection": -1.0}, "between 0 and 0.1"),
        (TORUS, {"protection": float("nan")}, "between 0 and 0.1"),
        (manifolds.Sphere(3), {"protection": 0.1}, "between 0 and 0.05"),
        (manifolds.ProductOfCircles((1.0,) * 4), {"protection": 0.01}, "dimension 3 and less"),
        (TORUS, {"protection": 0.1, "size_rate": 0.5}, "one size"),
        (TORUS, {"protection": 0.1, "max_deviation": 0.01}, "one size"),
    ],
)
def test_what_cannot_be_protected_is_refused(oracle, keywords, words):
    with pytest.raises(stellate.InvalidArgument, match=words):
        stellate.mesh(oracle, 0.3, **keywords)
