"""Points in, a certified manifold out, through the real server."""

from __future__ import annotations

import numpy as np
import pytest
import samples
import stellate
import topology
from point_streams import Talk, declared, end, same
from stellate import manifolds, oracles
from stellate._generated import stellate_pb2 as pb
from test_restart import mortal  # noqa: F401


@pytest.fixture(autouse=True)
def no_leftovers(client):
    yield
    assert list(client.list()) == []


@pytest.fixture
def torus(rng):
    return samples.torus(rng)


def test_a_torus(server, torus):
    seen = []
    mesh = stellate.reconstruct(torus, 2, server=server, on_progress=seen.append)
    assert mesh.certified, mesh.report
    topology.assert_closed_manifold(mesh, 0, [1, 2, 1])
    assert mesh.points.tobytes() == torus.tobytes()  # row by row the same
    assert set(mesh.places) <= {"OK", "TILED", "WEIGHTED"}
    told = mesh.report.reconstruction
    assert sum(told.places.values()) == len(torus)
    assert told.spacing == pytest.approx(0.14, rel=0.3)
    assert seen[-1].phase == "DONE" and seen[-1].vertices == len(torus)
    assert "reconstructed from points" in str(mesh.report)


def test_names_of_coordinates_stay(server, torus):
    pandas = pytest.importorskip("pandas")
    names = ["strain", "kelvin", "stress"]
    table = pandas.DataFrame(torus, columns=names)
    assert list(stellate.reconstruct(table, 2, server=server).to_pandas()) == names
    assert list(oracles.PointCloud(table, 2).coordinate_names) == names
    sphere = manifolds.Sphere(2)
    sphere.coordinate_names = names
    for options in ({}, {"scale": 2.0}, {"keep": "box"}):
        mesh = stellate.mesh(sphere, 0.6, server=server, **options)
        assert list(mesh.to_pandas()) == names
    sphere.coordinate_names = names[:2]
    with pytest.raises(stellate.InvalidArgument, match="coordinate_names have to be 3"):
        stellate.mesh(sphere, 0.6, server=server)


def test_a_klein_bottle_in_four_dimensions(server, rng):
    mesh = stellate.reconstruct(samples.klein_bottle(rng), 2, server=server)
    assert mesh.certified, mesh.report
    assert not mesh.report.certificate.orientable and mesh.oriented_simplices() is None
    topology.assert_closed_manifold(mesh, 0, [1, 2, 1])


def test_rotations_in_nine_dimensions(server, rng):
    mesh = stellate.reconstruct(samples.rotations(rng), 3, server=server)
    assert mesh.certified, mesh.report
    topology.assert_closed_manifold(mesh, 0, [1, 1, 1, 1])


def test_noise_moves_copies_and_no_point(server, rng):
    torus = samples.torus(rng, 0.1)
    noisy = torus + rng.normal(scale=0.02, size=torus.shape)
    mesh = stellate.reconstruct(noisy, 2, server=server)
    assert mesh.certified, mesh.report
    topology.assert_closed_manifold(mesh, 0, [1, 2, 1])
    assert mesh.points.tobytes() == noisy.tobytes()
    assert mesh.smoothed.shape == noisy.shape

    def off(points):
        around = np.hypot(points[:, 0], points[:, 1]) - 1
        return np.abs(np.hypot(around, points[:, 2]) - 0.4)

    assert np.median(off(mesh.smoothed)) < 0.6 * np.median(off(noisy))


def test_points_that_are_equal_up_to_rounding_are_merged(server):
    """A closed curve whose last point is its first, as linspace makes it, and the poles of a sphere."""
    angles = np.linspace(0, 2 * np.pi, 500)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    assert 0 < np.abs(circle[0] - circle[-1]).max() < 1e-15
    mesh = stellate.reconstruct(circle, 1, server=server)
    assert mesh.certified and mesh.places.tolist().count("MERGED") == 1
    assert mesh.places[-1] == "MERGED"
    far = stellate.reconstruct(100 * circle + [5e5, 4e6], 1, server=server)
    assert far.certified and far.places[-1] == "MERGED"
    shaken = circle + 1e-15 * np.random.default_rng(1).standard_normal(circle.shape)
    thrice = stellate.reconstruct(np.concatenate([circle, shaken, circle]), 1, server=server)
    assert thrice.certified and thrice.places.tolist().count("MERGED") == 1001


def even_sphere(n):
    i = np.arange(n) + 0.5
    z = 1 - 2 * i / n
    along, radius = np.pi * (1 + 5**0.5) * i, np.sqrt(1 - z * z)
    return np.stack([radius * np.cos(along), radius * np.sin(along), z], axis=1)


def test_a_stray_point_is_left_out_as_far_as_points_may_be(server):
    stray = np.concatenate([even_sphere(2000), [[3.0, 3.0, 3.0]]])
    mesh = stellate.reconstruct(stray, 2, server=server)
    assert mesh.certified and mesh.places.tolist().count("DROPPED") == 1
    assert mesh.places[-1] == "DROPPED" and mesh.betti() == (1, 0, 1)
    kept = stellate.reconstruct(stray, 2, drop=0, server=server)
    assert not kept.certified and kept.places[-1] == "EDGE"


def test_a_boundary_that_is_allowed_is_not_advised(server):
    sphere = even_sphere(2000)
    for closed in (True, False):
        mesh = stellate.reconstruct(sphere[sphere[:, 2] > 0], 2, closed=closed, server=server)
        assert not mesh.certified
        assert ("allow a boundary" in mesh.report.certificate.verdict) == closed


def test_equal_points_are_merged(server, torus):
    points = np.concatenate([torus, torus[:3]])
    mesh = stellate.reconstruct(points, 2, server=server)
    assert mesh.certified, mesh.report
    assert (mesh.places[-3:] == "MERGED").all()
    assert mesh.simplices.max() < len(torus)
    assert mesh.betti() == (1, 2, 1)  # a merged point is no component


@pytest.mark.parametrize(
    "wrong, places",
    [
        (lambda p: p[np.hypot(p[:, 0] - 1, p[:, 1]) > 0.7], {"EDGE"}),  # a hole
        (lambda p: p[::12], {"SPARSE", "EDGE", "DISAGREE"}),
    ],
    ids=["a hole", "too few"],
)
def test_what_is_no_sample_of_a_closed_surface_is_refused_with_the_place(
    server, torus, wrong, places
):
    mesh = stellate.reconstruct(wrong(torus), 2, server=server)
    assert not mesh.certified
    told = mesh.report.reconstruction
    assert places & set(told.places), told
    assert all(told.advice[place] for place in places & set(told.places))
    with pytest.raises(stellate.NotCertified) as refused:
        stellate.reconstruct(wrong(torus), 2, server=server, require_certified=True)
    assert refused.value.mesh.simplices.tobytes() == mesh.simplices.tobytes()


def test_a_part_of_a_torus_with_its_boundary(server, torus):
    half = torus[torus[:, 0] > 0]
    mesh = stellate.reconstruct(half, 2, closed=False, server=server)
    assert len(topology.rim(mesh.simplices)) > 10


def test_weights_alone(server, torus):
    mesh = stellate.reconstruct(torus, 2, weights="only", server=server)
    assert mesh.certified, mesh.report
    assert set(mesh.places) == {"OK", "WEIGHTED"}
    assert mesh.report.reconstruction.tiles == 0
    assert mesh.report.certificate.betti == mesh.betti() == (1, 2, 1)
    coarse = stellate.reconstruct(samples.random_torus(300), 2, weights="only", server=server)
    assert not coarse.certified and "No weights were found" in coarse.report.certificate.verdict


def test_points_are_added_where_nothing_else_helps(server, mortal, tmp_path):  # noqa: F811
    points = samples.random_torus(300)
    plain = stellate.reconstruct(points, 2, drop=0, server=server)
    assert plain.report.reconstruction.unfilled_vertices > 0
    mesh = stellate.reconstruct(points, 2, drop=0, steiner=True, server=server)
    n = len(points)
    assert len(mesh.points) > n and len(mesh.places) == len(mesh.points)
    assert mesh.points[:n].tobytes() == points.tobytes()
    assert set(mesh.places[n:]) == {"ADDED"} and "ADDED" not in mesh.places[:n]
    assert mesh.report.counts.vertices == len(mesh.points)
    assert mesh.report.reconstruction.places["ADDED"] == len(mesh.points) - n
    topology.assert_closed_manifold(mesh, 0, [1, 2, 1])
    assert any("none of the points" in warning for warning in mesh.report.warnings)
    checked = declared(points, drop=0, steiner=True)
    with stellate.Client(mortal.address) as client:
        info = client.declare_points(checked)
        client.upload(info.name, checked).run()
        stellate.download(info.name, server=client, unfinished="wait")
        mortal.kill()
        mortal.start()
        again = stellate.download(info.name, server=client, unfinished="wait")
        # A client that lost the reply has sent the points alone.
        talk = Talk(client)
        assert talk.say(pb.PointsChunk(mesh=info.name), end(points)).rows == n
        client.delete(info.name)
    same(mesh, again)


def test_lists_and_single_precision_are_taken(server, torus):
    single = torus.astype(np.float32)
    same(
        stellate.reconstruct(single, 2, server=server),
        stellate.reconstruct(single.astype(float).tolist(), 2, server=server),
    )


def test_tangents_are_used(server, torus):
    """Those of a torus, not orthonormal."""
    x, y, z = torus.T
    wide = np.hypot(x, y)
    along = np.stack([-y, x, 0 * x], axis=1)
    across = np.stack([-z * x / wide, -z * y / wide, wide - 1], axis=1)
    tangents = np.stack([along, across + 0.3 * along], axis=2)
    mesh = stellate.reconstruct(torus, 2, tangents=tangents, noise=0, server=server)
    assert mesh.certified, mesh.report
    topology.assert_closed_manifold(mesh, 0, [1, 2, 1])


def test_an_exception_in_on_progress_cancels(server, torus):
    class Enough(Exception):
        pass

    def stop(progress):
        raise Enough

    with pytest.raises(Enough):
        stellate.reconstruct(torus, 2, server=server, on_progress=stop)


def test_an_estimator(torus, server):
    surface = stellate.learning.Reconstructor(noise=0, server=server)
    with pytest.raises(stellate.FailedPrecondition, match="fit"):
        surface.locate(torus)
    assert surface.fit(torus) is surface
    assert surface.mesh_.certified and surface.n_features_in_ == 3
    assert surface.places_.tolist() == surface.mesh_.places.tolist()
    # Off the mesh by a little: linear functions are interpolated to what they are below.
    off = torus[:50] + 1e-3
    found = surface.locate(off)
    assert found.distances.max() <= 1e-3 * np.sqrt(3) + 1e-12
    both = surface.interpolate(torus, off)
    assert both.shape == (50, 3) and np.abs(both - found.points).max() < 1e-12
    assert surface.interpolate(torus[:, 2], off) == pytest.approx(found.points[:, 2])
    with pytest.raises(stellate.InvalidArgument, match="3000 points|values have the shape"):
        surface.interpolate(torus[:7, 2], off)


def test_an_estimator_whose_mesh_has_vertices_that_were_added(server):
    points = samples.random_torus(300)
    surface = stellate.learning.Reconstructor(drop=0, steiner=True, server=server).fit(points)
    added = len(surface.mesh_.points) - len(points)
    assert added > 0 and len(surface.places_) == len(points)
    assert "ADDED" not in surface.places_
    # Harmonic values are between those around.
    heights = surface.interpolate(points[:, 2], surface.mesh_.points[-added:])
    assert np.abs(heights - surface.mesh_.points[-added:, 2]).max() < 0.2
    both = surface.interpolate(points[:, 1:], points)
    used = np.isin(np.arange(len(points)), surface.mesh_.simplices)
    assert both.shape == (300, 2) and np.abs(both - points[:, 1:])[used].max() < 1e-12


def test_an_estimator_by_weights_alone(torus, server):
    surface = stellate.learning.Reconstructor(noise=0, weights="only", server=server).fit(torus)
    assert set(surface.places_) <= {"OK", "WEIGHTED"} and surface.mesh_.certified


def test_an_estimator_is_cloned_by_its_parameters():
    one = stellate.learning.Reconstructor(3, drop=0.01, reach=0.4)
    other = stellate.learning.Reconstructor(**one.get_params()).set_params(drop=0.02)
    assert other.get_params() == {**one.get_params(), "drop": 0.02}
    assert "drop=0.02" in repr(other)
    with pytest.raises(stellate.InvalidArgument, match="'epsilon'"):
        other.set_params(epsilon=0.1)


# A raster's squares have their four corners on one circle, but for its noise.
@pytest.mark.parametrize("noise", [0.0, 1e-4, 0.01, 0.03])
@pytest.mark.parametrize("height", [0.0, 3.0])
def test_a_raster_of_heights_is_one_disc(noise, height, server, rng):
    x, y = (c.ravel().astype(float) for c in np.meshgrid(np.arange(40), np.arange(30)))
    z = height * np.sin(x / 9) * np.cos(y / 11) + noise * rng.standard_normal(len(x))
    mesh = stellate.reconstruct(np.column_stack([x, y, z]), 2, closed=False, server=server)
    assert len(mesh.simplices) == 2 * 39 * 29, mesh.report
    assert topology.euler_characteristic(mesh.simplices) == 1
    assert topology.component_count(mesh.simplices) == 1
