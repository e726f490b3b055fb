"""docker/advisories.toml and docker/sbom: what is shipped, and what is known against it."""

from __future__ import annotations

import json
import os
import pathlib
import re
import socket
import subprocess
import sys
import tempfile
import time
import unittest
from typing import Any

import tomllib

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "fuzz" / "hostile"))

import raw_http2 as raw  # noqa: E402

ADVISORIES = ROOT / "docker" / "advisories.toml"
SBOM = str(ROOT / "docker" / "sbom")
_PATIENCE = 300.0  # seconds: for a hang, not for a measurement


def packages() -> list[dict[str, Any]]:
    """The list, by source package."""
    return tomllib.loads(ADVISORIES.read_text())["package"]


def installed() -> dict[str, list[tuple[str, str]]]:
    """Debian's packages of this machine, and their versions, by source package."""
    form = "${source:Package}\\t${source:Version}\\t${Package}\\n"
    lines = subprocess.run(
        ["dpkg-query", "-W", "-f", form], capture_output=True, text=True, check=True
    )
    found: dict[str, list[tuple[str, str]]] = {}
    for line in lines.stdout.splitlines():
        source, version, package = line.split("\t")
        found.setdefault(source, []).append((package, version))
    return found


def changelog(package: str) -> str:
    """What Debian says it changed; empty where it is not there."""
    for name in ("changelog.Debian.gz", "changelog.gz"):
        file = pathlib.Path("/usr/share/doc") / package / name
        if file.exists():
            return subprocess.run(
                ["zcat", file], capture_output=True, text=True, errors="replace"
            ).stdout
    return ""


class Advisories(unittest.TestCase):
    def test_the_versions_are_those_that_were_looked_at(self) -> None:
        """Except Debian's own updates of them, whose changelogs the next test but one reads."""
        there = installed()
        for entry in packages():
            for package, version in there.get(entry["source"], []):
                self.assertEqual(
                    version.partition("+deb12u")[0], entry["version"].partition("+deb12u")[0],
                    f"{package} has moved: see docker/advisories.toml for what to look at again",
                )  # fmt: skip
            self.assertIn(entry["source"], there, "nothing of it is shipped any more")

    def test_each_has_its_answer(self) -> None:
        seen = set()
        for entry in packages():
            for advisory in entry["advisory"]:
                with self.subTest(advisory["id"]):
                    self.assertRegex(advisory["id"], r"^CVE-\d{4}-\d{4,}$")
                    self.assertNotIn(advisory["id"], seen)
                    seen.add(advisory["id"])
                    self.assertEqual(advisory.keys(), {"id", "what", "answer", "shown"})
                    self.assertTrue(
                        all(len(text) > 20 for text in advisory.values() if " " in text)
                    )
                    self.assertTrue((ROOT / advisory["shown"]).exists(), advisory["shown"])

    def test_none_is_mended_already(self) -> None:
        there = installed()
        for entry in packages():
            for package, _ in there.get(entry["source"], []):
                mended = changelog(package)
                for advisory in entry["advisory"]:
                    self.assertNotIn(
                        advisory["id"], mended, f"{package} has mended it: take it out"
                    )

    def test_users_are_told(self) -> None:
        page = (ROOT / "docs" / "running" / "safety.md").read_text()
        for entry in packages():
            for advisory in entry["advisory"]:
                self.assertIn(advisory["id"], page)


class Abort(unittest.TestCase):
    """CVE-2023-1428: the library as shipped does not abort."""

    def test_headers_that_once_aborted(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            ready = pathlib.Path(folder) / "ready"
            server = subprocess.Popen(
                [os.environ["STELLATED"], "--listen=127.0.0.1:0", f"--ready-file={ready}", "--log-level=off"],
                stdout=subprocess.DEVNULL,
            )  # fmt: skip
            try:
                while not ready.exists():
                    self.assertIsNone(server.poll(), "it does not start")
                    time.sleep(0.01)
                address = ready.read_text().strip()
                for name, value in (("te", "x"), (":scheme", "x"), ("grpclb_client_stats", "x")):
                    for size in (9_000, 15_000, 70_000):
                        self.say(address, {name: value, "large": "a" * size})
                ask = [os.environ["STELLATED"], "--health-check", "--listen", address]
                self.assertEqual(subprocess.run(ask, timeout=_PATIENCE).returncode, 0)
            finally:
                server.terminate()
                self.assertEqual(server.wait(_PATIENCE), 0)

    def say(self, address: str, headers: dict[str, str]) -> None:
        """Begins a call with them, and waits for what comes of it."""
        host, port = address.rsplit(":", 1)
        block = raw.header_block("/stellate.v1.Stellate/GetMesh", headers)
        parts = [block[i : i + 16_000] for i in range(0, len(block), 16_000)]
        with socket.create_connection((host, int(port)), _PATIENCE) as connection:
            connection.sendall(raw.PREFACE + raw.frame(raw.SETTINGS, 0, 0, b""))
            try:
                for i, part in enumerate(parts):
                    last = 4 if i == len(parts) - 1 else 0  # END_HEADERS
                    kind = raw.CONTINUATION if i else raw.HEADERS
                    connection.sendall(raw.frame(kind, last, 1, part))
                connection.shutdown(socket.SHUT_WR)
                while connection.recv(65_536):
                    pass
            except OSError:
                pass  # hung up on


class Poison(unittest.TestCase):
    """CVE-2024-7246: the library as shipped keeps the headers of a connection apart.

    As behind a proxy that shares a connection among clients and writes their headers into one table.
    """

    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        ready = pathlib.Path(folder.name) / "ready"
        server = subprocess.Popen(
            [os.environ["STELLATED"], "--listen=127.0.0.1:0", f"--ready-file={ready}", "--log-level=off"],
            stdout=subprocess.DEVNULL,
        )  # fmt: skip
        self.addCleanup(server.wait)
        self.addCleanup(server.terminate)
        while not ready.exists():
            self.assertIsNone(server.poll(), "it does not start")
            time.sleep(0.01)
        host, port = ready.read_text().strip().rsplit(":", 1)
        self.address = (host, int(port))

    def test_a_refused_header_spoils_none_after_it(self) -> None:
        into_table, newest = b"\x40\1y\1v", b"\xbe"  # literal with indexing; what came last
        for refused in (b"\0\2te\1x", b"\0\7:scheme\1x", b"\0\7:method\1x"):
            with self.subTest(refused), self.connected() as connection:
                self.assertTrue(self.is_answered(connection, 1, into_table))
                self.assertTrue(self.is_answered(connection, 3, newest))
                self.assertFalse(self.is_answered(connection, 5, refused + into_table))
                self.assertTrue(self.is_answered(connection, 7, newest), "another call is spoilt")

    def test_a_refused_header_stays_refused_and_spoils_no_other_call(self) -> None:
        with self.connected() as connection:
            self.assertFalse(self.is_answered(connection, 1, b"\x40\2te\1x"))
            self.assertFalse(self.is_answered(connection, 3, b"\xbe"))
            self.assertTrue(self.is_answered(connection, 5, b""))

    def connected(self) -> socket.socket:
        """A connection that has said hello."""
        connection = socket.create_connection(self.address, _PATIENCE)
        connection.sendall(raw.PREFACE + raw.frame(raw.SETTINGS, 0, 0, b""))
        return connection

    def is_answered(self, connection: socket.socket, stream: int, headers: bytes) -> bool:
        """Whether a call with these headers after its own gets a message, not a refusal."""
        block = raw.header_block("/grpc.health.v1.Health/Check") + headers
        message = raw.frame(raw.DATA, raw.END_STREAM, stream, raw.grpc_message(b""))
        connection.sendall(raw.frame(raw.HEADERS, raw.END_HEADERS, stream, block) + message)
        answered = False
        while True:
            head = self.read(connection, 9)
            self.read(connection, int.from_bytes(head[:3], "big"))
            kind, flags = head[3], head[4]
            if int.from_bytes(head[5:], "big") != stream:
                continue
            answered |= kind == raw.DATA
            ends = kind in (raw.DATA, raw.HEADERS) and flags & raw.END_STREAM
            if ends or kind == raw.RST_STREAM:
                return answered

    def read(self, connection: socket.socket, size: int) -> bytes:
        """So many bytes."""
        got = b""
        while len(got) < size:
            more = connection.recv(size - len(got))
            self.assertTrue(more, "the server has hung up")
            got += more
        return got


class BillOfMaterials(unittest.TestCase):
    def setUp(self) -> None:
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.file = pathlib.Path(scratch.name) / "a file"
        self.file.write_text("content")
        listed = pathlib.Path(scratch.name) / "compiled-in"
        listed.write_text(self.run_it("--compiled-in", "libeigen3-dev", "libcli11-dev"))
        self.command = ["stellate", "1.2.3", "--compiled-in", str(listed), str(self.file)]
        self.text = self.run_it(*self.command)
        self.bill = json.loads(self.text)

    def run_it(self, *arguments: str) -> str:
        return subprocess.run([SBOM, *arguments], capture_output=True, text=True, check=True).stdout

    def test_it_is_cyclonedx(self) -> None:
        """The members that its schema demands, and their forms."""
        self.assertEqual((self.bill["bomFormat"], self.bill["specVersion"]), ("CycloneDX", "1.4"))
        self.assertEqual(self.bill["version"], 1)
        self.assertEqual(self.bill["metadata"]["component"]["name"], "stellate")
        self.assertEqual(self.bill["metadata"]["component"]["version"], "1.2.3")
        refs = [component["bom-ref"] for component in self.bill["components"]]
        self.assertEqual(len(refs), len(set(refs)))
        purl = re.compile(
            r"pkg:deb/debian/[a-z0-9.+%B-]+@[A-Za-z0-9.~%-]+\?arch=\w+&distro=debian-\d+"
        )
        for component in self.bill["components"]:
            if component["type"] == "library":
                self.assertRegex(component["purl"], purl)
                self.assertEqual({p["name"] for p in component["properties"]},
                                 {"stellate:source-package", "stellate:how"})  # fmt: skip

    def test_it_holds_what_dpkg_knows(self) -> None:
        form = "${db:Status-Status} ${Package} ${Version}\\n"
        known = subprocess.run(
            ["dpkg-query", "-W", "-f", form], capture_output=True, text=True
        ).stdout
        wanted = {
            tuple(line.split()[1:]) for line in known.splitlines() if line.startswith("installed ")
        }
        listed = {
            (c["name"], c["version"])
            for c in self.bill["components"]
            if c["bom-ref"].startswith("image:")
        }
        self.assertEqual(listed, wanted)
        compiled = {
            c["name"] for c in self.bill["components"] if c["bom-ref"].startswith("compiled-in:")
        }
        self.assertEqual(compiled, {"libeigen3-dev", "libcli11-dev"})
        (ours,) = (c for c in self.bill["components"] if c["type"] == "file")
        digest = subprocess.run(
            ["sha256sum", self.file], capture_output=True, text=True
        ).stdout.split()[0]
        self.assertEqual(ours["hashes"], [{"alg": "SHA-256", "content": digest}])
        self.assertEqual(self.run_it(*self.command), self.text, "the same twice")


if __name__ == "__main__":
    unittest.main()
