"""What makes a fault of memory hard to misuse (cmake/Hardening.cmake) is in the programs that users get.

hardening_test.py PROGRAM... looks at these, stripped or not, wherever they were installed.
"""

from __future__ import annotations

import platform
import re
import subprocess
import sys
import unittest

PROGRAMS = sys.argv[1:]
# Functions of ours that may be called by address begin with this instruction, which says so to a
# processor that watches. Each program has thousands; what is linked into it without them has none.
ENDBR64 = bytes.fromhex("f30f1efa")
LEAST_TARGETS = 1000


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
            found = re.findall(r"\n\s*(GNU_STACK|LOAD)(?:\s+0x\w+){5}\s+([RWE ]{3})", segments)
            self.assertEqual({name for name, _ in found}, {"GNU_STACK", "LOAD"})
            for name, flags in found:
                self.assertFalse({"W", "E"} <= set(flags), f"{name} is {flags}")

        self.each(check)

    def test_stacks_and_copies_are_guarded(self) -> None:
        def check(program: str) -> None:
            wanted = readelf("--dyn-syms", program)
            self.says(wanted, r" UND __stack_chk_fail\b")
            self.says(wanted, r" UND __(?!stack)\w+_chk\b")

        self.each(check)

    @unittest.skipUnless(platform.machine() == "x86_64", "an instruction of this processor alone")
    def test_calls_by_address_reach_beginnings_of_functions_alone(self) -> None:
        def check(program: str) -> None:
            where = re.search(
                r" \.text\s+PROGBITS\s+\w+\s+(\w+)\s+(\w+)", readelf("--sections", program)
            )
            self.assertIsNotNone(where)
            offset, size = (int(number, 16) for number in where.groups())
            with open(program, "rb") as file:
                file.seek(offset)
                self.assertGreater(file.read(size).count(ENDBR64), LEAST_TARGETS)

        self.each(check)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
