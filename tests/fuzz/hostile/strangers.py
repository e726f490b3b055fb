"""Strangers that hold on: each function is one stranger, until `end` (seconds since the epoch)."""

from __future__ import annotations

import itertools
import math
import select
import socket
import struct
import time
from collections.abc import Iterator
from typing import Callable

import raw_http2 as raw

Stranger = Callable[[str, int, float, float], None]  # host, port, end, megabits a second
SERVICE = "/stellate.v1.Stellate/"
_FRAME = 16_384  # bytes of the largest frame that a client may send unasked
_MESSAGE = 4 << 20  # --max-message-bytes


def endless_string() -> Iterator[bytes]:
    """The frames of a block whose first header is a string of a gigabyte."""
    length = b"\0\1x" + b"\x7f" + b"\x81\xff\xff\xff\x03"
    yield raw.frame(raw.HEADERS, 0, 1, length)
    yield from itertools.repeat(raw.frame(raw.CONTINUATION, 0, 1, bytes(_FRAME)))


def endless_headers() -> Iterator[bytes]:
    """The frames of a block of small headers, without end."""
    one = b"\0\1a\1b"
    yield raw.frame(raw.HEADERS, 0, 1, one)
    yield from itertools.repeat(raw.frame(raw.CONTINUATION, 0, 1, (_FRAME // 50) * one))


def endless_frames() -> Iterator[bytes]:
    """A string of a gigabyte, a byte to a frame."""
    yield raw.frame(raw.HEADERS, 0, 1, b"\0\1x" + b"\x7f" + b"\x81\xff\xff\xff\x03")
    yield from itertools.repeat(1000 * raw.frame(raw.CONTINUATION, 0, 1, b"y"))


def endless_number() -> Iterator[bytes]:
    """The length of a string, with zeros before it without end."""
    yield raw.frame(raw.HEADERS, 0, 1, b"\0\x7f")
    yield from itertools.repeat(raw.frame(raw.CONTINUATION, 0, 1, b"\x80" * _FRAME))


def _say(
    host: str, port: int, end: float, mbit: float, words: Callable[[], Iterator[bytes]]
) -> None:
    """Says them at that rate; hung up on, again from the start."""
    while time.time() < end:
        try:
            connection = raw.Connection(host, port)
        except OSError:
            time.sleep(0.01)
            continue
        begin, sent = time.monotonic(), 0
        connection.greet()
        for part in words():
            if connection.closed or time.time() > end:
                break
            connection.send(part)
            sent += len(part)
            if mbit:
                time.sleep(max(0.0, begin + sent * 8e-6 / mbit - time.monotonic()))
        connection.close()


def _saying(words: Callable[[], Iterator[bytes]]) -> Stranger:
    return lambda host, port, end, mbit: _say(host, port, end, mbit, words)


class _Holder:
    """A connection on which calls are begun whose messages never end, within the server's windows."""

    def __init__(self, host: str, port: int, path: str, calls: int, end: float) -> None:
        self._socket = socket.create_connection((host, port), 10.0)
        self._header = raw.header_block(path)
        self._calls = calls
        self._end = end
        self._stream = 1
        self._initial = self._window = 65_535  # of a new call; of the connection
        self._open: dict[int, list[int]] = {}  # of each call: its window, and what is to be sent
        self._read = b""
        self._out = bytearray(raw.PREFACE + raw.frame(raw.SETTINGS, 0, 0))
        self.sent = 0

    def hold(self) -> None:
        """Holds what the server lets it hold, until the end or until it is hung up on."""
        with self._socket:
            self._socket.setblocking(False)
            while (left := self._end - time.time()) > 0:
                self._fill()
                wanted = [self._socket] if self._out else []
                readable, writable, _ = select.select([self._socket], wanted, [], min(left, 0.5))
                try:
                    if writable:
                        del self._out[: self._socket.send(self._out)]
                    if readable:
                        data = self._socket.recv(1 << 16)
                        if not data:
                            return
                        self._take(data)
                except BlockingIOError:
                    continue

    def _fill(self) -> None:
        while len(self._open) < self._calls and len(self._out) < _FRAME:
            self._out += raw.frame(raw.HEADERS, raw.END_HEADERS, self._stream, self._header)
            self._open[self._stream] = [self._initial, _MESSAGE - 1 + 5]
            self._stream += 2
        for stream, call in self._open.items():
            if len(self._out) > 64 * _FRAME:
                return
            while (size := min(self._window, *call, _FRAME)) > 0:
                whole = call[1] == _MESSAGE - 1 + 5
                size = max(size, 5) if whole else size
                body = (raw.grpc_message(b"", _MESSAGE) if whole else b"") + bytes(size)
                self._out += raw.frame(raw.DATA, 0, stream, body[:size])
                self._window -= size
                call[0] -= size
                call[1] -= size
                self.sent += size

    def _take(self, data: bytes) -> None:
        self._read += data
        at = 0
        while len(self._read) - at >= 9:
            size = int.from_bytes(self._read[at : at + 3], "big")
            if len(self._read) - at < 9 + size:
                break
            kind, flags, stream = struct.unpack(">BBI", self._read[at + 3 : at + 9])
            self._hear(kind, flags, stream, self._read[at + 9 : at + 9 + size])
            at += 9 + size
        self._read = self._read[at:]

    def _hear(self, kind: int, flags: int, stream: int, payload: bytes) -> None:
        if kind == raw.SETTINGS and not flags & 1:
            for number, value in struct.iter_unpack(">HI", payload):
                if number == 4:  # SETTINGS_INITIAL_WINDOW_SIZE
                    for call in self._open.values():
                        call[0] += value - self._initial
                    self._initial = value
            self._out += raw.frame(raw.SETTINGS, 1, 0)
        elif kind == raw.PING and not flags & 1:
            self._out += raw.frame(raw.PING, 1, 0, payload)
        elif kind == raw.WINDOW and stream == 0:
            self._window += int.from_bytes(payload, "big")
        elif kind == raw.WINDOW and stream in self._open:
            self._open[stream][0] += int.from_bytes(payload, "big")
        elif kind == raw.RST_STREAM or (kind == raw.HEADERS and flags & raw.END_STREAM):
            self._open.pop(stream, None)  # another comes in its place


def _hold(path: str, calls: int, seconds: float) -> Stranger:
    """Holds that many calls of an rpc for that long, hangs up and comes again."""

    def stranger(host: str, port: int, end: float, _: float) -> None:
        while time.time() < end:
            try:
                _Holder(host, port, path, calls, min(end, time.time() + seconds)).hold()
            except OSError:
                time.sleep(0.01)

    return stranger


ENDLESS = (endless_string, endless_headers, endless_frames, endless_number)  # header blocks

HALF = {  # calls, and how many on a connection
    "half_requests": (SERVICE + "CreateMesh", 300),
    "half_watches": (SERVICE + "WatchMesh", 300),
    "half_work": (SERVICE + "ServeOracle", 300),
    "half_probes": ("/grpc.health.v1.Health/Check", 300),
    "half_reflections": ("/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", 300),
    "half_nothing": (SERVICE + "Nothing", 300),
    "few_half_requests": (SERVICE + "CreateMesh", 3),
    "one_half_request": (SERVICE + "CreateMesh", 1),
}

STRANGERS: dict[str, Stranger] = {
    **{words.__name__: _saying(words) for words in ENDLESS},
    **{kind: _hold(path, calls, math.inf) for kind, (path, calls) in HALF.items()},
    "half_requests_again": _hold(SERVICE + "CreateMesh", 300, 5.0),
}
