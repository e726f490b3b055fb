"""The client against a server that misbehaves, or is not there."""

import os
import stat
import threading

import fake_server
import grpc
import numpy as np
import pytest
import stellate
from fake_server import FakeServer, delta, final, serving
from stellate import _reconnect
from stellate._generated import mesh_pb2, oracle_pb2
from stellate._wire.arrays import to_wire
from stellate.manifolds import Sphere

CIRCLE = Sphere(1)
TRIANGLE = np.array([[1.0, 0], [-0.5, 0.8], [-0.5, -0.8]])
EDGES = [[0, 1], [0, 2], [1, 2]]


def test_a_watch_survives_broken_connections():
    """It goes on from the last complete revision, and counts nothing twice."""
    fake = FakeServer(
        [
            [delta(1, 0, TRIANGLE[:2], [[0, 1]]), delta(2, 2, TRIANGLE[2:], [], False)]
            + [grpc.StatusCode.UNAVAILABLE],
            [grpc.StatusCode.UNAVAILABLE],
            [delta(2, 2, TRIANGLE[2:], EDGES[1:]), final()],
        ]
    )
    with serving(fake) as address:
        mesh = stellate.mesh(CIRCLE, 0.1, server=address)
    assert fake.watched_from == [0, 1, 1]
    assert np.array_equal(mesh.points, TRIANGLE) and np.array_equal(mesh.simplices, EDGES)
    assert mesh.report.termination == "CONVERGED"
    assert fake.deleted == ["meshes/x"]


def test_a_server_that_breaks_the_protocol_is_found_out():
    with serving(FakeServer([[delta(1, 5, TRIANGLE, EDGES), final()]])) as address:
        with pytest.raises(stellate.StellateError, match="vertex 5") as caught:
            stellate.mesh(CIRCLE, 0.1, server=address)
    assert caught.value.reason == "PROTOCOL"


def test_a_mesh_that_ends_without_a_report_is_no_mesh_of_a_server():
    end = final()
    end.final.ClearField("report")
    with serving(FakeServer([[delta(1, 0, TRIANGLE, EDGES), end]])) as address:
        with pytest.raises(stellate.StellateError, match="without a report") as caught:
            stellate.mesh(CIRCLE, 0.1, server=address)
    assert caught.value.reason == "PROTOCOL"


def test_a_mesh_cancelled_by_others_keeps_what_there_is():
    fake = FakeServer([[delta(1, 0, TRIANGLE, EDGES), final(mesh_pb2.MESH_STATE_CANCELLED)]])
    with serving(fake) as address, pytest.raises(stellate.Cancelled) as caught:
        stellate.mesh(CIRCLE, 0.1, server=address)
    assert np.array_equal(caught.value.mesh.simplices, EDGES)


def test_answers_carry_the_lease_and_the_hello_bounds_the_chunks():
    x = np.array([[2.0, 0.0], [0.0, 0.0], [0.0, -3.0]])
    chunk = oracle_pb2.QueryChunk(
        lease=42,
        kind=oracle_pb2.QUERY_KIND_CLOSEST_POINT,
        points=to_wire(x),
        want_tangents=True,
    )
    fake = FakeServer(chunks=[chunk])
    with serving(fake) as address:
        assert stellate.serve(CIRCLE, "meshes/x", server=address, worker="w") == "SUCCEEDED"
    reply = fake.answers[0].answers
    assert (reply.lease, reply.found) == (42, bytes([1, 0, 1]))
    assert np.frombuffer(reply.points.data).reshape(3, 2)[[0, 2]].tolist() == [[1, 0], [0, -1]]
    assert list(reply.tangents.shape) == [3, 2, 1]
    assert (fake.hello.mesh, fake.hello.worker) == ("meshes/x", "w")
    assert fake.hello.max_chunk_queries * (2 + 2) * 8 < 4 << 20


def test_a_mesh_of_another_kind_is_not_served():
    fake = FakeServer(chunks=[oracle_pb2.QueryChunk()])
    with serving(fake) as address:
        with pytest.raises(stellate.InvalidArgument, match=r"dimension 1 in R\^2.*2 in R\^3"):
            stellate.serve(Sphere(2), "meshes/x", server=address)
        fake.welcome.oracle.intersect_flat = True
        with pytest.raises(
            stellate.InvalidArgument, match="intersect_flat, which this oracle lacks"
        ):
            stellate.serve(CIRCLE, "meshes/x", server=address)


def test_nobody_listens():
    with pytest.raises(stellate.Unavailable, match="no server listens there"):
        stellate.mesh(CIRCLE, 0.1, server="127.0.0.1:1")


@pytest.mark.parametrize("server", ["", 7])
def test_an_address_that_is_none(server):
    with pytest.raises(stellate.InvalidArgument, match="host:port"):
        stellate.mesh(CIRCLE, 0.1, server=server)


def test_no_binary_to_start(monkeypatch, tmp_path):
    monkeypatch.setenv("STELLATED", str(tmp_path / "absent"))
    with pytest.raises(stellate.ServerNotFound, match="STELLATED.*absent"):
        stellate.mesh(CIRCLE, 0.1)


def program(path, text):
    path.write_text("#!/bin/sh\n" + text)
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return path


def test_a_binary_that_dies_says_why(monkeypatch, tmp_path):
    monkeypatch.setenv(
        "STELLATED", str(program(tmp_path / "bad", "echo no luck today >&2; exit 3\n"))
    )
    before = set(threading.enumerate())
    with pytest.raises(stellate.Unavailable, match=r"status 3(.|\n)*no luck today"):
        stellate.mesh(CIRCLE, 0.1)
    assert set(threading.enumerate()) <= before


def test_where_the_binary_is_looked_for(monkeypatch, tmp_path):
    mine = program(tmp_path / "stellated", "exit 0\n")
    monkeypatch.setenv("STELLATED", str(mine))
    assert stellate.server.find_stellated() == str(mine)
    monkeypatch.setenv("STELLATED", "stellated")
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    assert stellate.server.find_stellated() == str(mine)


def test_the_fake_speaks_the_whole_service():
    """A guard for the tests above: a renamed rpc would make them pass for the wrong reason."""
    for name in ("CreateMesh", "WatchMesh", "ServeOracle", "DeleteMesh"):
        assert name in vars(FakeServer) and hasattr(fake_server.rpc.StellateServicer, name)


@pytest.mark.parametrize(
    "address, asked, wanted",
    [
        ("unix:/nowhere", None, False),
        ("127.0.0.1:9", None, False),
        ("far.example.org:9", None, True),
        ("far.example.org:9", False, False),
        ("unix:/nowhere", True, True),
    ],
)
def test_far_servers_sample_speculatively(monkeypatch, address, asked, wanted):
    specs = []

    def create(self, method, request, **_):
        specs.append(request.spec)
        return mesh_pb2.Mesh(name="meshes/x")

    monkeypatch.setattr(stellate.Client, "_call", create)
    stellate.Client(address).create(CIRCLE, 0.1, speculative=asked)
    assert specs[0].criteria.speculative is wanted


def test_the_page_tells_how_long_clients_wait(repository):
    page = (repository / "docs/using/outages.md").read_text()
    first, longest, give_up, keepalive = (
        f"{_reconnect.WAITS[name]:g} s"
        for name in ("first_pause", "longest_pause", "give_up", "keepalive")
    )
    assert f"| {give_up} |\n| ping a silent server after" in page
    assert f"| {keepalive} |\n| hear of it" in page
    assert f"are {first}, doubled up to {longest}, each shortened at random by up to half" in page
    assert (_reconnect.WAITS["pause_growth"], _reconnect.WAITS["pause_jitter"]) == (2, 0.5)
