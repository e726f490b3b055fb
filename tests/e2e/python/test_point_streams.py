"""Points on their way to the server: in chunks, broken off, recorded, wrong, hostile."""

from __future__ import annotations

import contextlib
import threading
import time

import grpc
import numpy as np
import pytest
import samples
import stellate
from point_streams import Talk, declared, end, rows, same, upload
from stellate._generated import stellate_pb2 as pb
from test_restart import mortal  # noqa: F401


@pytest.fixture(autouse=True)
def no_leftovers(client):
    yield
    assert list(client.list()) == []


@pytest.fixture
def torus(rng):
    return samples.torus(rng)


@pytest.fixture
def talk(client):
    return Talk(client)


@contextlib.contextmanager
def mesh_of(talk, client, checked):
    name = talk.say(pb.PointsChunk(spec=checked.spec)).mesh.name
    yield name
    client.delete(name)


@pytest.mark.parametrize("rows", [1, 7, 1000, 10**6])
def test_chunks_of_any_size_make_the_same_mesh(client, server, torus, rows):
    same(upload(client, declared(torus), rows), stellate.reconstruct(torus, 2, server=server))


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
