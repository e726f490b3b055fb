"""Calls to servers that share a database: any takes any, and limits hold on all together."""

from __future__ import annotations

import concurrent.futures
import contextlib
import hmac
import time

import cases
import grpc
import numpy
import pytest
import stellate
from servers import EPSILON, PATIENCE, are_same, sql, wait_for
from stellate import manifolds
from stellate._generated import mesh_pb2
from stellate._generated import stellate_pb2 as pb
from stellate._generated import stellate_pb2_grpc as pb_grpc
from stellate._wire.arrays import to_wire


def test_any_server_takes_any_call(cluster, undisturbed):
    first, second = cluster.ready("first", "second")
    with stellate.Client(first.address) as one, stellate.Client(second.address) as other:
        name = one.create(manifolds.Torus(), EPSILON, worker_wait_seconds=PATIENCE).name
        waiting = other.create(manifolds.Torus(), EPSILON, worker_wait_seconds=PATIENCE).name
        assert other.get(name).state == one.get(name).state == "WAITING"
        for client in (one, other):
            wait_for(lambda client=client: {m.name for m in client.list()} == {name, waiting})
            assert {m.name for m in client.list(page_size=1)} == {name, waiting}
        assert other.serve(manifolds.Torus(), name) == "SUCCEEDED"
        for server in (first, second):
            made = stellate.download(name, server=server.address)
            assert are_same(made, undisturbed)
        assert one.cancel(waiting).state == "CANCELLED"
        one.delete(waiting)
        wait_for(lambda: {m.name for m in other.list()} == {name})
        for client in (one, other):
            with pytest.raises(stellate.MeshNotFound):
                client.get(waiting)
            with pytest.raises(stellate.MeshNotFound):
                client.get("meshes/" + 32 * "f")
    made = stellate.mesh(manifolds.Torus(), EPSILON, server=second.address)
    assert are_same(made, undisturbed)


def test_the_trace_of_a_call_goes_along_to_the_server_that_has_its_mesh(cluster, monkeypatch):
    collector = grpc.server(concurrent.futures.ThreadPoolExecutor(1))
    bodies = []
    export = grpc.unary_unary_rpc_method_handler(lambda body, _: (bodies.append(body), b"")[1])
    service = "opentelemetry.proto.collector.trace.v1.TraceService"
    collector.add_generic_rpc_handlers(
        [grpc.method_handlers_generic_handler(service, {"Export": export})]
    )
    port = collector.add_insecure_port("127.0.0.1:0")
    collector.start()
    monkeypatch.setenv("OTEL_EXPORTER_OTLP_ENDPOINT", f"http://127.0.0.1:{port}")
    first, second = cluster.ready("first", "second")
    with stellate.Client(second.address) as owner, stellate.Client(first.address) as other:
        name = owner.create(manifolds.Torus(), EPSILON, worker_wait_seconds=PATIENCE).name
        worker = other.worker(manifolds.Torus(), name)
        trace = "0af7651916cd43dd8448eb211c80319c"
        worker._trace = (("traceparent", f"00-{trace}-b7ad6b7169203331-01"),)
        assert worker.run() == "SUCCEEDED"
    wait_for(lambda: any(bytes.fromhex(trace) in body for body in bodies))
    collector.stop(None)


def declare(stub: pb_grpc.StellateStub, request: pb.CreateMeshRequest) -> str:
    """As a client does it: again while the server asks for that."""
    until = time.monotonic() + PATIENCE
    while True:
        try:
            return stub.CreateMesh(request, timeout=PATIENCE).name
        except grpc.RpcError as error:
            if error.code() is not grpc.StatusCode.UNAVAILABLE or time.monotonic() > until:
                raise


def test_a_mesh_is_declared_once_at_whichever_server(cluster):
    pair = cluster.ready("first", "second")
    with contextlib.ExitStack() as stack:
        stubs = [
            pb_grpc.StellateStub(stack.enter_context(grpc.insecure_channel(server.address)))
            for server in pair
        ]
        spec = mesh_pb2.MeshSpec(dimension=2, ambient_dimension=3, epsilon=0.3)
        spec.seeds.CopyFrom(to_wire(numpy.array([[1.0, 0.0, 0.0]])))
        for turn in range(8):
            request = pb.CreateMeshRequest(spec=spec, mesh_id=f"{turn:032x}")
            assert {declare(stub, request) for stub in stubs} == {"meshes/" + request.mesh_id}
        spec.epsilon = 0.2
        other = pb.CreateMeshRequest(spec=spec, mesh_id=32 * "0")
        for stub in stubs:
            with pytest.raises(grpc.RpcError, match="declared otherwise"):
                declare(stub, other)


@pytest.fixture
def owned(cluster, tmp_path):
    """Two servers that allow each owner five meshes, together; ada's token, and bob's."""
    tokens = tmp_path / "tokens"
    tokens.write_text("ada " + 40 * "a" + "\nbob " + 40 * "b" + "\n")
    tokens.chmod(0o600)
    pair = cluster.ready(
        "first", "second", flags=("--token-file", str(tokens), "--owner-meshes", "5")
    )
    return pair, 40 * "a", 40 * "b"


def test_limits_of_an_owner_hold_on_all_servers(owned):
    pair, ada, bob = owned
    assert cases.declare_beyond(pair, ada, 10) == (5, 5)
    with stellate.Client(pair[0].address, stellate.Credentials(token=ada)) as client:
        wait_for(lambda: len(list(client.list())) == 5)  # once the servers have seen each other
        name = next(client.list()).name
        client.cancel(name)  # whichever server has it
        with stellate.Client(pair[1].address, stellate.Credentials(token=bob)) as other:
            assert not list(other.list())
            with pytest.raises(stellate.MeshNotFound):
                other.get(name)
    wait_for(lambda: cases.declare_beyond(pair[1:] * 2, ada, 1) == (1, 0))


def test_points_beyond_an_owners_limit_are_refused(cluster, owned):
    (full, empty), ada, _ = owned
    cloud = manifolds.Torus().closest_point(numpy.random.default_rng(3).normal(size=(400, 3)))
    with stellate.Client(full.address, stellate.Credentials(token=ada)) as client:
        for _ in range(5):
            client.create(manifolds.Torus(), EPSILON, worker_wait_seconds=86400)
    with stellate.Client(empty.address, stellate.Credentials(token=ada)) as client:
        with pytest.raises(stellate.LimitExceeded, match="owner-meshes"):
            stellate.reconstruct(cloud, 2, server=client)
        states = {mesh.state for mesh in client.list()}
    assert states == {"WAITING"}, "nothing is left of it"
    left = "SELECT count(*) FROM stellate.meshes"
    assert sql(cluster.database, left) == "5"


def test_a_first_call_waits_for_a_mesh_whose_server_has_just_died(cluster):
    (first,), (second,) = cluster.ready("first"), cluster.ready("second")
    with stellate.Client(first.address) as client:
        name = client.create(manifolds.Torus(), EPSILON, worker_wait_seconds=86400).name
    with stellate.Client(second.address) as client:
        wait_for(lambda: [mesh.name for mesh in client.list()] == [name])
    first.end()
    with stellate.Client(second.address, reconnect_seconds=PATIENCE) as client:
        assert client.get(name).state == "WAITING"
    with stellate.Client(second.address, reconnect_seconds=0) as client:
        assert [mesh.name for mesh in client.list()] == [name]


def passed_on(server: int, beat: int, secret: bytes) -> str:
    """What a server says of a call of ada's, who may see all meshes, that it passes on."""
    words = f"{server}\n{beat}\n1\nipv4:10.0.0.1:40000\nada".encode()
    return f"Stellate-Server {words.hex()}.{hmac.digest(secret, words, 'sha256').hex()}"


def test_what_servers_say_of_callers_is_worth_nothing_a_minute_later(owned, cluster):
    (server, _), _, _ = owned
    secret = bytes.fromhex(
        sql(cluster.database, "SELECT encode(secret, 'hex') FROM stellate.common")
    )
    told = f"SELECT id, beats FROM stellate.servers WHERE address = '{server.address}'"
    wait_for(lambda: sql(cluster.database, told))
    number, beat = map(int, sql(cluster.database, told).split("|"))

    def call(ticket: str) -> grpc.StatusCode:
        with grpc.insecure_channel(server.address) as channel:
            stub = pb_grpc.StellateStub(channel)
            try:
                stub.ListMeshes(
                    pb.ListMeshesRequest(),
                    metadata=[("authorization", ticket)],
                    timeout=PATIENCE,
                )
            except grpc.RpcError as error:
                return error.code()
        return grpc.StatusCode.OK

    assert call(passed_on(number, beat, secret)) is grpc.StatusCode.OK
    assert call(passed_on(number, beat - 100, secret)) is grpc.StatusCode.UNAVAILABLE
    assert call(passed_on(number + 1, beat, secret)) is grpc.StatusCode.UNAVAILABLE
    assert call(passed_on(number, beat, secret[1:])) is grpc.StatusCode.UNAUTHENTICATED
