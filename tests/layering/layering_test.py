#!/usr/bin/python3
"""Every wall of the house stands, and a broken one is seen.

`rooms.py` is the table: which folders are rooms, and from which others each may take. To see what
is wrong without the tests: `tests/layering/layering_test.py --list`.
"""

from __future__ import annotations

import pathlib
import sys
import tempfile
import unittest

import checker
import rooms

ROOT = pathlib.Path(__file__).resolve().parents[2]

MADE_UP = checker.Table(
    rooms={
        "core": (),
        "core/shape": ("core",),
        "core/open.cc": ("core", "core/shape"),
        "server": ("core", "proto"),
        "client": ("proto",),
        "proto": (),
    },
    foreign={"chrono": ("server",), "wire/": ("server",), "grpc.": ("client",)},
    generated={"made/v1/": "proto"},
    packages={"pack": "client/pack"},
    watched=("core", "server"),
    exact={"core": ("core/words.cc",)},
    acyclic=("core", "client"),
)
SOUND = {
    "core/face.h": "#pragma once\n#include <vector>\n",
    "core/shape/cell.h": '#include "core/face.h"\n',
    "core/open.cc": '#include "core/face.h"\n#include "core/shape/cell.h"\n',
    "server/serve.cc": '#include <chrono>\n#include <wire/call.h>\n#include "core/face.h"\n'
    '#include "made/v1/mesh.pb.h"\n',
    "client/pack/__init__.py": "from .run import run\n",
    "client/pack/run.py": "import grpc\nfrom . import _parts\n",
    "client/pack/_parts/__init__.py": "import numpy\n",
}


class Made(unittest.TestCase):
    """The checker itself, with small trees."""

    def faults(self, changes=None, table=MADE_UP):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            for name, text in (SOUND | (changes or {})).items():
                (root / name).parent.mkdir(parents=True, exist_ok=True)
                (root / name).write_text(text)
            return checker.faults(root, table)

    def with_rooms(self, **changes):
        return checker.Table(**{**MADE_UP.__dict__, **changes})

    def test_a_sound_tree_has_no_faults(self):
        self.assertEqual(self.faults(), [])

    def test_an_include_through_a_wall_is_named_with_its_line(self):
        self.assertEqual(
            self.faults({"core/face.h": '#pragma once\n\n#include "core/shape/cell.h"\n'})[0],
            "core/face.h:3: takes core/shape/cell.h, of core/shape, and core may not",
        )

    def test_a_header_named_from_a_folder_of_the_build_is_found(self):
        (fault,) = self.faults({"core/face.h": '#include "serve.h"\n', "server/serve.h": ""})
        self.assertIn("takes serve.h, of server", fault)

    def test_one_file_may_have_a_door_that_its_folder_has_not(self):
        (fault,) = self.faults({"core/close.cc": SOUND["core/open.cc"]})
        self.assertIn("core/close.cc:2", fault)

    def test_generated_headers_are_a_room(self):
        (fault,) = self.faults({"core/face.h": '#include "made/v1/mesh.pb.h"\n'})
        self.assertIn("of proto, and core may not", fault)

    def test_a_library_is_for_those_that_may_have_it(self):
        for line in ("#include <chrono>", "#include <wire/call.h>"):
            (fault,) = self.faults({"core/face.h": line + "\n"})
            self.assertIn("only server may have", fault)
        self.assertEqual(self.faults({"core/face.h": "#include <chronology>\n"}), [])

    def test_a_python_import_through_a_wall_is_seen(self):
        table = self.with_rooms(rooms={**MADE_UP.rooms, "client/pack/_parts": ()})
        self.assertIn("takes pack._parts", self.faults(table=table)[0])
        for line in ("from pack.run import run", "from ..run import run", "import pack.run"):
            found = self.faults({"client/pack/_parts/__init__.py": line + "\n"}, table)
            self.assertTrue(any("_parts/__init__.py:1: takes" in fault for fault in found), line)

    def test_a_python_library_is_for_those_that_may_have_it(self):
        for line in ("import grpc", "import grpc.aio", "from grpc import aio"):
            found = self.faults({"server/tool.py": f"def f():\n    {line}\n"})
            self.assertEqual(len(found), 1, line)
            self.assertIn("server/tool.py:2", found[0])

    def test_what_the_processor_rounds_is_kept_out(self):
        for call in (
            "std::log(x)",
            "pow(x, 3)",
            "::cosf(x)",
            "x.array().exp()",
            "std::hypot (x, y)",
        ):
            (fault,) = self.faults({"core/shape/cell.h": f"\nreturn {call};\n"})
            self.assertIn("core/shape/cell.h:2", fault, call)
        (fault,) = self.faults({"core/face.h": "std::normal_distribution<double> normal;\n"})
        self.assertIn("normal_distribution", fault)
        for line in ("return std::sqrt(x);", "// std::log(x)", "log_(x); Catalog(x); log.Add(x);"):
            self.assertEqual(self.faults({"core/shape/cell.h": line + "\n"}), [], line)
        self.assertEqual(self.faults({"core/words.cc": "std::acos(x);\n"}), [])
        self.assertEqual(self.faults({"client/pack/exact.cc": "std::acos(x);\n"}), [])

    def test_files_in_a_circle_are_named(self):
        for changes in (
            {"core/face.h": '#include "core/other.h"\n', "core/other.h": '#include "face.h"\n'},
            {"client/pack/_parts/__init__.py": "from ..run import run\n"},
        ):
            (fault,) = self.faults(changes)
            self.assertIn("take from each other", fault)

    def test_what_is_for_the_type_checker_alone_makes_no_circle(self):
        text = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from ..run import run\n"
        self.assertEqual(self.faults({"client/pack/_parts/__init__.py": text}), [])

    def test_a_source_without_a_room_is_named(self):
        table = self.with_rooms(watched=("core", "server", "cellar"))
        (fault,) = self.faults({"cellar/wine.cc": ""}, table)
        self.assertIn("cellar/wine.cc: is in no room", fault)

    def test_a_table_in_a_circle_is_refused(self):
        table = self.with_rooms(rooms={**MADE_UP.rooms, "core": ("core/shape",)})
        self.assertIn("the table goes in a circle", self.faults(table=table)[0])

    def test_a_room_that_is_gone_is_named(self):
        table = self.with_rooms(rooms={**MADE_UP.rooms, "attic": (), "server": ("core", "loft")})
        found = self.faults(table=table)
        self.assertTrue(any("room attic, and no source" in fault for fault in found))
        self.assertTrue(any("loft, which is no room" in fault for fault in found))


class House(unittest.TestCase):
    def test_every_wall_stands(self):
        found = checker.faults(ROOT, rooms.TABLE)
        self.assertEqual(found, [], "\n" + "\n".join(found))

    def test_the_walls_are_walls(self):
        """What the table is for: these must stay apart, whoever edits it."""
        for room in rooms.TABLE.rooms:
            reach = reachable(room)
            if checker.lies_in(room, "core"):
                self.assertTrue(all(checker.lies_in(other, "core") for other in reach), room)
            if checker.lies_in(room, "server"):
                self.assertFalse(any(checker.lies_in(other, "clients") for other in reach), room)
                direct = set(rooms.TABLE.rooms[room])
                self.assertFalse(
                    any(other.startswith("core/") for other in direct - set(rooms.FACE)), room
                )
            if checker.lies_in(room, "clients"):
                self.assertFalse(
                    any(
                        checker.lies_in(other, top) for other in reach for top in ("core", "server")
                    ),
                    room,
                )


def reachable(room: str) -> set[str]:
    found: set[str] = set()
    left = [room]
    while left:
        for other in rooms.TABLE.rooms[left.pop()]:
            if other not in found:
                found.add(other)
                left.append(other)
    return found


if __name__ == "__main__":
    if sys.argv[1:] == ["--list"]:
        wrong = checker.faults(ROOT, rooms.TABLE)
        print("\n".join(wrong) or "every wall stands")
        sys.exit(bool(wrong))
    unittest.main()
