"""What became of the rules."""

from __future__ import annotations

import dataclasses
import json
import threading
from typing import Callable

PASS, FAIL, UNTRIED = "PASS", "FAIL", "untried"


@dataclasses.dataclass
class Result:
    rule: str
    verdict: str
    came: str = ""
    wanted: str = ""

    def __str__(self) -> str:
        if self.verdict == PASS:
            return f"PASS  {self.rule}"
        wanted = f"; it should have: {self.wanted}" if self.wanted else ""
        return f"{self.verdict:5} {self.rule}: {self.came}{wanted}"


class Results:
    """Of all rules, in the order in which they were judged. Any thread."""

    def __init__(self, tell: Callable[[Result], None]) -> None:
        self.all: list[Result] = []
        self._tell = tell
        self._lock = threading.Lock()

    def add(self, result: Result) -> None:
        with self._lock:
            self.all.append(result)
            self._tell(result)

    def count(self, verdict: str) -> int:
        return sum(result.verdict == verdict for result in self.all)

    def to_json(self) -> str:
        return json.dumps(
            {
                "passed": self.count(PASS),
                "failed": self.count(FAIL),
                "untried": self.count(UNTRIED),
                "rules": [dataclasses.asdict(result) for result in self.all],
            },
            indent=1,
        )
