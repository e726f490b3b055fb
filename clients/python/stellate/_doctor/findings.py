"""What check() says: findings in the words that all clients share."""

from __future__ import annotations

import dataclasses
import functools
import textwrap
from collections.abc import Mapping
from typing import Any, Literal, cast

import numpy as np

from .. import _html, _shared

Severity = Literal["error", "warning", "note"]

_WIDTH = 100
_SHOWN_ENTRIES = 6


def show(value: Any) -> str:
    """A number, a point or a word, as it stands in a sentence."""
    if isinstance(value, np.ndarray):
        entries = [f"{entry:.6g}" for entry in value[:_SHOWN_ENTRIES]]
        if len(value) > _SHOWN_ENTRIES:
            entries.append("...")
        return "[" + ", ".join(entries) + "]"
    if isinstance(value, (int, np.integer)):
        return f"{value:,}"
    if isinstance(value, (float, np.floating)):
        return f"{value:.4g}"
    return str(value)


@dataclasses.dataclass(frozen=True)
class Words:
    """One block of findings.txt."""

    severity: Severity
    message: str
    advice: str


@functools.cache
def all_words() -> Mapping[str, Words]:
    """The findings that there are, by code."""
    words = {}
    lines = [line for line in _shared.text("findings.txt").splitlines() if not line.startswith("#")]
    for block in "\n".join(lines).split("\n\n"):
        if not block.strip():
            continue
        head, message, *rest = block.strip().splitlines()
        code, severity = head.split()
        words[code] = Words(
            cast(Severity, severity), message, rest[0].removeprefix("- ") if rest else ""
        )
    return words


@dataclasses.dataclass(frozen=True)
class Finding:
    """One thing that was found."""

    severity: Severity  # "error": the mesh will not come out right; "warning": it may not; "note"
    code: str  # stable, e.g. "NOT_CLOSEST"
    message: str  # what is wrong, with the first counterexample
    advice: str  # what to do about it
    example: Mapping[str, Any]  # the values in the message: "query" and "answer" are points (d,)

    @classmethod
    def of(cls, code: str, **example: Any) -> Finding:
        words = all_words()[code]
        shown = {name: show(value) for name, value in example.items()}
        message, advice = words.message.format(**shown), words.advice.format(**shown)
        return cls(words.severity, code, message, advice, example)

    def __str__(self) -> str:
        return textwrap.fill(
            f"{self.severity:>7} {self.code}: {self.message.rstrip('.')}. {self.advice}".rstrip(),
            _WIDTH,
            subsequent_indent=" " * 8,
        )


@dataclasses.dataclass(frozen=True)
class CheckReport:
    """What check() found; `print(report)` is for people. Lengths in the coordinates' unit."""

    findings: tuple[Finding, ...]  # errors first, then warnings, then notes
    samples: int  # points of M that were seen
    queries: int  # that it took
    reach: float | None  # an estimate from above
    pieces: int | None  # components that points were seen on
    rates: Mapping[int, float]  # queries a second, by batch size
    best_batch: int | None

    @property
    def ok(self) -> bool:
        """Whether there is no error."""
        return not any(finding.severity == "error" for finding in self.findings)

    @property
    def codes(self) -> tuple[str, ...]:
        """The codes of the findings, in their order."""
        return tuple(finding.code for finding in self.findings)

    def __str__(self) -> str:
        return "\n".join([*map(str, self.findings), self.summary])

    def _repr_html_(self) -> str:
        marks = {"error": "bad", "warning": "mind"}
        rows = [
            (
                f"{f.severity} {f.code}",
                f"{f.message}\n{f.advice}".rstrip(),
                marks.get(f.severity, ""),
            )
            for f in self.findings
        ]
        rows.append(("verdict", self.summary, "good" if self.ok else "bad"))
        return _html.table("Stellate: check of an oracle", rows)

    @property
    def summary(self) -> str:
        """All of it in a sentence."""

        def count(severity: str) -> str:
            n = sum(finding.severity == severity for finding in self.findings)
            return f"{n} {severity}" if n == 1 else f"{n} {severity}s"

        verdict = "keeps" if self.ok else "breaks"
        summary = f"The oracle {verdict} its contract: {count('error')}, {count('warning')}"
        return summary + f", from {self.queries:,} queries about {self.samples:,} points of M."
