"""Examples in comments of headers are code: each stands in a test that compiles it.

header_examples_test.cc, of a folder in TESTS, has the examples of all headers that it includes. Compared is
the code before a trailing comment, whatever its spaces: a test may expect what an expression is, and has
something in place of "...".
"""

from __future__ import annotations

import pathlib
import re
import unittest
from collections.abc import Iterator

ROOT = pathlib.Path(__file__).resolve().parents[2]
TESTS = {"tests/core": ".", "tests/clients/cpp": "clients/cpp/include"}  # where headers are from


def examples(header: str) -> Iterator[str]:
    """The lines of code in comments: indented, after an empty line of the comment."""
    inside, before = False, ""
    for line in header.splitlines():
        line = line.strip()
        inside = line.startswith("//   ") and (inside or before == "//")
        if inside:
            yield line.removeprefix("//").strip()
        before = line


def squeezed(code: str) -> str:
    return re.sub(r"\s+", "", code)


def missing(test: str, headers: dict[str, str]) -> list[str]:
    """Lines of examples that are not in the test."""
    compiled = squeezed(test)

    def stands_there(line: str) -> bool:
        code = squeezed(line.split("  //")[0]).removesuffix(";")
        return all(piece in compiled for piece in code.split("..."))

    return [
        f"{name}: {line}"
        for name, header in headers.items()
        for line in examples(header)
        if not stands_there(line)
    ]


def included(test: str, root: pathlib.Path) -> dict[str, str]:
    names = re.findall(r'^#include "(.+)"$', test, re.M)
    return {name: (root / name).read_text() for name in names}


class Examples(unittest.TestCase):
    def test_they_are_compiled(self) -> None:
        for folder, root in TESTS.items():
            test = (ROOT / folder / "header_examples_test.cc").read_text()
            self.assertEqual(missing(test, included(test, ROOT / root)), [], folder)

    def test_most_headers_in_them_have_one(self) -> None:
        for folder, root in TESTS.items():
            test = (ROOT / folder / "header_examples_test.cc").read_text()
            headers = included(test, ROOT / root)
            without = [name for name, header in headers.items() if not any(examples(header))]
            self.assertEqual(without, [], folder)

    def test_one_that_changed_is_seen(self) -> None:
        header = "// Doubles.\n//\n//   Twice(3);  // 6\nint Twice(int n);\n"
        self.assertEqual(missing("EXPECT_EQ(Twice(3), 6);", {"a.h": header}), [])
        self.assertEqual(
            missing("EXPECT_EQ(Thrice(3), 9);", {"a.h": header}), ["a.h: Twice(3);  // 6"]
        )


if __name__ == "__main__":
    unittest.main()
