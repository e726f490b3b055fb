"""What an examination found."""

from __future__ import annotations

import dataclasses
import textwrap
from collections.abc import Mapping
from typing import Literal, cast

import numpy as np

from . import _html
from ._generated import doctor_pb2 as pb

Severity = Literal["error", "warning", "note"]

_ORDER = ("error", "warning", "note")
_WIDTH = 100


@dataclasses.dataclass(frozen=True, eq=False)
class Finding:
    """One thing that was found."""

    severity: Severity  # "error": the mesh will not come out right; "warning": it may not; "note"
    code: str  # stable, e.g. "NOT_CLOSEST"
    message: str  # what is wrong, with the first counterexample
    advice: str  # what to do about it
    place: np.ndarray | None = None  # the counterexample, a point (d,), where there is one
    numbers: Mapping[str, float] = dataclasses.field(default_factory=dict)  # of the message

    @classmethod
    def from_wire(cls, wire: pb.Finding) -> Finding:
        severity = pb.Severity.Name(wire.severity).removeprefix("SEVERITY_").lower()
        place = np.array(wire.place) if wire.place else None
        return cls(
            cast(Severity, severity),
            wire.code,
            wire.message,
            wire.advice,
            place,
            dict(wire.numbers),
        )

    def __str__(self) -> str:
        return textwrap.fill(
            f"{self.severity:>7} {self.code}: {self.message.rstrip('.')}. {self.advice}".rstrip(),
            _WIDTH,
            subsequent_indent=" " * 8,
        )


@dataclasses.dataclass(frozen=True, eq=False)
class CheckReport:
    """What check() found; `print(report)` is for people. Lengths in the coordinates' unit."""

    findings: tuple[Finding, ...]  # errors first, then warnings, then notes
    samples: int = 0  # points of M that were seen
    queries: int = 0  # that it took
    reach: float | None = None  # an estimate from above
    pieces: int | None = None  # components that points were seen on
    rates: Mapping[int, float] = dataclasses.field(default_factory=dict)  # queries a second, by
    # batch size
    best_batch: int | None = None
    epsilon: float | None = None  # that "auto" stands for
    epsilon_reason: str = ""  # why it is this, or why there is none

    @classmethod
    def from_wire(cls, wire: pb.CheckReport) -> CheckReport:
        chosen = wire.HasField("epsilon")
        return cls(
            findings=tuple(map(Finding.from_wire, wire.findings)),
            samples=wire.samples,
            queries=wire.queries,
            reach=wire.reach if wire.HasField("reach") else None,
            pieces=wire.pieces if wire.HasField("pieces") else None,
            rates={rate.batch: rate.queries_per_second for rate in wire.rates},
            best_batch=wire.best_batch or None,
            epsilon=wire.epsilon if chosen else None,
            epsilon_reason=wire.epsilon_reason if chosen else wire.no_epsilon.message,
        )

    def adding(self, error: Finding) -> CheckReport:
        """This, with an error that only the client sees: then no epsilon will do."""
        ordered = sorted((error, *self.findings), key=lambda f: _ORDER.index(f.severity))
        return dataclasses.replace(
            self, findings=tuple(ordered), epsilon=None, epsilon_reason=str(error).strip()
        )

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


def shown(point: np.ndarray) -> str:
    """A point as it stands in a sentence."""
    entries = [f"{entry:.6g}" for entry in point[:6]] + ["..."] * (len(point) > 6)
    return "[" + ", ".join(entries) + "]"
