"""The sentences that docs/evidence/house.md shows as they are now stand in the files that it names."""

from __future__ import annotations

import pathlib
import re
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "evidence" / "house.md"
ROW = re.compile(r"^\| (.+) \| (.+) \| `(.+)` \|$", re.M)
FEWEST = 30


def plain(text: str) -> str:
    """Without the marks of comments, the joints of literals, and ends of lines."""
    text = re.sub(r"^\s*//\s?", "", text, flags=re.M)
    return re.sub(r"\s+", " ", re.sub(r'"\s*\n\s*"', "", text))


class Sentences(unittest.TestCase):
    def test_stand_where_they_are_said_to(self) -> None:
        rows = ROW.findall(PAGE.read_text())
        self.assertGreaterEqual(len(rows), FEWEST)
        for before, now, path in rows:
            with self.subTest(now):
                text = plain((ROOT / path).read_text())
                self.assertIn(now, text, path)
                if before not in now:
                    self.assertNotIn(before, text, path)

    def test_joints_and_marks_are_no_part_of_a_sentence(self) -> None:
        self.assertEqual(
            plain('// One\n// two.\n  f("three "\n    "four");'), 'One two. f("three four");'
        )


if __name__ == "__main__":
    unittest.main()
