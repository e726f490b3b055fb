"""The file VERSION is the one place where the version stands; what cannot read it agrees with it."""

from __future__ import annotations

import os
import pathlib
import re
import subprocess
import sys
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
VERSION = (ROOT / "VERSION").read_text()
# Files of other tools, each with an expression for every mention of our version.
STATED = {
    "docker/Dockerfile": r"\bstellate:(\d\S*)",
    "clients/node/package.json": r'"version": "(\S+)"',
    "clients/java/pom.xml": r"<artifactId>stellate</artifactId>\s*<version>(\S+)</version>",
    "clients/java/README.md": r"`stellate:stellate:(\S+)`",
    "clients/r/DESCRIPTION": r"\nVersion: (\S+)",
    "clients/ruby/stellate.gemspec": r"gem\.version = '(\S+)'",
    "clients/rust/Cargo.toml": r'\nversion = "(\S+)"',
    "clients/rust/Cargo.lock": r'name = "stellate"\nversion = "(\S+)"',
    "examples/CMakeLists.txt": r"find_package\(stellate (\S+)",
    "docs/using/building.md": r"find_package\(stellate (\S+)",
}


class Version(unittest.TestCase):
    def test_it_is_one_line(self) -> None:
        self.assertRegex(VERSION, r"\A\d+\.\d+\.\d+\n\Z")

    def test_programs_say_it(self) -> None:
        folder = pathlib.Path(os.environ["STELLATED"]).parent
        for name in ("stellated", "stellate"):
            done = subprocess.run([folder / name, "--version"], capture_output=True, text=True)
            self.assertEqual(done.stdout, f"{name} {VERSION}")

    def test_python_says_it(self) -> None:
        program = "import stellate; print(stellate.__version__)"
        done = subprocess.run(
            [sys.executable, "-B", "-c", program], capture_output=True, text=True,
            env={**os.environ, "PYTHONPATH": str(ROOT / "clients" / "python")},
        )  # fmt: skip
        self.assertEqual(done.stdout, VERSION, done.stderr)

    def test_files_that_state_it_agree(self) -> None:
        for path, pattern in STATED.items():
            stated = re.findall(pattern, (ROOT / path).read_text())
            self.assertTrue(stated, path)
            for version in stated:  # all of it, or the part that has to be the same
                self.assertTrue(
                    f"{VERSION.strip()}.".startswith(f"{version}."), f"{path}: {version}"
                )


if __name__ == "__main__":
    unittest.main()
