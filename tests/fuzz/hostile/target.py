"""A server that strangers try: its calls, its streams, and what must not come through."""

from __future__ import annotations

import collections
import dataclasses
import random
import threading
from collections.abc import Iterator
from typing import Any

import grpc
import raw_http2 as raw
import stellate
from stellate._generated import mesh_pb2, oracle_pb2, stellate_pb2
from stellate._wire.spec import mesh_spec
from stellate.oracle import CheckedOracle

SERVICE = "/stellate.v1.Stellate/"
UNARY = ("CreateMesh", "GetMesh", "ListMeshes", "CancelMesh", "DeleteMesh", "GetServerInfo")
DEADLINE = 60.0  # a call that takes longer hangs


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
            reply = self.channel.unary_unary(SERVICE + rpc)(body, timeout=DEADLINE)
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
            raise TimeoutError(f"no answer within {DEADLINE:.0f} s")

    def stream(self, rpc: str, bodies: list[bytes], take: int = 1000) -> bool:
        """Sends some messages on a stream and takes at most `take` answers. False: refused."""
        call = self.channel.stream_stream(SERVICE + rpc)(iter(bodies), timeout=DEADLINE)
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
        reply = self.unary("CreateMesh", create_request(spec))
        return "" if reply is None else mesh_pb2.Mesh.FromString(reply).name

    def delete(self, name: str) -> None:
        """Forgets it."""
        self.unary("DeleteMesh", stellate_pb2.DeleteMeshRequest(name=name).SerializeToString())


def create_request(spec: mesh_pb2.MeshSpec) -> bytes:
    return stellate_pb2.CreateMeshRequest(spec=spec).SerializeToString()


def hello(mesh: str) -> bytes:
    hello = oracle_pb2.Hello(mesh=mesh, worker="stranger", max_chunk_queries=7)
    return oracle_pb2.ServeOracleRequest(hello=hello).SerializeToString()


class Worker:
    """A worker's stream, message by message."""

    def __init__(self, target: Target, mesh: str) -> None:
        self._target = target
        self._outgoing: list[bytes] = [hello(mesh)]
        self._changed = threading.Condition()
        self._call: Any = target.channel.stream_stream(SERVICE + "ServeOracle")(
            self._requests(), timeout=DEADLINE
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
