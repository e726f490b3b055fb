"""A proxy before a server that takes calls there, and breaks the connection in place of some replies."""

from __future__ import annotations

import contextlib
import socket
import threading

_HEADERS = 1  # the type of the frame of HTTP/2 that a reply begins with
_FRAME = 9  # bytes of what stands before each frame


class LossyProxy:
    """Passes connections on to `target`, "host:port", and every `every`th reply not: it is lost.

    A context manager. What was asked for has been done by then.
    """

    def __init__(self, target: str, every: int) -> None:
        self._target, self._every = target, every
        self._lock, self._replies = threading.Lock(), 0
        self._open: set[socket.socket] = set()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address = f"127.0.0.1:{self._listener.getsockname()[1]}"
        threading.Thread(target=self._accept, daemon=True).start()

    @property
    def lost(self) -> int:
        """How many replies have been."""
        return self._replies // self._every

    def __enter__(self) -> LossyProxy:
        return self

    def __exit__(self, *raised: object) -> None:
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        with self._lock:
            still = list(self._open)
        for end in still:
            _break(end)

    def _accept(self) -> None:
        host, _, port = self._target.rpartition(":")
        with contextlib.suppress(OSError):
            while True:
                client, _ = self._listener.accept()
                try:
                    server = socket.create_connection((host, int(port)))
                except OSError:
                    client.close()
                    continue
                with self._lock:
                    self._open |= {client, server}
                for carry in (self._carry_calls, self._carry_replies):
                    threading.Thread(target=carry, args=(client, server), daemon=True).start()

    def _carry_calls(self, client: socket.socket, server: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while data := client.recv(1 << 16):
                server.sendall(data)
        self._end(client, server)

    def _carry_replies(self, client: socket.socket, server: socket.socket) -> None:
        streams: set[bytes] = set()
        with contextlib.suppress(OSError), server.makefile("rb") as frames:
            while len(head := frames.read(_FRAME)) == _FRAME:
                frame = head + frames.read(int.from_bytes(head[:3], "big"))
                if head[3] == _HEADERS and head[5:] not in streams:
                    streams.add(head[5:])
                    if self._loses():
                        break
                client.sendall(frame)
        self._end(client, server)

    def _loses(self) -> bool:
        with self._lock:
            self._replies += 1
            return self._replies % self._every == 0

    def _end(self, *ends: socket.socket) -> None:
        with self._lock:
            self._open -= set(ends)
        for end in ends:
            _break(end)


def _break(end: socket.socket) -> None:
    with contextlib.suppress(OSError):
        end.shutdown(socket.SHUT_RDWR)
    end.close()
