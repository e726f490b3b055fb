"""The runner of the docs' blocks: what it finds in a page, and that it sees what is wrong."""

from __future__ import annotations

import os
import pathlib
import tempfile
import unittest

import blocks
import shell
from blocks import Wrong
from session import Session, difference
from surroundings import Surroundings

PAGE = """# A page

    echo indented

- a list

  ```python
  print("in a list")
  ```

      echo in a list, too

Words.

    echo again
"""


def entry(starts: str, **more: object) -> dict[str, object]:
    return {"starts": starts, **({"run": "bash"} if "check" not in more else {}), **more}


def match(*entries: dict[str, object]) -> blocks.Page:
    return blocks.match("page.md", PAGE, {"block": list(entries)}, "page.toml")


class Matching(unittest.TestCase):
    ALL = [entry("echo indented"), entry("print", run="python"), entry("echo in a"), entry("echo")]

    def test_all_blocks_are_found(self) -> None:
        page = match(*self.ALL)
        self.assertEqual([block.line for block in page.blocks], [3, 8, 11, 15])
        self.assertEqual(page.blocks[1].text, 'print("in a list")\n')
        self.assertEqual([block.kind for block in page.blocks], ["bash", "python", "bash", "bash"])

    def test_a_new_block_is_told_with_what_to_write(self) -> None:
        with self.assertRaisesRegex(Wrong, r"page.md:8: nothing says(.|\n)*starts = '''print"):
            match(self.ALL[0], *self.ALL[2:])

    def test_an_entry_without_a_block_is_told(self) -> None:
        with self.assertRaisesRegex(Wrong, "no block of page.md is left.*'curl'"):
            match(*self.ALL, entry("curl"))

    def test_a_wrong_entry_is_told(self) -> None:
        for wrong, word in (
            (entry("echo indented", check="bash"), "reason"),
            (entry("echo indented", servres=["plain"]), "unknown key 'servres'"),
            (entry("echo indented", check="bash", run="bash", reason="why"), "either"),
            (entry("echo indented", run="perl"), "is one of"),
        ):
            with self.subTest(word=word), self.assertRaisesRegex(Wrong, word):
                match(wrong, *self.ALL[1:])

    def test_every_table_is_a_page_s(self) -> None:
        known = {blocks.table_of(page) for page in blocks.pages()}
        self.assertEqual(set(blocks.TABLES.glob("*.toml")) - known, set())


class OneInterpreter(unittest.TestCase):
    def setUp(self) -> None:
        self.session = Session("/", dict(os.environ), 60.0)
        self.addCleanup(self.session.close)

    def test_blocks_go_on_where_others_ended(self) -> None:
        self.session.run("def f(x):\n    return 2 * x\n")
        self.session.run("print(f(21))")
        self.assertEqual(self.session.printed, "42\n")
        with self.assertRaisesRegex(RuntimeError, "ZeroDivisionError"):
            self.session.run("1 / 0")

    def test_what_a_page_shows_is_held_to_what_was_printed(self) -> None:
        printed = "mesh  1,200 vertices, Euler characteristic -2\ntook 0.3 s\nnear 0.31\n"
        fine = "mesh 1,150 vertices, Euler characteristic -2\n...\nnear 0.3"
        self.assertIsNone(difference(fine, printed))
        self.assertTrue(difference("9 of 10.0", "10 of 10.0"))
        self.assertTrue(difference(fine.replace("1,150", "1,100"), printed))
        for wrong in ("-2", "vertices", "0.3"):
            with self.subTest(wrong):
                self.assertTrue(difference(fine.replace(wrong, "1"), printed))
        self.assertTrue(difference("mesh 1,200 vertices", printed))


class Running(unittest.TestCase):
    def setUp(self) -> None:
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.here = pathlib.Path(scratch.name)
        self.around = Surroundings(blocks.Page("page.md", {}, []), self.here)

    def run_block(self, text: str, **more: object) -> None:
        shell.run("", text, entry(text, **more), self.around)

    def check(self, kind: str, text: str) -> None:
        one = entry(text, check=kind, reason="it is a test")
        shell.check(blocks.Block(1, "", text, one), self.around)

    def test_a_command_that_fails_fails_its_block(self) -> None:
        self.run_block("echo fine\necho \\\n  split >file\ncat <<X\n(\nX\n")
        self.assertTrue((self.here / "file").exists())
        for text in ("false\ntrue\n", "no-such-program\n", "false | true\n"):
            with self.subTest(text), self.assertRaisesRegex(Wrong, "status"):
                self.run_block(text)

    def test_exceptions(self) -> None:
        self.run_block("rm -r /nothing/there\n", leave_out={"rm -r": "dangerous"})
        self.run_block("(exit 3)\n", status={"(exit": 3})
        with self.assertRaisesRegex(Wrong, "status"):
            self.run_block("true\n", status={"true": 3})
        with self.assertRaisesRegex(Wrong, "no command of the block begins with .'sleep'"):
            self.run_block("true\n", leave_out={"sleep": "long"})

    def test_lines_in_the_background(self) -> None:
        text = "bash -c 'echo I am up; sleep 1000'\ntouch after\n"
        self.run_block(text, background={"bash": "I am up"})
        self.assertTrue((self.here / "after").exists())
        with self.assertRaisesRegex(Wrong, "I am not"):
            self.run_block("bash -c 'echo I am not'\n", background={"bash": "I am up"})

    def test_syntax_and_names_are_checked(self) -> None:
        self.check("bash", "tests/run -R x # words\n")
        self.check("bash", "tests/bench/run peers --full --only=x && tools/check --fix\n")
        for kind, text in (
            ("bash", "if true\n"),
            ("bash", "tests/rum -R x\n"),
            ("bash", "tools/chek\n"),
            ("bash", "tests/run --asam\n"),
            ("bash", "tests/bench/run peers --ful\n"),
            ("bash", "python3 tests/proto/surface.py --recrod\n"),
            ("bash", "cmake --build build/release --target no_such_target\n"),
            ("bash", "build/release/bin/no_such_target\n"),
            ("python", "def f(:\n"),
            ("yaml", "a: [\n"),
            ("toml", "a = \n"),
        ):
            with self.subTest(text), self.assertRaises(Wrong):
                self.check(kind, text)

    def test_a_target_that_an_option_adds_is_known_without_it(self) -> None:
        self.check("bash", "cmake --build build/release --target stellate-mpi\n")

    def test_what_is_to_be_built_first_is_missed(self) -> None:
        """A page that begins with nothing built has only what its own commands build."""
        with tempfile.TemporaryDirectory() as folder:
            fresh = Surroundings(blocks.Page("p.md", {"fresh": True}, []), pathlib.Path(folder))
            build = "cmake --preset release\ncmake --build build/release --target stellated\n"
            for program, found in (("stellated", True), ("stellate", False)):
                text = f"{build}build/release/bin/{program} --version\n"
                if found:
                    shell.run("", text, entry("cmake"), fresh)
                else:
                    with self.assertRaisesRegex(Wrong, "No such file"):
                        shell.run("", text, entry("cmake"), fresh)


if __name__ == "__main__":
    unittest.main()
