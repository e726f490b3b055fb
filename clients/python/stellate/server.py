"""A stellated of one's own: found, started, and stopped."""

from __future__ import annotations

import os
import pathlib
import shutil
import signal
import socket
import subprocess
import tempfile
import threading
import time

from ._stubs import source_tree
from .errors import ServerNotFound, Unavailable

__all__ = ["Server", "find_stellated"]

_READY_SECONDS = 30.0
_STOP_SECONDS = 10.0
_LONGEST_SOCKET_PATH = 100  # the kernel takes 107 bytes
BUNDLED = pathlib.Path(__file__).resolve().parent / "_bundled" / "stellated"  # packaging/wheel's
# When its client goes no client is left to finish a mesh for.
_OWN_FLAGS = ("--drain-seconds", "0")
# Over a unix socket the end of a client shows immediately. One that answers no pings is merely busy in
# an oracle that does not let go of the interpreter.
_PRIVATE_FLAGS = ("--keepalive", "600", "--keepalive-timeout", "600")


def find_stellated() -> str:
    """The server binary: $STELLATED, else the wheel's, else the source tree's build/*/bin, else PATH.

    Raises: ServerNotFound with where it was looked for.
    """
    named = os.environ.get("STELLATED")
    if named:
        path = shutil.which(named)
        if path is None:
            raise ServerNotFound(f"$STELLATED is {named!r}, which is not a program that can be run")
        return path
    if os.access(BUNDLED, os.X_OK):
        return str(BUNDLED)
    built, tree = [], source_tree()
    if tree is not None:
        candidates = tree.glob("build/*/bin/stellated")
        built = [p for p in candidates if os.access(p, os.X_OK)]
    if built:
        # The release build before others, then the newest.
        return str(max(built, key=lambda p: (p.parts[-3] == "release", p.stat().st_mtime)))
    path = shutil.which("stellated")
    if path is None:
        raise ServerNotFound(
            "no server was given and no stellated found to start: pass server='host:port', or set "
            "$STELLATED to the binary, or put it on PATH, or build it (clients/quickstart does), or "
            "install the wheel that carries one (packaging/wheel makes it)"
        )
    return path


def _machines_name() -> str:
    """This machine's name, or, where no name server knows that, its address on the way out."""
    name = socket.gethostname()
    try:
        socket.getaddrinfo(name, None)
        return name
    except OSError:
        pass
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # for documentation alone: nothing is sent
        except OSError:
            return "127.0.0.1"
        return str(probe.getsockname()[0])


def _from_elsewhere(address: str) -> str:
    """The address that another machine uses for one that is listened on."""
    host, _, port = address.rpartition(":")
    return f"{_machines_name()}:{port}" if host in ("0.0.0.0", "[::]") else address


class Server:
    """A stellated of this process's own, for as many meshes as one likes. A context manager.

        with stellate.Server() as server:
            mesh = stellate.mesh(oracle, server=server)

    It listens on a unix socket in a directory that only this user may enter, or, with `listen`, for
    workers on other machines too. It ends with this process whatever happens to it.

    Attributes:
      address: where clients reach it, "unix:/path" or "host:port".
    """

    def __init__(
        self,
        *arguments: str,
        binary: str | None = None,
        listen: str | None = None,
        token_file: str | os.PathLike[str] | None = None,
        tls_cert: str | os.PathLike[str] | None = None,
        tls_key: str | os.PathLike[str] | None = None,
        tls_client_ca: str | os.PathLike[str] | None = None,
        insecure_listen: bool = False,
    ) -> None:
        """Starts it, and returns when it listens.

        Args:
          *arguments: more flags for stellated, e.g. "--data-dir", "meshes".
          binary: the program; see find_stellated.
          listen: "host:port" to be reached at; port 0 takes a free one. With "0.0.0.0:port" or
            "[::]:port" it listens on every address, and `address` has this machine's name.
          token_file: lines "OWNER TOKEN"; clients must send one of the tokens.
          tls_cert, tls_key: PEM files; the certificate has to bear the name in `address`.
          tls_client_ca: PEM file; clients must show a certificate of these authorities.
          insecure_listen: take plain text from any other machine: for a network
            where all that can connect may. Without it, and without TLS, such a `listen` is refused.

        Raises: ServerNotFound; Unavailable with the server's words if it does not start.
        """
        self._binary = binary or find_stellated()
        self._directory = tempfile.mkdtemp(prefix="stellate-")
        if len(self._directory) + len("/socket") > _LONGEST_SOCKET_PATH:
            os.rmdir(self._directory)
            self._directory = tempfile.mkdtemp(prefix="stellate-", dir="/tmp")
        self._log = os.path.join(self._directory, "log")
        self.private = listen is None
        self.address = listen or f"unix:{os.path.join(self._directory, 'socket')}"
        self._process: subprocess.Popen[bytes] | None = None
        self._start_error: OSError | None = None
        started = threading.Event()
        ready = os.path.join(self._directory, "ready")
        command = [self._binary, "--listen", self.address, "--ready-file", ready, *_OWN_FLAGS]
        command += _PRIVATE_FLAGS if self.private else ()
        files = {
            "--token-file": token_file,
            "--tls-cert": tls_cert,
            "--tls-key": tls_key,
            "--tls-client-ca": tls_client_ca,
        }
        for flag, path in files.items():
            command += [] if path is None else [flag, os.fspath(path)]
        command += ["--insecure-listen"] if insecure_listen else []
        command += arguments
        # On Linux the kernel ends the server when the thread that started it ends: a thread of its
        # own stays for as long as the server runs.
        tie = shutil.which("setpriv")
        if tie is not None:
            command = [tie, "--pdeathsig", "TERM", *command]
        self._keeper = threading.Thread(
            target=self._keep, args=(command, started), name="stellated", daemon=True
        )
        self._keeper.start()
        started.wait()
        try:
            if self._start_error is not None:
                raise ServerNotFound(f"cannot start {self._binary}: {self._start_error}")
            self._wait_for(ready)
            if not self.private:
                self.address = _from_elsewhere(pathlib.Path(ready).read_text().strip())
        except BaseException:
            self.close()
            raise

    def _keep(self, command: list[str], started: threading.Event) -> None:
        try:
            with open(self._log, "wb") as log:
                # A session of its own: Ctrl-C is for the client, which cancels its meshes first.
                self._process = subprocess.Popen(
                    command,
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=subprocess.STDOUT,
                    start_new_session=True,
                )
        except OSError as error:
            self._start_error = error
            return
        finally:
            started.set()
        self._process.wait()

    def _wait_for(self, ready: str) -> None:
        deadline = time.monotonic() + _READY_SECONDS
        while not os.path.exists(ready):
            if not self.alive:
                raise self.why_gone()
            if time.monotonic() > deadline:
                raise Unavailable(f"{self._binary} did not listen within {_READY_SECONDS:.0f} s")
            time.sleep(0.005)

    @property
    def alive(self) -> bool:
        """Whether the process runs."""
        return self._process is not None and self._keeper.is_alive()

    def why_gone(self) -> Unavailable:
        """An error with the last words of a server that is no more."""
        try:
            words = pathlib.Path(self._log).read_text(errors="replace")[-2000:].strip()
        except OSError:
            words = ""
        status = self._process.returncode if self._process is not None else None
        return Unavailable(
            f"{self._binary} ended with status {status}" + (f":\n{words}" if words else ""),
            "SERVER_GONE",
        )

    def close(self, *, kill: bool = False) -> None:
        """Stops the server and removes its directory. May be called again.

        `kill`: without asking it to stop; what it has recorded stays.
        """
        try:
            if self._process is not None and self._keeper.is_alive() and not kill:
                self._process.send_signal(signal.SIGTERM)
                self._keeper.join(_STOP_SECONDS)
        finally:  # also when that was interrupted
            if self._process is not None and self._keeper.is_alive():
                self._process.kill()
            self._keeper.join()
            shutil.rmtree(self._directory, ignore_errors=True)

    def __enter__(self) -> Server:
        return self

    def __exit__(self, *raised: object) -> None:
        self.close()
