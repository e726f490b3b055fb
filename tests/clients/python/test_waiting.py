"""What is said while an oracle takes unusually long."""

from __future__ import annotations

import dataclasses

from stellate import _waiting


@dataclasses.dataclass
class Worker:
    at_work: tuple[float, str] | None = None
    longest: float = 0.0


def test_silence_is_remarked_on_once_and_then_at_each_doubling(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(_waiting.time, "monotonic", lambda: now[0])
    idle, asked, waiting = Worker(), Worker((100.0, "40 flats")), _waiting.Waiting()
    said = {}
    for second in range(25):
        now[0] = 100.0 + second
        text = waiting.remark([idle, asked])
        if text:
            said[second] = text
    assert list(said) == [5, 10, 20]
    assert said[5] == "waiting for the oracle's first answer, to 40 flats, 5 s"
    asked.at_work = None
    assert waiting.remark([idle, asked]) == ""


def test_an_oracle_that_is_slow_always_is_slow_after_four_times_its_longest(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(_waiting.time, "monotonic", lambda: now[0])
    worker, waiting = Worker((1.0, "7 closest points"), longest=3.0), _waiting.Waiting()
    now[0] = 12.9
    assert waiting.remark([worker]) == ""
    now[0] = 13.0
    assert waiting.remark([worker]) == "waiting for the oracle's answer to 7 closest points, 12 s"
    worker.at_work = (13.5, "1 closest points")
    now[0] = 14.0
    assert waiting.remark([worker]) == ""
