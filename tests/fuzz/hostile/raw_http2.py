"""HTTP/2 by hand, as no library would let one send it."""

from __future__ import annotations

import select
import socket
import struct

PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
DATA, HEADERS, PRIORITY, RST_STREAM, SETTINGS, PUSH, PING, GOAWAY, WINDOW, CONTINUATION = range(10)
END_STREAM, END_HEADERS = 0x1, 0x4
_GATHER = 60.0  # seconds that a server may take to say anything
_STUCK = 0.5  # seconds without a byte taken: the server waits for us to read


def grpc_message(body: bytes, declared: int | None = None, compressed: int = 0) -> bytes:
    """A message of gRPC with its length before it, or with another length."""
    return struct.pack(">BI", compressed, len(body) if declared is None else declared) + body


def frame(kind: int, flags: int, stream: int, payload: bytes = b"") -> bytes:
    """A frame of HTTP/2."""
    return struct.pack(">I", len(payload))[1:] + struct.pack(">BBI", kind, flags, stream) + payload


def _hpack_string(text: bytes) -> bytes:
    if len(text) < 127:
        return bytes([len(text)]) + text
    rest, out = len(text) - 127, bytearray([127])
    while rest >= 128:
        out.append(rest % 128 | 128)
        rest //= 128
    out.append(rest)
    return bytes(out) + text


def header_block(path: str, extra: dict[str, str] | None = None) -> bytes:
    """The headers of a call, none of them indexed."""
    fields = {
        ":method": "POST",
        ":scheme": "http",
        ":path": path,
        ":authority": "localhost",
        "content-type": "application/grpc",
        "te": "trailers",
        **(extra or {}),
    }
    return b"".join(
        b"\0" + _hpack_string(name.encode()) + _hpack_string(value.encode())
        for name, value in fields.items()
    )


class Connection:
    """A connection on which anything may be said. What the server sends is read and dropped."""

    def __init__(self, host: str, port: int, settings: bytes = b"") -> None:
        self._socket = socket.create_connection((host, port), _GATHER)
        self.closed = False  # by the server
        self._settings = settings

    def greet(self) -> None:
        """What every connection begins with."""
        self.send(PREFACE + frame(SETTINGS, 0, 0, self._settings))

    def send(self, data: bytes) -> None:
        """Sends all, unless the server has had enough."""
        view = memoryview(data)
        while view and not self.closed:
            readable, writable, _ = select.select([self._socket], [self._socket], [], _GATHER)
            if readable:
                self._read()
            elif writable:
                try:
                    view = view[self._socket.send(view) :]
                except OSError:
                    self.closed = True
            else:
                raise TimeoutError("the server neither reads nor writes")

    def send_unread(self, data: bytes) -> None:
        """Sends and reads nothing, until the server takes no more."""
        view = memoryview(data)
        while view and not self.closed:
            if not select.select([], [self._socket], [], _STUCK)[1]:
                return
            try:
                view = view[self._socket.send(view) :]
            except OSError:
                self.closed = True

    def open(self, stream: int, path: str, extra: dict[str, str] | None = None) -> None:
        """Begins a call."""
        self.send(frame(HEADERS, END_HEADERS, stream, header_block(path, extra)))

    def data(self, stream: int, payload: bytes, flags: int = 0) -> None:
        """A part of a call's messages."""
        self.send(frame(DATA, flags, stream, payload))

    def until_closed(self) -> None:
        """Reads until the server hangs up, as it has to after what it was sent."""
        while not self.closed:
            if not select.select([self._socket], [], [], _GATHER)[0]:
                raise TimeoutError("the server keeps a connection that it should close")
            self._read()

    def close(self) -> None:
        """Hangs up."""
        self._socket.close()

    def _read(self) -> None:
        try:
            self.closed = not self._socket.recv(1 << 16)
        except OSError:
            self.closed = True
