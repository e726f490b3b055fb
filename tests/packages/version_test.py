"""The file VERSION is the one place where the version stands; what cannot read it agrees with it."""

from __future__ import annotations

import os
import pathlib
import re
import subprocess
import sys
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))
import version  # noqa: E402

VERSION = (ROOT / "VERSION").read_text()


class Version(unittest.TestCase):
    def test_it_is_one_line(self) -> None:
        self.assertRegex(VERSION, r"\A\d+\.\d+\.\d+\n\Z")

    def test_programs_say_it(self) -> None:
        folder = pathlib.Path(os.environ["STELLATED"]).parent
        for name, more in (("stellated", r" \(gRPC \d+\.\d+\.\d+\)"), ("stellate", "")):
            done = subprocess.run([folder / name, "--version"], capture_output=True, text=True)
            said = rf"\A{name} {re.escape(VERSION.strip())}{more}\n\Z"
            self.assertRegex(done.stdout, said)

    def test_python_says_it(self) -> None:
        program = "import stellate; print(stellate.__version__)"
        done = subprocess.run(
            [sys.executable, "-B", "-c", program], capture_output=True, text=True,
            env={**os.environ, "PYTHONPATH": str(ROOT / "clients" / "python")},
        )  # fmt: skip
        self.assertEqual(done.stdout, VERSION, done.stderr)

    def test_files_that_state_it_agree(self) -> None:
        for path in version.STATED:
            text = (ROOT / path).read_text()
            self.assertTrue(version.stated(path, text), path)
            self.assertEqual(version.with_version(path, text, VERSION.strip()), text, path)

    def test_a_new_one_is_set_everywhere(self) -> None:
        for path in version.STATED:
            text = version.with_version(path, (ROOT / path).read_text(), "7.8.9")
            found = [match[match.lastindex or 1] for match in version.stated(path, text)]
            self.assertTrue(found, path)
            self.assertLessEqual(set(found), {"7.8", "7.8.9"}, path)

    def test_the_list_of_changes_begins_with_it(self) -> None:
        headings = re.findall(r"(?m)^## (\S+),", (ROOT / "CHANGELOG.md").read_text())
        self.assertEqual(headings[0] + "\n", VERSION)


if __name__ == "__main__":
    unittest.main()
