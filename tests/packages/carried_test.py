"""gRPC that is built into what others install: one script makes it, and its advisories are told."""

from __future__ import annotations

import pathlib
import re
import subprocess
import unittest

import tomllib

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "packaging" / "grpc" / "build"


def read(path: str) -> str:
    """A file of the tree."""
    return (ROOT / path).read_text()


class Carried(unittest.TestCase):
    def version(self) -> str:
        said = subprocess.run([SCRIPT, "--bill"], capture_output=True, text=True, check=True)
        return said.stdout.split("\t")[1]

    def test_image_wheel_and_packages_are_made_with_it(self) -> None:
        self.assertIn("packaging/grpc/build build/grpc", read("packaging/build"))
        self.assertIn("cmake --preset package", read("packaging/build"))
        self.assertIn("packaging/build programs", read("packaging/deb"))
        self.assertIn('"packaging" / "build", "programs"', read("packaging/bundle.py"))
        for carries in ("packaging/wheel", "packaging/npm-server"):
            self.assertRegex(read(carries), r"from bundle import .*\bfill\b")
        dockerfile = read("docker/Dockerfile")
        self.assertLess(
            dockerfile.index("RUN packaging/grpc/build build/grpc"),
            dockerfile.index("RUN cmake --preset package"),
        )
        self.assertNotIn("build/release", dockerfile)
        self.assertIn("${sourceDir}/build/grpc", read("CMakePresets.json"))

    def test_its_sources_are_those_that_were_looked_at(self) -> None:
        script = SCRIPT.read_text()
        digest = re.search(r"(?m)^sha256=([0-9a-f]{64})\b", script)
        assert digest is not None
        locked = re.search(
            r'name = "grpcio-sys"\nversion = "([^"]+)"\nsource = .*\nchecksum = "([0-9a-f]+)"',
            read("packaging/grpc/crate/Cargo.lock"),
        )
        assert locked is not None
        self.assertEqual(locked[2], digest[1])
        self.assertTrue(locked[1].endswith(f"+{self.version()}-patched"), locked[1])

    def test_what_is_known_against_it_is_told(self) -> None:
        known = tomllib.loads(read("docker/advisories.toml"))
        (carried,) = known["carried"]
        (debians,) = (entry for entry in known["package"] if entry["source"] == "grpc")
        self.assertEqual(carried["version"], self.version(), "look again at docker/advisories.toml")
        still = {advisory["id"] for advisory in carried["advisory"]}
        self.assertEqual(still & carried["mended"].keys(), set())
        for advisory in debians["advisory"]:
            self.assertIn(advisory["id"], still | carried["mended"].keys())
        page = read("docs/running/safety.md")
        for advisory in carried["advisory"]:
            self.assertIn(advisory["id"], page)
            self.assertTrue((ROOT / advisory["shown"]).exists(), advisory["shown"])
        for path in ("SECURITY.md", "docs/running/safety.md", "docs/dependencies.md"):
            self.assertIn(self.version(), read(path), path)


if __name__ == "__main__":
    unittest.main()
