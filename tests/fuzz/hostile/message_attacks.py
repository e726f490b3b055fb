"""What strangers may say in messages: nonsense, nearly sense, out of order, too large, packed."""

from __future__ import annotations

import random

import grpc
import numpy as np
import raw_http2 as raw
import stellate
from stellate._generated import mesh_pb2, oracle_pb2, stellate_pb2
from stellate._wire.spec import mesh_spec
from stellate.oracle import CheckedOracle
from target import DEADLINE, SERVICE, UNARY, Breach, Target, Worker, create_request, hello

_HUGE = 2**32 - 1
_UNPACKED = 96 << 20  # bytes of a packed message


def _answers(lease: int, points: np.ndarray | None = None) -> bytes:
    chunk = oracle_pb2.AnswerChunk(lease=lease)
    if points is not None:
        chunk.points.shape.extend(points.shape)
        chunk.points.data = points.tobytes()
    return oracle_pb2.ServeOracleRequest(answers=chunk).SerializeToString()


def _truth(chunk: oracle_pb2.QueryChunk) -> oracle_pb2.ServeOracleRequest:
    """What a sphere answers."""
    sphere = stellate.manifolds.Sphere()
    points = sphere.closest_point(np.frombuffer(chunk.points.data).reshape(-1, 3))
    reply = oracle_pb2.ServeOracleRequest()
    reply.answers.lease = chunk.lease
    for array, values in (
        (reply.answers.points, points),
        (reply.answers.tangents, sphere.tangent_basis(points)),
    ):
        array.shape.extend(values.shape)
        array.data = np.ascontiguousarray(values).tobytes()
    return reply


def _mutate(rng: random.Random, body: bytes) -> bytes:
    data = bytearray(body)
    for _ in range(rng.randint(1, 6)):
        at = rng.randrange(len(data) + 1)
        choice = rng.randrange(5)
        if choice == 0 and at < len(data):
            data[at] ^= 1 << rng.randrange(8)
        elif choice == 1:
            data[at:at] = rng.randbytes(rng.randint(1, 8))
        elif choice == 2:
            del data[at : at + rng.randint(1, 16)]
        elif choice == 3:
            data[at : at + 4] = b"\xff" * 4
        else:
            data[at:at] = data[at : at + rng.randint(1, 32)]
    return bytes(data)


def _valid_messages(name: str) -> dict[str, bytes]:
    spec = mesh_spec(CheckedOracle(stellate.manifolds.Sphere()), 0.3, {"max_vertices": 1000})
    named = {
        rpc: getattr(stellate_pb2, f"{rpc}Request")(name=name).SerializeToString()
        for rpc in ("GetMesh", "WatchMesh")
    }
    page = stellate_pb2.ListMeshesRequest(page_size=3, page_token="1").SerializeToString()
    return {"CreateMesh": create_request(spec), "ListMeshes": page, **named}


def random_messages(target: Target) -> None:
    """Bytes that are no message."""
    for _ in range(2 * target.scale):
        for rpc in UNARY:
            target.unary(rpc, target.random.randbytes(target.random.randrange(200)))
        target.stream("ServeOracle", [target.random.randbytes(50)])
        target.stream("WatchMesh", [target.random.randbytes(50)])


def mutated_messages(target: Target) -> None:
    """Messages that nearly are what was meant. Meshes that come of them are deleted."""
    mine = target.create()
    for _ in range(5 * target.scale):
        for rpc, body in _valid_messages(mine).items():
            mutated = _mutate(target.random, body)
            if rpc == "WatchMesh":
                target.stream(rpc, [mutated], take=1)
                continue
            reply = target.unary(rpc, mutated)
            if rpc == "CreateMesh" and reply is not None:
                target.delete(mesh_pb2.Mesh.FromString(reply).name)
        target.stream("ServeOracle", [_mutate(target.random, hello(mine)), _answers(1)], take=2)
    target.delete(mine)


def wrong_order(target: Target) -> None:
    """Messages that are in order one by one, and not one after the other."""
    mine = target.create()
    failure = oracle_pb2.ServeOracleRequest(failure=oracle_pb2.OracleFailure(lease=3))
    sequences = [
        [_answers(1)],
        [failure.SerializeToString()],
        [b""],
        [hello(mine), hello(mine)],
        [hello(mine), b""],
        [hello("meshes/" + "0" * 32)],
        [hello("x" * 10_000)],
        [],
    ]
    for _ in range(target.scale):
        for sequence in sequences:
            taken = target.stream("ServeOracle", sequence)
            target.must_refuse(taken and sequence, f"messages in wrong order: {sequence}")
    target.delete(mine)


def leases(target: Target) -> None:
    """Answers with leases of others, of the past and of nobody; answers twice; true ones late."""
    for _ in range(target.scale):
        mine = target.create(0.4)
        robbed, thief = Worker(target, mine), Worker(target, mine)
        chunk = robbed.next_chunk()
        # Others' leases and those of the past are ignored, as late answers are.
        for lease in (chunk.lease if chunk else 1, 0):
            if thief.next_chunk() is not None:
                thief.send(_answers(lease, np.zeros((7, 3))))
        thief.hang_up()
        for lease in (2**63, 1000 + target.random.randrange(1 << 20)):
            other = Worker(target, mine)
            other.send(_answers(lease, np.zeros((7, 3))))
            target.must_refuse(other.until_end(), f"lease {lease}")
        if chunk is not None:
            reply = _truth(chunk)
            for _ in range(2):
                robbed.send(reply.SerializeToString())
        robbed.next_chunk()  # the second answer is refused, or late and ignored
        robbed.hang_up()
        target.delete(mine)


def giant_shapes(target: Target) -> None:
    """Arrays, messages and meshes far larger than what is sent."""
    sphere = CheckedOracle(stellate.manifolds.Sphere())
    for _ in range(target.scale):
        for shape in ([_HUGE, 3], [_HUGE] * 2, [3, _HUGE], [_HUGE] * 64, []):
            spec = mesh_spec(sphere, 0.3, {})
            spec.seeds.shape.extend(shape)
            spec.seeds.data = bytes(24)
            target.must_refuse(
                target.unary("CreateMesh", create_request(spec)), f"seeds of shape {shape}"
            )
        for field in ("dimension", "ambient_dimension", "box_seeds"):
            spec = mesh_spec(sphere, 0.3, {})
            setattr(spec, field, _HUGE)
            target.must_refuse(
                target.unary("CreateMesh", create_request(spec)), f"{field} = {_HUGE}"
            )
        mine = target.create()
        worker = Worker(target, mine)
        chunk = worker.next_chunk()
        if chunk is not None:
            reply = _truth(chunk)
            reply.answers.points.shape[0] = _HUGE
            worker.send(reply.SerializeToString())
        target.must_refuse(worker.until_end(), "points that are not there")
        target.delete(mine)
        target.must_refuse(target.unary("GetMesh", bytes(5 << 20)), "a message above the limit")
        for declared in (_HUGE, 1 << 30, 1):
            connection = target.connect()
            connection.open(1, SERVICE + "ServeOracle")
            connection.data(1, raw.grpc_message(bytes(100), declared))
            connection.close()


def packed_messages(target: Target) -> None:
    """Messages that grow a thousandfold when they are unpacked: none may be."""
    places = [SERVICE + rpc for rpc in (*UNARY, "ServeOracle", "WatchMesh", "DownloadMesh")]
    places += ["/grpc.health.v1.Health/Check"]
    places += ["/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo"]
    for place in target.scale * places:
        body = bytes(_UNPACKED if place.endswith("GetMesh") else 100_000)
        call = target.channel.stream_stream(place)
        packed = call(iter([body]), timeout=DEADLINE, compression=grpc.Compression.Gzip)
        try:
            for _ in packed:
                break
        except grpc.RpcError as error:
            target.note(error)
        # Anything else, even "too large", is said once it was unpacked.
        if packed.code() != grpc.StatusCode.UNIMPLEMENTED:
            raise Breach(f"{place} answered a packed message: {packed.code()}")
