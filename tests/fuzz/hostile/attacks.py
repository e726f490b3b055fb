"""What strangers may try on a server. Each attack ends by itself, or raises when the server hangs.

An attack knows only its own meshes: the names of others' cannot be guessed.
"""

from __future__ import annotations

import collections
import dataclasses
import itertools
import random
import struct
import threading
import time
from collections.abc import Iterator
from typing import Any, Callable

import grpc
import numpy as np
import raw_http2 as raw
import stellate
from stellate._generated import mesh_pb2, oracle_pb2, stellate_pb2
from stellate._wire.spec import mesh_spec
from stellate.oracle import CheckedOracle
from strangers import ENDLESS, HALF, STRANGERS

SERVICE = "/stellate.v1.Stellate/"
UNARY = ("CreateMesh", "GetMesh", "ListMeshes", "CancelMesh", "DeleteMesh", "GetServerInfo")
_DEADLINE = 60.0  # a call that takes longer hangs
_HUGE = 2**32 - 1
_RESETS = 30_000
_MANY_CALLS = 5000  # above --max-connection-streams
_UNPACKED = 96 << 20  # bytes of a packed message


class Breach(Exception):
    """Something got through."""


@dataclasses.dataclass
class Target:
    """The server, and how hard it is tried."""

    host: str
    port: int
    channel: grpc.Channel
    random: random.Random
    scale: int
    refused: int = 0  # calls that were answered with an error
    taken: int = 0  # calls that were answered otherwise
    codes: collections.Counter = dataclasses.field(default_factory=collections.Counter)

    def unary(self, rpc: str, body: bytes) -> bytes | None:
        """Calls with any bytes; None when refused."""
        try:
            reply = self.channel.unary_unary(SERVICE + rpc)(body, timeout=_DEADLINE)
        except grpc.RpcError as error:
            self.note(error)
            return None
        self.taken += 1
        return reply

    def note(self, error: grpc.RpcError) -> None:
        """A refusal is what we want; an answer that never comes is not."""
        self.refused += 1
        self.codes[error.code().name] += 1
        if error.code() == grpc.StatusCode.DEADLINE_EXCEEDED:
            raise TimeoutError(f"no answer within {_DEADLINE:.0f} s")

    def stream(self, rpc: str, bodies: list[bytes], take: int = 1000) -> bool:
        """Sends some messages on a stream and takes at most `take` answers. False: refused."""
        call = self.channel.stream_stream(SERVICE + rpc)(iter(bodies), timeout=_DEADLINE)
        try:
            for number, _ in enumerate(call, 1):
                if number >= take:
                    break
        except grpc.RpcError as error:
            self.note(error)
            return False
        call.cancel()
        self.taken += 1
        return True

    def must_refuse(self, accepted: Any, what: str) -> None:
        """What no server may let pass."""
        if accepted:
            raise Breach(f"the server took {what}")

    def connect(self, settings: bytes = b"") -> raw.Connection:
        """A raw connection, greeted."""
        connection = raw.Connection(self.host, self.port, settings)
        connection.greet()
        return connection

    def create(self, epsilon: float = 0.3) -> str:
        """A mesh of the attacker's own."""
        spec = mesh_spec(CheckedOracle(stellate.manifolds.Sphere()), epsilon, {})
        reply = self.unary("CreateMesh", _create(spec))
        return "" if reply is None else mesh_pb2.Mesh.FromString(reply).name

    def delete(self, name: str) -> None:
        """Forgets it."""
        self.unary("DeleteMesh", stellate_pb2.DeleteMeshRequest(name=name).SerializeToString())


def _create(spec: mesh_pb2.MeshSpec) -> bytes:
    return stellate_pb2.CreateMeshRequest(spec=spec).SerializeToString()


def _hello(mesh: str) -> bytes:
    hello = oracle_pb2.Hello(mesh=mesh, worker="stranger", max_chunk_queries=7)
    return oracle_pb2.ServeOracleRequest(hello=hello).SerializeToString()


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
    return {"CreateMesh": _create(spec), "ListMeshes": page, **named}


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
        target.stream("ServeOracle", [_mutate(target.random, _hello(mine)), _answers(1)], take=2)
    target.delete(mine)


def wrong_order(target: Target) -> None:
    """Messages that are in order one by one, and not one after the other."""
    mine = target.create()
    failure = oracle_pb2.ServeOracleRequest(failure=oracle_pb2.OracleFailure(lease=3))
    sequences = [
        [_answers(1)],
        [failure.SerializeToString()],
        [b""],
        [_hello(mine), _hello(mine)],
        [_hello(mine), b""],
        [_hello("meshes/" + "0" * 32)],
        [_hello("x" * 10_000)],
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
        robbed, thief = _Worker(target, mine), _Worker(target, mine)
        chunk = robbed.next_chunk()
        # Others' leases and those of the past are ignored, as late answers are.
        for lease in (chunk.lease if chunk else 1, 0):
            if thief.next_chunk() is not None:
                thief.send(_answers(lease, np.zeros((7, 3))))
        thief.hang_up()
        for lease in (2**63, 1000 + target.random.randrange(1 << 20)):
            other = _Worker(target, mine)
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
            target.must_refuse(target.unary("CreateMesh", _create(spec)), f"seeds of shape {shape}")
        for field in ("dimension", "ambient_dimension", "box_seeds"):
            spec = mesh_spec(sphere, 0.3, {})
            setattr(spec, field, _HUGE)
            target.must_refuse(target.unary("CreateMesh", _create(spec)), f"{field} = {_HUGE}")
        mine = target.create()
        worker = _Worker(target, mine)
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


def half_open(target: Target) -> None:
    """Connections and calls that begin and stay, then break off."""
    kept = []
    for _ in range(4 * target.scale):
        kept.append(raw.Connection(target.host, target.port))
        kept[-1].send(raw.PREFACE[: target.random.randrange(len(raw.PREFACE))])
        for path in ("ServeOracle", "WatchMesh", "CreateMesh", "Nothing"):
            connection = target.connect()
            connection.open(1, SERVICE + path)
            if target.random.randrange(2):
                connection.data(1, raw.grpc_message(b"\x0a", 1000))
            if target.random.randrange(2):
                connection.data(1, b"", raw.END_STREAM)
            kept.append(connection)
    for connection in kept:
        connection.close()


def floods(target: Target) -> None:
    """Tiny things by the thousand: messages, calls that are reset, pings, settings."""
    many = 200 * target.scale
    mine = target.create()
    connection = target.connect()
    connection.open(1, SERVICE + "ServeOracle")
    tiny = raw.grpc_message(_hello(mine)) + many * raw.grpc_message(b"")
    for at in range(0, len(tiny), 16_000):
        connection.data(1, tiny[at : at + 16_000])
    for number in range(many):
        stream = 3 + 2 * number
        connection.open(stream, SERVICE + "WatchMesh")
        connection.send(raw.frame(raw.RST_STREAM, 0, stream, struct.pack(">I", 8)))
    connection.close()
    connection = target.connect()
    connection.send(many * raw.frame(raw.PING, 0, 0, bytes(8)))
    connection.close()
    connection = target.connect()
    connection.send(many * raw.frame(raw.SETTINGS, 0, 0))
    connection.close()
    connection = target.connect()
    body = raw.grpc_message(stellate_pb2.GetServerInfoRequest().SerializeToString())
    for number in range(many):
        connection.open(1 + 2 * number, SERVICE + "GetServerInfo")
        connection.data(1 + 2 * number, body, raw.END_STREAM)
    connection.close()
    target.delete(mine)


def rapid_resets(target: Target) -> None:
    """Calls reset as fast as they are made, and connections made as fast as they are closed."""
    path = SERVICE + target.random.choice(("WatchMesh", "GetServerInfo", "Nothing"))
    for _ in range(3):
        connection = target.connect()
        block = raw.header_block(path)
        for first in range(0, _RESETS, 500):
            connection.send(
                b"".join(
                    raw.frame(raw.HEADERS, raw.END_HEADERS, stream, block)
                    + raw.frame(raw.RST_STREAM, 0, stream, struct.pack(">I", 8))
                    for stream in range(1 + 2 * first, 1 + 2 * (first + 500), 2)
                )
            )
        connection.close()


def unbounded_calls(target: Target) -> None:
    """Open calls beyond the bound, by a client that never acknowledges it: it is hung up on."""
    for path in ("ServeOracle", "WatchMesh", "CreateMesh"):
        connection = target.connect()
        for number in range(_MANY_CALLS):
            connection.open(1 + 2 * number, SERVICE + path)
        connection.until_closed()
        connection.close()


def packed_messages(target: Target) -> None:
    """Messages that grow a thousandfold when they are unpacked: none may be."""
    places = [SERVICE + rpc for rpc in (*UNARY, "ServeOracle", "WatchMesh", "DownloadMesh")]
    places += ["/grpc.health.v1.Health/Check"]
    places += ["/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo"]
    for place in target.scale * places:
        body = bytes(_UNPACKED if place.endswith("GetMesh") else 100_000)
        call = target.channel.stream_stream(place)
        packed = call(iter([body]), timeout=_DEADLINE, compression=grpc.Compression.Gzip)
        try:
            for _ in packed:
                break
        except grpc.RpcError as error:
            target.note(error)
        # Anything else, even "too large", is said once it was unpacked.
        if packed.code() != grpc.StatusCode.UNIMPLEMENTED:
            raise Breach(f"{place} answered a packed message: {packed.code()}")


def unread_replies(target: Target) -> None:
    """Pings, settings and calls whose replies nobody reads: they must not pile up."""
    pings = 2000 * target.scale * raw.frame(raw.PING, 0, 0, bytes(8))
    settings = 2000 * target.scale * raw.frame(raw.SETTINGS, 0, 0)
    calls = b"".join(
        raw.frame(
            raw.HEADERS,
            raw.END_HEADERS | raw.END_STREAM,
            1 + 2 * number,
            raw.header_block(SERVICE + "Nothing"),
        )
        for number in range(200 * target.scale)
    )
    for flood in (pings, settings, calls):
        connection = target.connect()
        connection.send_unread(flood)
        connection.close()


def other_protocols(target: Target) -> None:
    """What is no HTTP/2 at all, and HTTP/2 that breaks its rules: the server hangs up."""
    rng = target.random
    huge = raw.header_block(SERVICE + "GetMesh", {"x": "y" * 10_000})
    for _ in range(target.scale):
        for words in (
            b"GET / HTTP/1.1\r\nHost: x\r\n\r\n",
            b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + rng.randbytes(200),
            rng.randbytes(1000),
            raw.PREFACE + rng.randbytes(1000),
            raw.PREFACE + raw.frame(raw.DATA, 0, 0, bytes(10)),
            raw.PREFACE + raw.frame(raw.SETTINGS, 0, 0, bytes(5)),
            raw.PREFACE + raw.frame(raw.WINDOW, 0, 0, bytes(4)),
        ):
            connection = raw.Connection(target.host, target.port)
            connection.send(words)
            connection.close()
        connection = target.connect()
        connection.send(raw.frame(raw.HEADERS, 0, 1, huge))
        for _ in range(50):
            connection.send(raw.frame(raw.CONTINUATION, 0, 1, huge))
        connection.close()


def endless_headers(target: Target) -> None:
    """Header blocks without end: each is cut, and its stranger comes again."""
    for words in ENDLESS:
        for _ in range(4 * target.scale):
            connection = target.connect()
            for part in itertools.islice(words(), 100):
                connection.send(part)
            connection.until_closed()
            connection.close()


def half_messages(target: Target) -> None:
    """Calls by the hundred, each of which lacks the end of its message."""
    for kind in HALF:
        STRANGERS[kind](target.host, target.port, time.time() + 0.5 * target.scale, 0)


def bad_headers(target: Target) -> None:
    """Headers that no call may have, among more of them than a call may have."""
    for _ in range(target.scale):
        for bad in ({"te": "x"}, {":scheme": "x"}, {"grpclb_client_stats": "x"}, {"x-bin": "***"}):
            for more in ({}, {"big": "y" * 9000}):
                connection = target.connect()
                connection.open(1, SERVICE + "GetServerInfo", {**bad, **more})
                connection.data(1, raw.grpc_message(b""), raw.END_STREAM)
                connection.close()


def deaf_watchers(target: Target) -> None:
    """Watchers and workers that ask for everything and read nothing."""
    no_window = struct.pack(">HI", 4, 0)  # SETTINGS_INITIAL_WINDOW_SIZE = 0
    mine = target.create()
    watch = stellate_pb2.WatchMeshRequest(name=mine).SerializeToString()
    kept = []
    for _ in range(target.scale):
        for path, body in (("WatchMesh", watch), ("ServeOracle", _hello(mine))):
            connection = target.connect(no_window)
            connection.open(1, SERVICE + path)
            connection.data(1, raw.grpc_message(body))
            kept.append(connection)
    for connection in kept:
        connection.close()
    target.delete(mine)


def silent_watchers(target: Target) -> None:
    """Watchers and downloads by the hundred, of which none is read."""
    mine = target.create()
    watch = stellate_pb2.WatchMeshRequest(name=mine).SerializeToString()
    download = stellate_pb2.DownloadMeshRequest(name=mine).SerializeToString()
    connection = target.connect()
    for number in range(200 * target.scale):
        path, body = (("WatchMesh", watch), ("DownloadMesh", download))[number % 2]
        connection.open(1 + 2 * number, SERVICE + path)
        connection.data(1 + 2 * number, raw.grpc_message(body), raw.END_STREAM)
    connection.close()
    target.delete(mine)


def made_and_cancelled(target: Target) -> None:
    """More meshes than are kept, each cancelled at once."""
    for _ in range(33 * target.scale):
        name = target.create()
        target.unary("CancelMesh", stellate_pb2.CancelMeshRequest(name=name).SerializeToString())


class _Worker:
    """A worker's stream, message by message."""

    def __init__(self, target: Target, mesh: str) -> None:
        self._target = target
        self._outgoing: list[bytes] = [_hello(mesh)]
        self._changed = threading.Condition()
        self._call: Any = target.channel.stream_stream(SERVICE + "ServeOracle")(
            self._requests(), timeout=_DEADLINE
        )

    def _requests(self) -> Iterator[bytes]:
        while True:
            with self._changed:
                while not self._outgoing:
                    self._changed.wait()
                message = self._outgoing.pop(0)
            if message == b"END":
                return
            yield message

    def send(self, message: bytes) -> None:
        """One more message, some time."""
        with self._changed:
            self._outgoing.append(message)
            self._changed.notify()

    def next_chunk(self) -> oracle_pb2.QueryChunk | None:
        """The next question; None at the stream's end."""
        try:
            for reply in self._call:
                response = oracle_pb2.ServeOracleResponse.FromString(reply)
                if response.HasField("queries"):
                    return response.queries
        except grpc.RpcError as error:
            self._target.note(error)
        return None

    def until_end(self) -> bool:
        """Answers nothing more and reads to the end; False when refused."""
        refused = self._target.refused
        while self.next_chunk() is not None:
            pass
        self.hang_up()
        return self._target.refused == refused

    def hang_up(self) -> None:
        """Goes without a word."""
        self.send(b"END")
        self._call.cancel()


ATTACKS: tuple[Callable[[Target], None], ...] = (
    random_messages,
    mutated_messages,
    wrong_order,
    leases,
    giant_shapes,
    half_open,
    floods,
    rapid_resets,
    unbounded_calls,
    packed_messages,
    unread_replies,
    endless_headers,
    half_messages,
    bad_headers,
    other_protocols,
    deaf_watchers,
    silent_watchers,
    made_and_cancelled,
)
