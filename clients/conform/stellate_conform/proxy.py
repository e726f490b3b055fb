"""A way to the server that can be cut and frozen, as networks are."""

from __future__ import annotations

import contextlib
import socket
import threading
from typing import Callable

_BYTES = 1 << 16


class Proxy:
    """Listens at an address of its own, and forwards connections to a port of this machine."""

    def __init__(self, listen: str, port: int) -> None:
        """`listen`: "host:port". Raises: OSError, ValueError."""
        host, _, number = listen.rpartition(":")
        self._target = port
        self._bound = (host.strip("[]") or "127.0.0.1", int(number))
        self._sockets: set[socket.socket] = set()
        self._lock = threading.Lock()
        self._frozen: set[socket.socket] = set()
        self._listen()
        self._bound = self._listener.getsockname()[:2]

    @property
    def address(self) -> str:
        host, port = self._bound
        return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"

    def cut(self) -> None:
        """Nobody is there any more: connections break, and new ones are refused."""
        _close(self._listener)
        with self._lock:
            ends, self._sockets = self._sockets, set()
        for end in ends:
            _close(end)

    def cut_for(self, seconds: float) -> Callable[[], None]:
        """What cuts, and listens again so much later."""

        def cut() -> None:
            self.cut()
            threading.Timer(seconds, self._listen).start()

        return cut

    def freeze(self) -> None:
        """Whatever is connected now hears nothing more, and is not told so; new connections work."""
        with self._lock:
            self._frozen |= self._sockets

    def close(self) -> None:
        self.cut()

    def _listen(self) -> None:
        family = socket.AF_INET6 if ":" in self._bound[0] else socket.AF_INET
        self._listener = socket.create_server(self._bound, family=family)
        threading.Thread(target=self._accept, args=(self._listener,), daemon=True).start()

    def _accept(self, listener: socket.socket) -> None:
        while True:
            try:
                client, _ = listener.accept()
                server = socket.create_connection(("127.0.0.1", self._target))
            except OSError:
                return
            with self._lock:
                self._sockets |= {client, server}
            for source, sink in ((client, server), (server, client)):
                threading.Thread(target=self._forward, args=(source, sink), daemon=True).start()

    def _forward(self, source: socket.socket, sink: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(_BYTES):
                if sink not in self._frozen:
                    sink.sendall(data)
        for end in (source, sink):
            _close(end)
            with self._lock:
                self._sockets.discard(end)
                self._frozen.discard(end)


def _close(end: socket.socket) -> None:
    with contextlib.suppress(OSError):
        end.shutdown(socket.SHUT_RDWR)  # wakes whoever waits for it
    end.close()
