#!/usr/bin/python3
"""No class of the core or the server has more state, or does more, than one can keep in mind.

Members and methods (overloads apart) are counted in headers as clang-format leaves them: two spaces in.
"""

from __future__ import annotations

import pathlib
import re
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
MOST_MEMBERS, MOST_METHODS = 20, 40
FEWER_MEMBERS = {"core/run/scheduler.h Scheduler": 12}  # what all else hangs on

CLASS = re.compile(r"^class (\w+)[^;{]*\{\n(.*?)^\};", re.M | re.S)
MEMBER = re.compile(r"(?<![\w.>(])\w+_(?:\[[^\]]*\])*(?= = |\{|;|,)")
METHOD = re.compile(r"(?:[\w:<>,&*\[\] ]*?\s[&*]*)??(?:~?\w+|operator[^ \w]{1,3})\(")
NEITHER = re.compile(
    r"//|using |friend |typedef |template|static_assert|static constexpr \w+ k"
    r"|[}:](?! \w+_;)|struct |class |enum "
)


def count(body: str) -> tuple[int, int]:
    """The members and the methods of a class."""
    members = methods = 0
    for line in body.splitlines():
        if not re.match(r"  \S", line) or NEITHER.match(line, 2):
            continue
        code = line[2:].split("//")[0]
        if METHOD.match(code):
            methods += 1
        else:
            members += len(MEMBER.findall(code))
    return members, methods


def classes() -> dict[str, tuple[int, int]]:
    return {
        f"{path.relative_to(ROOT)} {found[1]}": count(found[2])
        for room in ("core", "server")
        for path in sorted((ROOT / room).rglob("*.h"))
        for found in CLASS.finditer(path.read_text())
    }


class ClassLimits(unittest.TestCase):
    def test_no_class_is_larger(self) -> None:
        for name, (members, methods) in classes().items():
            with self.subTest(name):
                self.assertLessEqual(members, FEWER_MEMBERS.get(name, MOST_MEMBERS), "members")
                self.assertLessEqual(methods, MOST_METHODS, "methods")

    def test_members_and_methods_are_counted(self) -> None:
        body = """ public:
  using Cell = int;
  explicit Stars(int d) : d_(d) {}
  Stars(const Stars&) = delete;
  template <typename Visit>
  void ForEach(const Visit& visit) const {
    visit(d_);
  }
  // Says how many there are (or 0).
  std::vector<int> Of(
      int p) const;
  bool operator<(const Stars& other) const { return d_ < other.d_; }

 private:
  static constexpr int kMost = 3;
  struct Part {
    int part_ = 0;
  };
  struct {
    int first_ = 0;
  } part_;
  int d_;
  double low_ = 0, high_{1};
  std::array<int, 3> few_[2];
  std::function<void(int)> on_end_;
"""
        self.assertEqual(count(body), (6, 5))


if __name__ == "__main__":
    unittest.main()
