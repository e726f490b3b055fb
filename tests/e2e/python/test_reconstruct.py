"""Points in, a certified manifold out, through the real server."""

from __future__ import annotations

import contextlib
import hashlib
import threading
import time

import grpc
import numpy as np
import pytest
import samples
import stellate
import topology
from stellate import manifolds, oracles
from stellate._generated import stellate_pb2 as pb
from stellate._points import CheckedPoints
from stellate._wire.arrays import to_wire
from test_restart import mortal  # noqa: F401


@pytest.fixture(autouse=True)
def no_leftovers(client):
    yield
    assert list(client.list()) == []


@pytest.fixture
def torus(rng):
    return samples.torus(rng)


def same(a, b):
    assert a.points.tobytes() == b.points.tobytes()
    assert a.simplices.tobytes() == b.simplices.tobytes()
    assert a.places.tolist() == b.places.tolist()


def declared(points, dimension=2, **options):
    given = dict(tangents=None, noise="auto", reach=None, drop=0.001, closed=True, limits={})
    return CheckedPoints(points, dimension, label=None, **{**given, **options})


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


def upload(client, checked, rows):
    info = client.declare_points(checked)
    try:
        client.upload(info.name, checked, rows).run()
        return stellate.download(info.name, server=client, unfinished="wait")
    finally:
        client.delete(info.name)


@pytest.mark.parametrize("rows", [1, 7, 1000, 10**6])
def test_chunks_of_any_size_make_the_same_mesh(client, server, torus, rows):
    same(upload(client, declared(torus), rows), stellate.reconstruct(torus, 2, server=server))


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


def circle(count):
    """In R^40, so that it is of several megabytes."""
    turn = 2 * np.pi * np.arange(count) / count
    points = np.zeros((count, 40))
    points[:, 7], points[:, 31] = np.cos(turn), np.sin(turn)
    return points


def test_a_server_that_is_killed_in_the_upload_is_gone_on_with(mortal, server):  # noqa: F811
    points = circle(20_000)
    checked = declared(points, 1, limits={"worker_wait_seconds": 600})
    with stellate.Client(mortal.address) as client:
        info = client.declare_points(checked)
        sending = client.upload(info.name, checked, 100)
        thread = threading.Thread(target=sending.run, daemon=True)
        thread.start()
        while (recorded := client.get(info.name).progress.vertices) == 0:
            time.sleep(0.01)
        mortal.kill()
        mortal.start()
        thread.join()  # it has gone on by itself
        mesh = stellate.download(info.name, server=client, unfinished="wait")
        client.delete(info.name)
    assert 0 < recorded < len(points)
    same(mesh, stellate.reconstruct(points, 1, server=server))


def test_what_was_recorded_need_not_be_sent_again(mortal):  # noqa: F811
    points = circle(20_000)
    checked = declared(points, 1, limits={"worker_wait_seconds": 600})
    with stellate.Client(mortal.address) as client:
        talk = Talk(client)
        name = talk.say(pb.PointsChunk(spec=checked.spec)).mesh.name
        mesh = pb.PointsChunk(mesh=name)
        talk.say(mesh, *(rows(i, points[i : i + 500]) for i in range(0, 9_000, 500)))
        while (recorded := talk.say(mesh).rows) == 0:
            time.sleep(0.01)
        mortal.kill()
        mortal.start()
        again = talk.say_to_another_server(mesh).rows  # once the record has been read
        assert recorded <= again <= 9_000
        talk.say(mesh, *(rows(i, points[i : i + 500]) for i in range(again, 20_000, 500)))
        assert talk.say(mesh, rows(0, points[:500]), end(points)).rows == len(points)
        client.delete(name)


def test_a_server_that_is_killed_in_the_run_makes_the_same_mesh(mortal, server, rng):  # noqa: F811
    points = samples.torus(rng, 0.03)
    with stellate.Client(mortal.address) as client:
        checked = declared(points)
        info = client.declare_points(checked)
        client.upload(info.name, checked).run()
        mortal.kill()
        mortal.start()
        mesh = stellate.download(info.name, server=client, unfinished="wait")
        mortal.kill()  # once more, with the mesh finished
        mortal.start()
        again = stellate.download(info.name, server=client, unfinished="wait")
        client.delete(info.name)
    same(mesh, again)
    same(mesh, stellate.reconstruct(points, 2, server=server))


class Talk:
    """Messages by hand, on one stream."""

    def __init__(self, client):
        self._stub = client._stub

    def say(self, *chunks, **how):
        return self._stub.Reconstruct(iter(chunks), timeout=60, **how)

    def say_to_another_server(self, chunk):
        """As say. The connection to the killed one may break under the first attempt."""
        while True:
            try:
                return self.say(chunk, wait_for_ready=True)
            except grpc.RpcError as error:
                if error.code() != grpc.StatusCode.UNAVAILABLE:
                    raise

    def refused(self, *chunks):
        with pytest.raises(grpc.RpcError) as refused:
            self.say(*chunks)
        return refused.value


def rows(first, points, tangents=None):
    chunk = pb.PointsChunk()
    chunk.points.first_row = first
    chunk.points.points.CopyFrom(to_wire(np.asarray(points, float)))
    if tangents is not None:
        chunk.points.tangents.CopyFrom(to_wire(np.asarray(tangents, float)))
    return chunk


def end(points):
    digest = hashlib.sha256(np.ascontiguousarray(points).tobytes()).digest()
    return pb.PointsChunk(end=pb.PointsEnd(points_sha256=digest))


@pytest.fixture
def talk(client):
    return Talk(client)


@contextlib.contextmanager
def mesh_of(talk, client, checked):
    name = talk.say(pb.PointsChunk(spec=checked.spec)).mesh.name
    yield name
    client.delete(name)


def test_hostile_specifications_are_refused_before_a_point(talk, client, torus):
    good = declared(torus).spec

    def refused(**fields):
        spec = type(good)()
        spec.CopyFrom(good)
        for name, value in fields.items():
            setattr(spec, name, value)
        return talk.refused(pb.PointsChunk(spec=spec))

    for field, value in [
        ("dimension", 0),
        ("dimension", 3),
        ("ambient_dimension", 0),
        ("points", 0),
        ("points", 3),
        ("drop", 0.7),
        ("drop", float("nan")),
        ("noise", -1.0),
        ("declared_reach", 0.0),
        ("label", "x" * 200),
        ("weights", 9),
    ]:
        error = refused(**{field: value})
        assert error.code() is grpc.StatusCode.INVALID_ARGUMENT, (field, value, error)
        assert field.removeprefix("declared_") in error.details(), error.details()
    for n in (2**60, 2**64 - 1, 2**33):
        error = refused(points=n)
        assert error.code() is grpc.StatusCode.RESOURCE_EXHAUSTED
        assert str(n) in error.details() and "--max-vertices" in error.details()
    # Vertices that may be added count.
    error = refused(points=client.info().max_vertices, steiner=True)
    assert error.code() is grpc.StatusCode.RESOURCE_EXHAUSTED
    assert "steiner may add" in error.details() and "--max-vertices" in error.details()


def test_a_row_that_is_wrong_is_named_and_the_rest_goes_on(talk, client, torus):
    n = len(torus)
    bad = torus[:50].copy()
    bad[17, 1] = np.nan
    with mesh_of(talk, client, declared(torus)) as name:
        mesh = pb.PointsChunk(mesh=name)
        for chunks, words in [
            ([rows(0, bad)], "coordinate 1 of row 17 is NaN"),
            ([rows(5, torus[5:9])], "row 5 but row 0 is the next"),
            ([rows(0, torus[:10]), rows(11, torus[11:20])], "row 11 but row 10 is the next"),
            ([rows(0, torus[:10]), rows(9, torus[9:20])], "row 9 but row 10 is the next"),
            ([rows(0, torus[:, :2])], "shape"),
            ([rows(0, np.concatenate([torus, torus[:1]]))], f"announced {n} points"),
            ([rows(2**63, torus[:1])], "announced"),
            ([rows(0, torus[:9], np.zeros((9, 3, 2)))], "did not announce"),
            ([rows(0, torus[:10]), end(torus)], "after 10 points"),
            ([mesh], "another stream"),
            ([pb.PointsChunk()], "empty message"),
        ]:
            error = talk.refused(mesh, *chunks)
            assert error.code() is grpc.StatusCode.INVALID_ARGUMENT, error
            assert words in error.details(), error.details()
        error = talk.refused(mesh, rows(0, torus), end(torus + 1))
        assert "SHA-256" in error.details() and "delete the mesh" in error.details()
        assert client.get(name).state == "WAITING"
        assert talk.say(mesh).rows == n  # what was recorded stays
        reply = talk.say(mesh, end(torus))
        assert reply.rows == n and reply.mesh.progress.vertices == n
        fetched = stellate.download(name, server=client, unfinished="wait")
        assert fetched.certified
        assert talk.say(mesh, end(torus)).rows == n  # a client that lost the reply
        assert "is over" in talk.refused(mesh, rows(0, torus)).details()


def test_a_repeated_beginning_is_not_taken_twice(talk, client, torus):
    with mesh_of(talk, client, declared(torus)) as name:
        mesh = pb.PointsChunk(mesh=name)
        talk.say(mesh, rows(0, torus))  # and no end
        while talk.say(mesh).rows < len(torus):
            time.sleep(0.01)
        assert talk.say(mesh, rows(0, torus[:40]), rows(40, torus[40:]), end(torus)).rows == len(
            torus
        )


def test_the_first_message_says_what_it_is_about(talk, client, torus):
    assert "points came first" in talk.refused(rows(0, torus)).details()
    assert "the end came first" in talk.refused(end(torus)).details()
    assert "no mesh" in talk.refused(pb.PointsChunk(mesh="meshes/" + "0" * 32)).details()
    info = client.create(stellate.manifolds.Torus(), 0.3)
    assert "oracle" in talk.refused(pb.PointsChunk(mesh=info.name)).details()
    client.delete(info.name)
    with mesh_of(talk, client, declared(torus)) as name:
        with pytest.raises(stellate.InvalidArgument, match="made of points"):
            client.serve(stellate.manifolds.Torus(), name)


def test_a_stream_that_stalls_is_ended_and_a_mesh_without_one_fails(talk, client, torus):
    checked = declared(torus, limits={"answer_seconds": 0.5, "worker_wait_seconds": 2})
    with mesh_of(talk, client, checked) as name:
        done = threading.Event()

        def stall():
            yield pb.PointsChunk(mesh=name)
            yield rows(0, torus[:5])
            done.wait(60)

        with pytest.raises(grpc.RpcError) as refused:
            talk._stub.Reconstruct(stall(), timeout=60)
        done.set()
        assert "no message came within 0.5 seconds" in refused.value.details()
        with pytest.raises(stellate.StellateError, match="no client sent points") as failed:
            stellate.download(name, server=client, unfinished="wait")
        assert failed.value.reason == "NO_WORKER"


def test_a_newer_stream_takes_over(talk, client, torus):
    with mesh_of(talk, client, declared(torus)) as name:
        done = threading.Event()

        def older():
            yield pb.PointsChunk(mesh=name)
            yield rows(0, torus[:5])
            done.wait(60)

        call = talk._stub.Reconstruct.future(older(), timeout=60)
        time.sleep(0.3)
        assert talk.say(pb.PointsChunk(mesh=name), rows(0, torus), end(torus)).rows == len(torus)
        assert call.exception().code() is grpc.StatusCode.FAILED_PRECONDITION
        done.set()


def test_cancelled_in_the_upload_or_in_the_run(talk, client, torus, rng):
    with mesh_of(talk, client, declared(torus)) as name:
        talk.say(pb.PointsChunk(mesh=name), rows(0, torus[:9]))
        assert client.cancel(name).state == "CANCELLED"
    many = samples.torus(rng, 0.02)
    checked = declared(many)
    with mesh_of(talk, client, checked) as name:
        client.upload(name, checked).run()
        began = time.monotonic()
        client.cancel(name)
        with pytest.raises(stellate.Cancelled) as cancelled:
            stellate.download(name, server=client, unfinished="wait")
        assert len(cancelled.value.mesh.points) == len(many)
        assert time.monotonic() - began < 60


def test_an_exception_in_on_progress_cancels(server, torus):
    class Enough(Exception):
        pass

    def stop(progress):
        raise Enough

    with pytest.raises(Enough):
        stellate.reconstruct(torus, 2, server=server, on_progress=stop)


def test_owners_have_limits_of_their_own(tmp_path, torus):
    tokens = tmp_path / "tokens"
    tokens.write_text("anne " + "a" * 20 + "\nbert " + "b" * 20 + "\n")
    tokens.chmod(0o600)
    flags = ["--owner-memory-bytes", "64000000", "--owner-meshes", "1"]
    with stellate.Server(*flags, token_file=tokens) as server:
        clients = [stellate.Client(server, stellate.Credentials(token=c * 20)) for c in "ab"]
        anne, bert = clients
        large = declared(np.zeros((1, 3)))
        large.spec.points = 1_000_000
        with pytest.raises(stellate.LimitExceeded, match="owner-memory-bytes"):
            anne.declare_points(large)
        held = anne.declare_points(declared(torus))
        with pytest.raises(stellate.LimitExceeded, match="owner-meshes"):
            anne.declare_points(declared(torus))
        with pytest.raises(stellate.MeshNotFound):
            bert.upload(held.name, declared(torus)).run()
        assert stellate.reconstruct(torus, 2, server=bert).certified
        anne.delete(held.name)
        for client in clients:
            client.close()


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
