"""What is said while an oracle takes unusually long for an answer."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Protocol

_UNREMARKED = 5.0  # seconds that a person looks at nothing before wondering
_UNUSUAL = 4  # times the longest answer so far: of an oracle that is slow always


class AtWork(Protocol):
    """A worker.

    Attributes:
      at_work: while its oracle is at an answer: since when, by time.monotonic(), and of what, "40 flats".
      longest: seconds that an answer took; 0 before the first.
    """

    at_work: tuple[float, str] | None
    longest: float


class Waiting:
    """Looks at workers now and then, and says which answer is waited for, again at each doubling."""

    def __init__(self, unremarked: float = _UNREMARKED) -> None:
        self._unremarked = unremarked
        self._of = 0.0  # since when the answer that was remarked on last has been waited for
        self._next = 0.0  # seconds, of that answer

    def remark(self, workers: Sequence[AtWork]) -> str:
        """ "waiting for the oracle's first answer, to 40 closest points, 5 s"; "" where that was said, or there
        is nothing to say."""
        busy = [worker.at_work for worker in workers]
        since, what = min((it for it in busy if it is not None), default=(0.0, ""))
        if not what:
            return ""
        longest = max(worker.longest for worker in workers)
        if since != self._of:
            self._of, self._next = since, max(self._unremarked, _UNUSUAL * longest)
        waited = time.monotonic() - since
        if waited < self._next:
            return ""
        self._next = 2 * waited
        answer = "answer to" if longest else "first answer, to"
        return f"waiting for the oracle's {answer} {what}, {waited:.0f} s"
