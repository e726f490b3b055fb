"""Two servers behind HAProxy, with docker/haproxy.cfg: what happens when one of them dies.

Its mesh goes on from its directory once it is back, worker and watcher having waited through the
balancer; the other's does not notice. Both come out as they would have undisturbed, bit for bit.
"""

from __future__ import annotations

import logging
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from typing import Callable

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "clients" / "python"))

import stellate  # noqa: E402

OWNERS = {name: f"{name}-0123456789abcdef" for name in ("ada", "ben", "cleo", "dan", "eve", "flo")}
# Debian has it where only root's PATH leads.
HAPROXY = shutil.which("haproxy", path=os.environ.get("PATH", "") + ":/usr/sbin") or "haproxy"
PATIENCE = 100.0  # seconds: for a hang, not for a measurement
_EPSILON = 0.15


class Replica:
    """A server that can be killed and started again, on the same socket and directory."""

    def __init__(self, folder: pathlib.Path, name: str) -> None:
        self._folder, self._name = folder, name
        self.address = f"unix:{folder}/{name}"
        self.start()

    def start(self) -> None:
        """Returns once it listens."""
        ready = self._folder / f"{self._name}.ready"
        ready.unlink(missing_ok=True)
        command = [os.environ["STELLATED"], "--listen", self.address, "--ready-file", str(ready)]
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
        self.replicas = []
        for name in ("stellated-0", "stellated-1"):
            self.replicas.append(Replica(folder, name))
            self.addCleanup(self.replicas[-1].kill)
        self.front = f"unix:{folder}/front"
        # The configuration as it ships, but for where everybody is.
        text = (ROOT / "docker" / "haproxy.cfg").read_text()
        text, fronts = re.subn(r"bind 127\S+", f"bind unix@{folder}/front", text)
        text, servers = re.subn(
            r"(server (stellated-\d)) \S+", lambda m: f"{m[1]} unix@{folder}/{m[2]}", text
        )
        self.assertEqual((fronts, servers), (1, 2))
        (folder / "haproxy.cfg").write_text(text)
        self.haproxy = subprocess.Popen([HAPROXY, "-db", "-f", str(folder / "haproxy.cfg")])
        self.addCleanup(self.haproxy.wait, PATIENCE)
        self.addCleanup(self.haproxy.kill)
        while not (folder / "front").exists():
            self.assertIsNone(self.haproxy.poll(), "haproxy does not start")
            time.sleep(0.01)

    def client(self, owner: str, address: str | None = None) -> stellate.Client:
        """One owner's, closed in the end."""
        credentials = stellate.Credentials(token=OWNERS[owner])
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
