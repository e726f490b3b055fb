"""What makes a fault of memory hard to misuse (cmake/Hardening.cmake) is in the programs that users get.

hardening_test.py PROGRAM... looks at these, stripped or not, wherever they were installed.
"""

from __future__ import annotations

import re
import subprocess
import sys
import unittest

PROGRAMS = sys.argv[1:]


def readelf(*arguments: str) -> str:
    return subprocess.run(
        ("readelf", "--wide", *arguments), capture_output=True, text=True, check=True
    ).stdout


class Hardening(unittest.TestCase):
    def says(self, said: str, wanted: str) -> None:
        self.assertTrue(re.search(wanted, said), f"readelf says nothing like {wanted}")

    def each(self, check) -> None:
        self.assertTrue(PROGRAMS, "no program is named")
        for program in PROGRAMS:
            with self.subTest(program):
                check(program)

    def test_it_may_lie_anywhere(self) -> None:
        def check(program: str) -> None:
            self.says(readelf("--file-header", program), r"Type:\s+DYN ")
            self.says(readelf("--dynamic", program), r"\(FLAGS_1\).*\bPIE\b")

        self.each(check)

    def test_tables_of_functions_are_read_only_once_it_runs(self) -> None:
        def check(program: str) -> None:
            self.says(readelf("--segments", program), r"\n\s*GNU_RELRO ")
            self.says(readelf("--dynamic", program), r"\(FLAGS_1\).*\bNOW\b")

        self.each(check)

    def test_nothing_that_can_be_written_can_be_run(self) -> None:
        def check(program: str) -> None:
            segments = readelf("--segments", program)
            self.says(segments, r"\n\s*GNU_STACK ")
            for name, flags in re.findall(
                r"\n\s*(GNU_STACK|LOAD)(?:\s+0x\w+){5}\s+([RWE ]{3})", segments
            ):
                self.assertFalse({"W", "E"} <= set(flags), f"{name} is {flags}")

        self.each(check)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
