"""The check of the protocol's surface goes red where it has to."""

from __future__ import annotations

import pathlib
import tempfile
import unittest

import surface

_BEFORE = """
syntax = "proto3";
package stellate.v1;
message Point { repeated double x = 1; optional int32 tag = 2; oneof how { bool given = 3; } }
enum Kind { KIND_UNSPECIFIED = 0; KIND_GOOD = 1; }
service S { rpc Ask(Point) returns (stream Point); }
"""


def _of(text: str) -> list[str]:
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "v1" / "a.proto"
        file.parent.mkdir()
        file.write_text(text)
        return surface.surface(pathlib.Path(folder))


class SurfaceTest(unittest.TestCase):
    def _found(self, old: str, new: str) -> list[str]:
        self.assertIn(old, _BEFORE)
        return surface.differences(_of(_BEFORE), _of(_BEFORE.replace(old, new)))

    def test_the_same_is_the_same(self) -> None:
        self.assertEqual(surface.differences(_of(_BEFORE), _of("// words\n" + _BEFORE)), [])

    def test_what_breaks_clients(self) -> None:
        for old, new in {
            "repeated double x = 1": "repeated float x = 1",
            "double x = 1": "double y = 1",
            "optional int32 tag = 2": "optional int32 tag = 4",
            "optional int32 tag": "int32 tag",
            "KIND_GOOD = 1": "KIND_FINE = 1",
            "returns (stream Point)": "returns (Point)",
            "bool given = 3;": "bool given = 3; } oneof why { bool a = 5;",
        }.items():
            found = self._found(old, new)
            if "oneof why" in new:
                self.assertTrue(all("not recorded yet" in line for line in found), found)
            else:
                self.assertTrue(any("breaks clients" in line for line in found), found)

    def test_what_is_new_is_to_be_recorded(self) -> None:
        found = self._found("KIND_GOOD = 1;", "KIND_GOOD = 1; KIND_BAD = 2;")
        self.assertEqual(found, ["not recorded yet: value stellate.v1.Kind 2 KIND_BAD"])


if __name__ == "__main__":
    unittest.main()
