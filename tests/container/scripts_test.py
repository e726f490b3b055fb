"""docker/pin and docker/make-secrets: what they record and make, and what they refuse."""

from __future__ import annotations

import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

from kubernetes_objects import ROOT


class Pins(unittest.TestCase):
    """docker/pin, with a registry that says what it is told to."""

    def setUp(self) -> None:
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.folder = pathlib.Path(scratch.name)
        for name in ("pin", "images.txt"):
            shutil.copy(ROOT / "docker" / name, self.folder)

    def pin(self, *arguments: str, says: str = "") -> subprocess.CompletedProcess[str]:
        asked = self.folder / "skopeo"
        asked.write_text(f"#!/bin/sh\n{says}\n")
        asked.chmod(0o755)
        environment = {**os.environ, "PATH": f"{self.folder}:{os.environ['PATH']}"}
        return subprocess.run(
            [self.folder / "pin", *arguments], env=environment, capture_output=True, text=True
        )

    def test_it_records_what_the_registry_says(self) -> None:
        self.assertIn("nothing is pinned", self.pin("--check").stderr)
        done = self.pin(says="echo sha256:$(echo $4 | sha256sum | cut -d ' ' -f 1)")
        self.assertEqual(done.returncode, 0, done.stderr)
        lines = (self.folder / ".env").read_text().splitlines()
        self.assertEqual(self.pin("--check").returncode, 0)
        self.assertTrue(
            any(
                re.fullmatch(r"STELLATE_BASE=debian:bookworm-slim@sha256:[0-9a-f]{64}", x)
                for x in lines
            )
        )
        # Another tag is another image.
        text = (self.folder / "images.txt").read_text()
        (self.folder / "images.txt").write_text(text.replace("bookworm-slim", "trixie-slim"))
        self.assertIn("does not pin STELLATE_BASE", self.pin("--check").stderr)

    def test_it_invents_nothing(self) -> None:
        for says in ("exit 1", "echo sha256:abc", "echo"):
            done = self.pin(says=says)
            self.assertEqual(done.returncode, 1, says)
            self.assertFalse((self.folder / ".env").exists(), says)


def files_of(folder: pathlib.Path) -> dict[str, bytes]:
    """What `kubectl create secret generic --from-file` takes of a folder: its files, no folders."""
    return {file.name: file.read_bytes() for file in folder.iterdir() if file.is_file()}


def public_key(kind: str, *options: str, text: bytes) -> bytes:
    command = ["openssl", kind, *options]
    return subprocess.run(command, input=text, capture_output=True, check=True).stdout


class Secrets(unittest.TestCase):
    def test_what_is_there_is_kept_and_private(self) -> None:
        with tempfile.TemporaryDirectory() as scratch:
            folder = pathlib.Path(scratch) / "secrets"
            command = [ROOT / "docker/make-secrets", folder, "--name", "mesh.example.org", "ada"]
            subprocess.run(command, check=True, capture_output=True)
            before = files_of(folder)
            subprocess.run([*command, "ben"], check=True, capture_output=True)
            after = files_of(folder)
            self.assertEqual(after.keys() - before.keys(), {"ben.token"})
            self.assertEqual({n for n in before if before[n] != after[n]}, {"tokens"})
            self.assertEqual(folder.stat().st_mode & 0o077, 0, "nobody else gets into the folder")
            names = subprocess.run(
                ["openssl", "x509", "-in", folder / "proxy.pem", "-noout", "-ext", "subjectAltName"],
                capture_output=True, text=True,
            ).stdout  # fmt: skip
            self.assertIn("DNS:mesh.example.org", names)

    def test_what_goes_to_a_cluster_signs_nothing(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run([ROOT / "docker/make-secrets", folder], check=True, capture_output=True)
            files = files_of(pathlib.Path(folder))
            keys = {name: text for name, text in files.items() if b"PRIVATE KEY" in text}
            self.assertEqual(keys.keys(), {"server.key", "proxy.pem"})
            signs = public_key("x509", "-noout", "-pubkey", text=files["ca.pem"])
            self.assertNotIn(signs, [public_key("pkey", "-pubout", text=k) for k in keys.values()])


if __name__ == "__main__":
    unittest.main()
