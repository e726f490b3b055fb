"""Two servers behind HAProxy, with docker/kubernetes/haproxy.cfg, over TLS all the way.

When one of them dies, its mesh goes on from its directory once it is back, worker and watcher having
waited through the balancer; the other's does not notice. Both come out as they would have
undisturbed, bit for bit. What strangers throw at the balancer the servers do not feel.
"""

from __future__ import annotations

import logging
import os
import pathlib
import re
import shutil
import socket
import ssl
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from typing import Callable

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "clients" / "python"), str(ROOT / "tests" / "fuzz" / "hostile")]

import raw_http2 as raw  # noqa: E402
import stellate  # noqa: E402

OWNERS = {name: f"{name}-0123456789abcdef" for name in ("ada", "ben", "cleo", "dan", "eve", "flo")}
# Debian has it where only root's PATH leads.
HAPROXY = shutil.which("haproxy", path=os.environ.get("PATH", "") + ":/usr/sbin") or "haproxy"
PATIENCE = 100.0  # seconds: for a hang, not for a measurement
_EPSILON = 0.15


def free_port() -> int:
    """One that nobody has now."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


class Replica:
    """A server that can be killed and started again, on the same port and directory."""

    def __init__(self, folder: pathlib.Path, name: str) -> None:
        self._folder, self._name = folder, name
        self.address = f"localhost:{free_port()}"
        self.start()

    def start(self) -> None:
        """Returns once it listens."""
        ready = self._folder / f"{self._name}.ready"
        ready.unlink(missing_ok=True)
        command = [os.environ["STELLATED"], "--listen", self.address, "--ready-file", str(ready)]
        command += ["--tls-cert", str(self._folder / "secrets/server.pem")]
        command += ["--tls-key", str(self._folder / "secrets/server.key")]
        command += ["--data-dir", str(self._folder / f"{self._name}.data"), "--log-level", "error"]
        command += ["--token-file", str(self._folder / "tokens")]
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        while not ready.exists():
            if self._process.poll() is not None:
                raise SystemError("a server does not start")
            time.sleep(0.01)

    def kill(self) -> None:
        """As a lost node: without a word."""
        self._process.kill()
        self._process.wait(PATIENCE)


class Disturbed(stellate.manifolds.Torus):
    """A torus at whose fifth batch something happens: the mesh is under way, and far from done."""

    def __init__(self, happens: Callable[[], None]) -> None:
        super().__init__()
        self._happens, self._batches = happens, 0

    def closest_point(self, points):
        self._batches += 1
        if self._batches == 5:
            self._happens()
        return super().closest_point(points)


class Made(threading.Thread):
    """A mesh made through the balancer, in a thread: its one worker, and its watcher."""

    def __init__(self, client: stellate.Client, happens: Callable[[], None]) -> None:
        super().__init__(daemon=True)
        self._client, self._oracle = client, Disturbed(happens)
        self.mesh: stellate.Mesh | None = None
        self.error: Exception | None = None

    def run(self) -> None:
        try:
            self.mesh = stellate.mesh(self._oracle, _EPSILON, server=self._client)
        except Exception as error:  # shown by who waits for it
            self.error = error


class Balancer(unittest.TestCase):
    def setUp(self) -> None:
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        folder = pathlib.Path(scratch.name)
        tokens = folder / "tokens"
        tokens.write_text("".join(f"{owner} {token}\n" for owner, token in OWNERS.items()))
        tokens.chmod(0o600)
        subprocess.run([ROOT / "docker/make-secrets", folder / "secrets"], check=True)
        self.ca = str(folder / "secrets/ca.pem")
        self.replicas: list[Replica] = []
        for name in ("stellated-0", "stellated-1"):
            self.replicas.append(Replica(folder, name))
            self.addCleanup(self.replicas[-1].kill)
        self.port = free_port()
        self.front = f"localhost:{self.port}"
        # The configuration as it ships, except where it listens and finds its certificates. Where
        # the machine has no name server, the names of servers are not asked for again.
        text = (ROOT / "docker/kubernetes/haproxy.cfg").read_text()
        text, fronts = re.subn(r"bind :7717 ", f"bind 127.0.0.1:{self.port} ", text)
        self.assertEqual(fronts, 1)
        text = text.replace("/etc/stellate", str(folder / "secrets"))
        (folder / "haproxy.cfg").write_text(text)
        environment = {f"STELLATED_{i}": r.address for i, r in enumerate(self.replicas)}
        command = [HAPROXY, "-db", "-f", str(folder / "haproxy.cfg")]
        checked = subprocess.run([*command, "-c"], env=environment, capture_output=True, text=True)
        self.assertEqual(checked.returncode, 0, checked.stdout + checked.stderr)
        self.assertNotIn("WARNING", checked.stderr)
        self.haproxy = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL)
        self.addCleanup(self.haproxy.wait, PATIENCE)
        self.addCleanup(self.haproxy.kill)
        while True:
            self.assertIsNone(self.haproxy.poll(), "haproxy does not start")
            try:
                socket.create_connection(("127.0.0.1", self.port), PATIENCE).close()
                break
            except OSError:
                time.sleep(0.01)

    def client(self, owner: str, address: str | None = None) -> stellate.Client:
        """One owner's, closed in the end."""
        credentials = stellate.Credentials(token=OWNERS[owner], ca=self.ca)
        client = stellate.Client(address or self.front, credentials, reconnect_seconds=PATIENCE)
        self.addCleanup(client.close)
        return client

    def owner_on(self, replica: Replica) -> str:
        """Somebody whose meshes the balancer sends there."""
        for owner in OWNERS:
            info = self.client(owner).create(stellate.manifolds.Sphere(), 0.5)
            there = [mesh.name for mesh in self.client(owner, replica.address).list()]
            self.client(owner).delete(info.name, wait=False)
            if info.name in there:
                return owner
        raise AssertionError("the balancer sends everybody to one server")

    def connect(self) -> ssl.SSLSocket:
        """A stranger's connection, greeted."""
        context = ssl.create_default_context(cafile=self.ca)
        context.set_alpn_protocols(["h2"])
        plain = socket.create_connection(("127.0.0.1", self.port), PATIENCE)
        connection = context.wrap_socket(plain, server_hostname="localhost")
        self.addCleanup(connection.close)
        connection.sendall(raw.PREFACE + raw.frame(raw.SETTINGS, 0, 0, b""))
        return connection

    def listen(self, connection: ssl.SSLSocket) -> bytes:
        """All that the balancer says until it hangs up, or has no more to say."""
        said = b""
        try:
            while part := connection.recv(65_536):
                said += part
        except OSError:
            pass
        return said

    def test_strangers_do_not_get_through(self) -> None:
        """Storms of resets, endless and slow headers, headers that end a shared connection."""
        friend = self.client("ada")
        worker = Made(friend, lambda: None)
        worker.start()
        storms = [self.connect() for _ in range(3)]
        block = raw.header_block("/stellate.v1.Stellate/GetMesh", {"authorization": "Bearer x"})
        for connection in storms:
            for stream in range(1, 4001, 2):
                call = raw.frame(raw.HEADERS, 4, stream, block)
                call += raw.frame(raw.RST_STREAM, 0, stream, b"\0\0\0\x08")
                try:
                    connection.sendall(call)
                except OSError:
                    break  # hung up on
        for first in (b"\0\1x" + b"\x7f" + b"\x81\xff\xff\xff\x03", b"\0\x7f"):
            endless = self.connect()
            try:
                endless.sendall(raw.frame(raw.HEADERS, 0, 1, first))
                while True:
                    endless.sendall(raw.frame(raw.CONTINUATION, 0, 1, bytes(16_000)))
            except OSError:
                pass  # hung up on: without that this would not end
        slow = [self.connect() for _ in range(50)]
        for connection in slow:
            connection.sendall(raw.frame(raw.HEADERS, 0, 1, block[:20]))
        for headers in ({"x-bin": "no base64!"}, {"large": "a" * 6000}, {"te": "x"}):
            for _ in range(5):
                with self.subTest(headers=list(headers)):
                    rude = self.connect()
                    rude.sendall(
                        raw.frame(
                            raw.HEADERS,
                            5,
                            1,
                            raw.header_block("/stellate.v1.Stellate/GetServerInfo", headers),
                        )
                    )
                    rude.settimeout(1)
                    self.listen(rude)
                    self.assertTrue(friend.info().version)
        worker.join(PATIENCE)
        self.assertIsNotNone(worker.mesh, worker.error)
        self.assertTrue(worker.mesh.certified)
        self.assertTrue(friend.info().version)

    def test_a_server_dies_and_comes_back(self) -> None:
        doomed, other = self.replicas
        mine, theirs = self.owner_on(doomed), self.owner_on(other)
        expected = stellate.mesh(
            stellate.manifolds.Torus(), _EPSILON, server=self.client(theirs, other.address)
        )
        dead = threading.Event()

        def die() -> None:
            doomed.kill()
            dead.set()

        beside = Made(self.client(theirs), lambda: self.assertTrue(dead.wait(PATIENCE)))
        beside.start()
        with self.assertLogs("stellate", logging.WARNING) as log:
            cut_off = Made(self.client(mine), die)
            cut_off.start()
            self.assertTrue(dead.wait(PATIENCE))
            beside.join(PATIENCE)  # while the server is away
            self.assertTrue(cut_off.is_alive(), cut_off.error)
            with self.assertRaises(stellate.Unavailable):
                self.client(mine).create(stellate.manifolds.Sphere(), 0.5)
            doomed.start()
            cut_off.join(PATIENCE)
        self.assertIn("lost the server", "\n".join(log.output))
        self.assertIn("the server is back", "\n".join(log.output))
        for made in (beside, cut_off):
            self.assertIsNotNone(made.mesh, made.error)
            self.assertTrue(made.mesh.certified)
            self.assertEqual(made.mesh.points.tobytes(), expected.points.tobytes())
            self.assertEqual(made.mesh.simplices.tobytes(), expected.simplices.tobytes())


if __name__ == "__main__":
    unittest.main()
