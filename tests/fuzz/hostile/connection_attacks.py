"""What strangers may do to connections: begin and stay, flood, reset, not read, break HTTP/2."""

from __future__ import annotations

import itertools
import struct
import time

import raw_http2 as raw
from stellate._generated import stellate_pb2
from strangers import ENDLESS, HALF, STRANGERS
from target import SERVICE, Target, hello

_RESETS = 30_000
_MANY_CALLS = 5000  # above --max-connection-streams


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
    tiny = raw.grpc_message(hello(mine)) + many * raw.grpc_message(b"")
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
        for path, body in (("WatchMesh", watch), ("ServeOracle", hello(mine))):
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
