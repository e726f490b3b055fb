"""Boundaries without their inside through the real server: closed, outwards, and written as they are."""

import math

import meshio
import numpy as np
import pytest
import stellate
from stellate import manifolds, oracles
from stellate import solids as s
from topology import component_count, euler_characteristic, is_closed, rim


def enclosed(points, oriented):
    """By the divergence theorem: above zero, where normals point outwards."""
    return np.linalg.det(points[oriented]).sum() / math.factorial(points.shape[1])


def hold(mesh, chi, size, slack=0.08):
    """Certified, closed, turned outwards, and of that volume, except for chords of what is round."""
    assert mesh.certified, mesh.report
    assert mesh.is_boundary and is_closed(mesh.simplices)
    assert euler_characteristic(mesh.simplices) == chi
    assert mesh.report.certificate.euler_characteristic == chi
    oriented = mesh.oriented_simplices()
    # Neighbours run along what they share in opposite directions.
    assert mesh.dimension != 2 or len(
        np.unique(np.concatenate([oriented[:, [i, (i + 1) % 3]] for i in range(3)]), axis=0)
    ) == 3 * len(oriented)
    within = enclosed(mesh.points, oriented)
    assert size * (1 - slack) < within < size * (1 + slack)
    assert mesh.report.certificate.volume == pytest.approx(within)


BALL = 4 / 3 * np.pi


@pytest.mark.parametrize(
    "solid, epsilon, chi, size",
    [
        (s.Ball(), 0.25, 2, BALL),
        (s.Box([-1] * 3, [1] * 3).rotated(s.rotation([1, 2, 3], 0.7)), 0.5, 2, 8.0),
        (s.Box([-1] * 3, [1] * 3) - s.Ball(0.6), 0.2, 4, 8 - BALL * 0.216),
        (s.Ball() | s.Ball(at=(1, 0, 0)), 0.2, 2, 2 * BALL - 5 / 12 * np.pi),
        (s.Torus(1, 0.4), 0.15, 0, 2 * np.pi**2 * 0.16),
    ],
    ids=["ball", "turned cube", "cube with a void", "union", "torus"],
)
def test_surfaces_of_solids(server, solid, epsilon, chi, size):
    mesh = stellate.mesh(solid, epsilon, boundary_only=True, server=server)
    assert (mesh.dimension, mesh.ambient_dimension) == (2, 3)
    hold(mesh, chi, size)
    assert {face.walls for face in mesh.boundary} == {(i,) for i in range(solid.walls)}


def test_creases_are_kept(server):
    mesh = stellate.mesh(s.Box([-1] * 3, [1] * 3), 0.5, boundary_only=True, server=server)
    assert len(mesh.edges) == 12 and len(mesh.corners) == 8
    for edge in mesh.edges:
        ends = mesh.points[edge.simplices]
        assert np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum() == pytest.approx(2)
    found = {face.walls: face for face in mesh.report.certificate.faces}
    for wall in range(6):
        assert found[(wall,)].volume == pytest.approx(4) and found[(wall,)].betti == (1, 0, 0)


def two_materials():
    """A ball of radius 1/2 in one of radius 1."""
    walls = [lambda x, r=r: r**2 - (x**2).sum(axis=1) for r in (1.0, 0.5)]
    return oracles.Solid(walls, ([-1.2] * 3, [1.2] * 3), labels=[0, 1, 0, 2])


def test_materials_have_surfaces_of_their_own(server):
    mesh = stellate.mesh(two_materials(), 0.15, boundary_only=True, server=server)
    assert mesh.certified, mesh.report
    assert mesh.labels.shape == (len(mesh.simplices), 2)
    regions = {region.label: region for region in mesh.report.certificate.regions}
    for label, pieces, size in ((1, 2, BALL * 7 / 8), (2, 1, BALL / 8)):
        surface = mesh.region(label)
        assert is_closed(surface.simplices) and component_count(surface.simplices) == pieces
        within = enclosed(surface.points, surface.oriented_simplices())
        assert size * 0.9 < within < size * 1.02
        assert regions[label].volume == pytest.approx(within)
        assert regions[label].betti == (pieces, 0, pieces)
    with pytest.raises(ValueError, match="no region 3"):
        mesh.region(3)


def test_outlines_of_plane_figures(server):
    box = ([-1.3] * 2, [1.3] * 2)
    mesh = stellate.mesh(
        oracles.Solid([], box, ball=([0, 0], 1)), 0.1, boundary_only=True, server=server
    )
    hold(mesh, 0, np.pi)
    square = oracles.Solid([], box, box=([-1, -1], [1, 1]))
    mesh = stellate.mesh(square, 0.3, boundary_only=True, server=server)
    hold(mesh, 0, 4, 1e-9)
    assert len(mesh.corners) == 4


def test_a_ball_of_four_dimensions(server):
    solid = oracles.Solid([], ([-1.3] * 4, [1.3] * 4), ball=([0] * 4, 1))
    mesh = stellate.mesh(solid, 0.5, boundary_only=True, server=server)
    hold(mesh, 0, np.pi**2 / 2, 0.3)


@pytest.mark.parametrize("ending", [".stl", ".ply", ".obj", ".off"])
def test_files_hold_the_boundary(server, tmp_path, ending):
    solid = s.Box([-1] * 3, [1] * 3) - s.Ball(0.6)
    path = tmp_path / f"part{ending}"
    mesh = stellate.mesh(solid, 0.25, boundary_only=True, server=server, save=path)
    assert mesh.certified, mesh.report
    read = meshio.read(path)
    triangles = read.get_cells_type("triangle")
    points, inverse = np.unique(read.points.round(5), axis=0, return_inverse=True)
    cells = inverse.ravel()[triangles]
    assert len(cells) == len(mesh.simplices) and is_closed(np.sort(cells, axis=1))
    within = enclosed(points, cells)
    assert within == pytest.approx(mesh.report.certificate.volume, rel=1e-4)


def test_watched_and_fetched(server, client):
    """The mesh grows, and a download has the same."""
    ball = oracles.Solid([], ([-1.3] * 3, [1.3] * 3), ball=([0] * 3, 1))
    sizes = []
    for mesh in stellate.watch(ball, 0.35, boundary_only=True, server=server):
        sizes.append(len(mesh.simplices))
        if mesh.labels is not None and mesh.report is None:
            assert mesh.labels.shape == (len(mesh.simplices), 2)
    assert len(set(sizes)) > 3
    # One that stays on the server.
    info = client.create(ball, 0.35, boundary_only=True)
    assert info.dimension == 2
    stellate.serve(ball, info.name, server=server)
    fetched = stellate.download(info.name, server=server)
    assert np.array_equal(fetched.simplices, mesh.simplices)
    assert np.array_equal(fetched.labels, mesh.labels)
    assert np.array_equal(fetched.oriented_simplices(), mesh.oriented_simplices())


def test_what_has_no_boundary_is_refused(server):
    with pytest.raises(stellate.InvalidArgument, match="has no boundary"):
        stellate.mesh(manifolds.Sphere(2), 0.3, boundary_only=True, server=server)
    hemisphere = oracles.Clipped(manifolds.Sphere(2), [oracles.HalfSpace([0, 0, 1])])
    mesh = stellate.mesh(hemisphere, 0.3, boundary_only=True, server=server)
    assert mesh.certified and mesh.dimension == 1
    assert is_closed(mesh.simplices) and len(rim(mesh.simplices)) == 0
