"""The package of Node's that carries a server: installed beside the client's into an empty place, whose
environment knows of no other."""

from __future__ import annotations

import json
import os
import pathlib
import re
import subprocess
import sys
import tarfile
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
VERSION = (ROOT / "VERSION").read_text().strip()


class Npm(unittest.TestCase):
    made: pathlib.Path
    server: pathlib.Path

    @classmethod
    def setUpClass(cls) -> None:
        folder = tempfile.TemporaryDirectory(prefix="stellate-npm-test-")
        cls.addClassCleanup(folder.cleanup)
        cls.made = pathlib.Path(folder.name)
        subprocess.run(
            [ROOT / "packaging" / "publish", "--folder", cls.made, "npm-server", "npm"], check=True
        )
        (cls.server,) = cls.made.glob("stellate-server-*.tgz")

    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory(prefix="stellate-npm-place-")
        self.addCleanup(folder.cleanup)
        self.place = pathlib.Path(folder.name)
        (self.place / "package.json").write_text('{"private": true, "type": "module"}')

    def run_in(self, *command: str | pathlib.Path) -> str:
        """What a command prints in the empty place."""
        kept = re.compile(r"HOME|npm_config_\w+|https?_proxy|\w+_CA_\w+|SSL_\w+", re.I)
        known = {name: value for name, value in os.environ.items() if kept.fullmatch(name)}
        done = subprocess.run(
            command, cwd=self.place, capture_output=True, text=True,
            env={**known, "PATH": "/usr/local/bin:/usr/bin:/bin"},
        )  # fmt: skip
        self.assertEqual(done.returncode, 0, f"{command}\n{(done.stdout + done.stderr)[-4000:]}")
        return done.stdout

    def test_the_client_starts_its_server(self) -> None:
        client = self.made / f"stellate-{VERSION}.tgz"
        self.run_in("npm", "install", "--no-audit", "--no-fund", "--silent", self.server, client)
        text = (ROOT / "clients" / "node" / "README.md").read_text()
        example = re.search(r"(?ms)^```js\n(.*?)^```", text)
        assert example is not None
        (self.place / "torus.mjs").write_text(example[1])
        self.run_in("node", "torus.mjs")
        lines = (self.place / "torus.obj").read_text().splitlines()
        vertices, faces = (sum(line.startswith(kind) for line in lines) for kind in ("v ", "f "))
        self.assertEqual(faces, 2 * vertices)
        self.assertIn(f"stellated {VERSION}", self.run_in("npx", "stellated", "--version"))
        self.run_in("npx", "stellate", "mesh", "torus", "-e", "0.3", "-o", "torus.off")

    def test_without_it_the_client_says_which_one_is_missing(self) -> None:
        """And is installed all the same, as the package is optional: no registry has one yet."""
        client = self.made / f"stellate-{VERSION}.tgz"
        self.run_in(
            "npm", "install", "--no-audit", "--no-fund", "--silent", "--omit=optional", client
        )
        (self.place / "start.mjs").write_text(
            'import { Server } from "stellate";\n'
            "await Server.start().catch((error) => console.log(error.name, error.message));\n"
        )
        said = self.run_in("node", "start.mjs")
        name = self.server.name.removesuffix(f"-{VERSION}.tgz")
        self.assertIn("ServerNotFound", said)
        self.assertIn(f"install {name}", said)

    def test_its_manifest_lets_npm_choose(self) -> None:
        with tarfile.open(self.server) as archive:
            names = archive.getnames()
            file = archive.extractfile("package/package.json")
            assert file is not None
            manifest = json.load(file)
        self.assertEqual(manifest["os"], ["linux"])
        self.assertEqual(manifest["name"], f"stellate-server-linux-{manifest['cpu'][0]}")
        self.assertEqual(manifest["version"], VERSION)
        for name in ("bin/stellated", "bin/stellate", "bin/licences/grpc", "LICENSE", "README.md"):
            self.assertIn(f"package/{name}", names)
        with tarfile.open(self.made / f"stellate-{VERSION}.tgz") as archive:
            file = archive.extractfile("package/package.json")
            assert file is not None
            wants = json.load(file)["optionalDependencies"]
        self.assertEqual(wants[manifest["name"]], VERSION)


if __name__ == "__main__":
    unittest.main(argv=sys.argv)
