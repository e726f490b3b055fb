"""The gem, the npm package and the crate: each built, installed from its file into an empty place with
nothing of the source tree within reach, and the first example of its README run there."""

from __future__ import annotations

import os
import pathlib
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
VERSION = (ROOT / "VERSION").read_text().strip()
STELLATED = os.environ["STELLATED"]


def first_block(client: str) -> str:
    """The first block of code of a client's README."""
    text = (ROOT / "clients" / client / "README.md").read_text()
    found = re.search(r"(?ms)^```\w+\n(.*?)^```", text)
    assert found is not None
    return found[1]


class Installed(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory(prefix="stellate-install-test-")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.place = self.folder / "place"
        self.place.mkdir()

    def run_in(self, *command: str | pathlib.Path, **environment: str) -> str:
        """What a command prints in the empty place, which knows where a server is."""
        kept = re.compile(
            r"HOME|PATH|CARGO_\w+|RUSTUP_\w+|npm_config_\w+|https?_proxy|\w+_CA_\w+|SSL_\w+", re.I
        )
        known = {name: value for name, value in os.environ.items() if kept.fullmatch(name)}
        done = subprocess.run(
            command, cwd=self.place, capture_output=True, text=True,
            env={**known, "STELLATED": STELLATED, **environment},
        )  # fmt: skip
        said = done.stdout + done.stderr
        self.assertEqual(done.returncode, 0, f"{command}\n{said[-4000:]}")
        return said

    def built(self, name: str, tool: str) -> pathlib.Path:
        """The package's file."""
        if shutil.which(tool) is None:
            self.skipTest(f"there is no {tool} here")
        made = self.folder / "made"
        done = subprocess.run(
            [ROOT / "packaging" / "publish", "--folder", made, name], capture_output=True, text=True
        )
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn(f"{name}: would run: ", done.stdout)
        (file,) = made.iterdir()
        return file

    def holds_a_mesh(self) -> None:
        lines = (self.place / "torus.obj").read_text().splitlines()
        vertices, faces = (sum(line.startswith(kind) for line in lines) for kind in ("v ", "f "))
        self.assertEqual(faces, 2 * vertices)
        self.assertGreater(vertices, 500)

    def test_gem(self) -> None:
        file, gems = self.built("gem", "gem"), self.folder / "gems"
        self.run_in("gem", "install", "--local", "--no-document", "--ignore-dependencies",
                    "--install-dir", gems, file)  # fmt: skip
        known = self.run_in("gem", "environment", "gempath").strip()
        (self.place / "torus.rb").write_text(first_block("ruby"))
        self.run_in("ruby", "torus.rb", GEM_PATH=f"{gems}:{known}")
        self.holds_a_mesh()

    def test_npm(self) -> None:
        file = self.built("npm", "npm")
        (self.place / "package.json").write_text('{"private": true, "type": "module"}')
        self.run_in("npm", "install", "--no-audit", "--no-fund", "--silent", file)
        (self.place / "torus.mjs").write_text(first_block("node"))
        self.run_in("node", "torus.mjs")
        self.holds_a_mesh()

    def test_crate(self) -> None:
        file = self.built("crate", "cargo")
        with tarfile.open(file) as archive:
            archive.extractall(self.folder)
        package = self.folder / f"stellate-{VERSION}"
        (self.place / "src").mkdir()
        (self.place / "src" / "main.rs").write_text(first_block("rust"))
        (self.place / "Cargo.toml").write_text(
            f'[package]\nname = "user"\nversion = "1.0.0"\nedition = "2021"\n\n'
            f'[dependencies]\nstellate = {{ path = "{package}" }}\n'
        )
        shutil.copy(package / "Cargo.lock", self.place)  # the versions that are tested
        self.run_in("cargo", "run", "--quiet", "--release")
        self.holds_a_mesh()


if __name__ == "__main__":
    unittest.main(argv=sys.argv)
