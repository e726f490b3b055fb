"""Headers, messages, the protocol and pages say nothing in words that were given up (retired.toml), and
the glossary explains what headers are named after."""

from __future__ import annotations

import pathlib
import re
import sys
import unittest
from collections.abc import Iterator

import reader

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
TABLE = reader.read_table(HERE / "retired.toml")
OURS = "tests/words"
QUOTES = "docs/evidence/house.md"  # what was said before
_CLASS = re.compile(r"^(?:class|struct|enum class) (\w+)(?=[^;]*\{)", re.M)
_PART = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")


def files() -> Iterator[tuple[str, str]]:
    for path in reader.tracked(ROOT):
        if not reader.lies_in(path, OURS) and path != QUOTES:
            yield path, (ROOT / path).read_text(errors="replace")


def said(hits: list[reader.Hit], path: str) -> list[str]:
    return [f'{path}:{hit.line}: "{hit.old}"; say: {hit.new}' for hit in hits]


def glossary_words() -> set[str]:
    terms = re.findall(r"^\| ([^|]+) \|", (ROOT / "docs" / "glossary.md").read_text(), re.M)
    return {word.lower() for term in terms for word in _PART.findall(term)}


def is_explained(word: str, known: set[str]) -> bool:
    singular = re.sub(r"ies$", "y", word) if word.endswith("ies") else word.removesuffix("s")
    return any(form in known for form in (word, word + "s", singular))


class Words(unittest.TestCase):
    def test_none_is_retired(self) -> None:
        found = []
        for path, content in files():
            found += said(reader.check(path, content, TABLE), path)
        self.assertEqual(found, [], "\n" + "\n".join(found))


class FrontPage(unittest.TestCase):
    def test_it_is_read_in_five_minutes(self) -> None:
        text = re.sub(r"(?ms)^```.*?^```$", "", (ROOT / "README.md").read_text())
        text = re.sub(r"(?m)^    .*$", "", text)  # what the shell is told
        text = re.sub(r"\]\([^)]*\)", "]", text)
        words = re.findall(r"[A-Za-z0-9][^\s|]*", text)
        self.assertLess(len(words), 700)
        self.assertGreater(len(words), 400)


class Glossary(unittest.TestCase):
    def test_it_has_what_classes_of_the_core_and_of_dispatching_are_named_after(self) -> None:
        """A word of a class's name is in the glossary, or is no term of ours: ordinary.txt."""
        known = glossary_words() | set((HERE / "ordinary.txt").read_text().split())
        for path, content in files():
            if re.match(r"(core|server/(oracles|history))/.*\.h$", path):
                for name in _CLASS.findall(content):
                    unknown = [
                        part.lower()
                        for part in _PART.findall(name)
                        if not is_explained(part.lower(), known)
                    ]
                    self.assertEqual(unknown, [], f"{path}: {name}")

    def test_words_are_ordinary_or_in_the_glossary_not_both(self) -> None:
        ordinary = (HERE / "ordinary.txt").read_text().split()
        self.assertEqual(ordinary, sorted(set(ordinary)))
        self.assertEqual(set(ordinary) & glossary_words(), set())


class Reader(unittest.TestCase):
    """The table finds what it is to find: a header as it was once is refused."""

    OLD = """
// Tells whoever asks, at once. Nobody is asked.
struct CrewMember {
  std::string title;  // of the crew
};
std::vector<CrewMember> Crew() const;
"""

    def old_words(self, path: str, content: str) -> set[str]:
        return {hit.old for hit in reader.check(path, content, TABLE)}

    def test_an_old_header_is_refused_with_its_lines(self) -> None:
        hits = reader.check("server/oracles/crew.h", self.OLD, TABLE)
        self.assertLessEqual({"crew", "whoever", "at once", "nobody"}, {hit.old for hit in hits})
        self.assertEqual({hit.line for hit in hits if hit.old == "crew"}, {3, 4, 6})
        self.assertTrue(said(hits, "x")[0].startswith("x:"))

    def test_a_name_is_found_however_it_is_written(self) -> None:
        for written in ("WatchLog log;", "watch_log", "kWatchLogBytes", "#include <a/watch_log.h>"):
            with self.subTest(written):
                self.assertIn("watch log", self.old_words("server/x/y.cc", written))
        self.assertEqual(self.old_words("server/x/y.cc", "watch; log"), set())

    def test_phrases_are_refused_in_messages_but_not_in_the_code_around_them(self) -> None:
        source = 'auto nobody = 1;\nthrow Error("this is "\n      "at\\nonce");  // whoever\n'
        self.assertEqual(self.old_words("server/x/y.cc", source), {"at once"})
        self.assertEqual(self.old_words("server/x/y.md", "at\nonce"), {"at once"})
        self.assertEqual(self.old_words("tests/x/y.h", "at once"), set())

    def test_phrases_are_refused_in_what_help_shows_of_python(self) -> None:
        source = 'def told(x):\n    """Returns at\n    once."""\n    # anew\n    return nobody(x)\n'
        hits = reader.check("clients/python/stellate/x.py", source, TABLE)
        self.assertEqual([(hit.line, hit.old) for hit in hits], [(2, "at once"), (4, "anew")])

    def test_phrases_are_refused_in_comments_of_the_other_clients(self) -> None:
        source = "let told = 1; // at once\n/** Nobody\n * anew. */\n"
        self.assertEqual(
            self.old_words("clients/node/src/x.ts", source), {"at once", "nobody", "anew"}
        )
        self.assertEqual(self.old_words("clients/go/x.go", "told() // told"), {"told"})
        self.assertEqual(self.old_words("clients/go/x_test.go", "// told"), set())
        self.assertEqual(self.old_words("clients/ruby/lib/x.rb", "told # anew"), {"anew"})

    def test_a_word_may_be_right_in_a_longer_one_and_elsewhere(self) -> None:
        word = reader.Word(("guard",), "ball", ("core",), ("lock guard",))
        text = reader.Text("std::lock_guard lock; guard")
        self.assertEqual(len(reader.find(text, "core/x.h", [word])), 1)
        self.assertEqual(reader.find(text, "server/x.h", [word]), [])


if __name__ == "__main__":
    sys.path.insert(0, str(HERE))
    unittest.main()
