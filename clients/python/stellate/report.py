"""How a mesh stands, how it ended, and what was proved of it."""

from __future__ import annotations

import dataclasses
import json
import math
import re
import textwrap
from typing import Any, Callable

from . import _html
from ._certificate import (
    Certificate,
    FaceCertificate,
    Protection,
    RegionCertificate,
    Violations,
    WallAngle,
    copy_fields,
)
from ._generated import mesh_pb2 as pb
from ._version import __version__
from ._wire import enums

__all__ = [
    "Certificate",
    "Counts",
    "FaceCertificate",
    "RegionCertificate",
    "Failure",
    "FinerEpsilon",
    "Progress",
    "Protection",
    "ReconstructionReport",
    "Report",
    "Violations",
    "WallAngle",
]


@dataclasses.dataclass(frozen=True)
class Progress:
    """A picture of a mesh at work."""

    phase: str  # "SEEDING", "REFINING", "CERTIFYING" or "DONE"; "UNKNOWN": of a newer server
    round: int  # batches of queries answered
    queries: int  # queries answered
    vertices: int
    simplices: int
    unbounded_stars: int  # stars on the advancing front
    bad_size: int  # stars with a simplex that breaks rule R1, then R2, R3, R4, R5
    bad_radius_edge: int
    bad_sliver: int
    bad_inconsistent: int
    bad_protection: int
    fraction: float  # estimated share of the work done, 0..1
    elapsed_seconds: float
    remaining_seconds: float  # an estimate; 0 when unknown

    @classmethod
    def from_wire(cls, message: pb.Progress) -> Progress:
        plain = [f.name for f in dataclasses.fields(cls) if f.name != "phase"]
        values = {name: getattr(message, name) for name in plain}
        return cls(phase=enums.phase(message.phase), **values)


@dataclasses.dataclass(frozen=True)
class Counts:
    """What a mesh took."""

    vertices: int
    simplices: int
    rounds: int  # round trips
    queries: int
    tangent_queries: int  # closest points spent on finding tangent bases
    inserted_size: int  # sample points inserted by rule R1, then R2, R3, R4, R5
    inserted_radius_edge: int
    inserted_sliver: int
    inserted_inconsistent: int
    inserted_protection: int
    duplicates: int  # answers that fell on an existing sample point


@dataclasses.dataclass(frozen=True)
class ReconstructionReport:
    """What a reconstruction found of its points. Lengths are in the units of the coordinates."""

    places: dict[str, int]  # how many points have which place, "OK", "MERGED", ...
    advice: dict[str, str]  # of those places that need some: the cause and the cure
    spacing: float  # median distance of a point to its nearest
    noise: float  # median rms distance of the points to the surface fitted to them
    noise_ratio: float  # the same in units of the local spacing
    smoothed: bool  # the complex was built on copies of the points, moved to the fitted surface
    doubtful: int  # simplices about which stars disagreed at first
    cavities: int  # the places that they made up
    tiles: int  # simplices of the tilings that filled them
    unfilled_vertices: int  # of the cavities that were left
    # The share of points around which they look of dimension 1, 2, 3, 4, and more.
    looks: tuple[float, ...]

    @classmethod
    def from_wire(cls, message: pb.ReconstructionReport) -> ReconstructionReport:
        named = [(enums.place(one.place), one) for one in message.places]
        told = {"places", "advice", "looks"}
        plain = [f.name for f in dataclasses.fields(cls) if f.name not in told]
        return cls(
            places={name: one.points for name, one in named},
            advice={name: one.advice for name, one in named if one.advice},
            looks=tuple(message.looks),
            **{name: getattr(message, name) for name in plain},
        )


@dataclasses.dataclass(frozen=True)
class Failure:
    """Why a mesh failed."""

    reason: str  # stable, e.g. "ORACLE_NOT_FINITE"
    message: str


@dataclasses.dataclass(frozen=True)
class FinerEpsilon:
    """With which epsilon to mesh again."""

    epsilon: float
    reason: str


@dataclasses.dataclass(frozen=True)
class Report:
    """The end of a mesh. `str(report)` is for people."""

    termination: str  # "CONVERGED", "VERTEX_BUDGET", "ROUND_BUDGET", "CANCELLED", ...
    failure: Failure | None
    counts: Counts
    certificate: Certificate
    elapsed_seconds: float
    epsilon: float | None = None  # that the mesh was made with; None if that is not known
    epsilon_reason: str = ""  # why it is what it is, where it was not given
    text: str = (
        ""  # all of it in several lines, for people, except epsilon; each line with its "\n"
    )
    reconstruction: ReconstructionReport | None = None  # of a mesh of points, else None
    finer: FinerEpsilon | None = None  # where this epsilon was too coarse for a certificate

    @property
    def certified(self) -> bool:
        """Whether the mesh is proved good."""
        return self.certificate.certified

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to know about the mesh, certified or not."""
        return self.certificate.warnings

    @property
    def what_failed(self) -> str:
        """The first thing that keeps the mesh from being certified; "" if it is."""
        return "" if self.certified else _plain_verdict(self.certificate)

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain values for JSON, with the names of the protocol.

        The same as the shell's --report writes, without `text` and `finer`: what is not known, infinite or
        no number is None, "failure" is there for a mesh that failed, "reconstruction" for one of points.
        """
        whole: dict[str, Any] = {"termination": self.termination}
        if self.failure is not None:
            whole["failure"] = dataclasses.asdict(self.failure)
        whole["epsilon"] = self.epsilon
        whole["epsilon_reason"] = self.epsilon_reason
        whole["counts"] = dataclasses.asdict(self.counts)
        whole["certificate"] = dataclasses.asdict(self.certificate)
        if self.reconstruction is not None:
            whole["reconstruction"] = dataclasses.asdict(self.reconstruction)
        whole["elapsed_seconds"] = self.elapsed_seconds
        whole["version"] = __version__
        return _for_json(whole)

    def to_json(self, indent: int | None = None) -> str:
        """to_dict() as a JSON text; `indent` as json.dumps takes it."""
        return json.dumps(self.to_dict(), indent=indent, ensure_ascii=False, allow_nan=False)

    @classmethod
    def from_fields(cls, fields: dict[str, Any]) -> Report:
        """Back from dataclasses.asdict(report)."""
        failure, certificate = fields["failure"], Certificate.from_fields(fields["certificate"])
        if "text" not in fields:  # checkpoints of earlier versions lack it
            fields = {**fields, "text": entry("certificate", certificate.verdict)}
        told = dict(fields.get("reconstruction") or {})  # checkpoints of earlier versions lack it
        finer = fields.get("finer")  # likewise
        if told:
            told["looks"] = tuple(told["looks"])
        more = {
            "reconstruction": ReconstructionReport(**told) if told else None,
            "failure": failure and Failure(**failure),
            "finer": FinerEpsilon(**finer) if finer else None,
            "counts": Counts(**{"inserted_protection": 0, **fields["counts"]}),
            "certificate": certificate,
        }
        return cls(**{**fields, **more})

    @classmethod
    def from_wire(cls, message: pb.Report, epsilon: float | None = None) -> Report:
        failure = None
        if message.HasField("failure"):
            failure = Failure(message.failure.reason, message.failure.message)
        return cls(
            termination=enums.termination(message.termination),
            failure=failure,
            counts=copy_fields(Counts, message.counts),
            certificate=Certificate.from_wire(message.certificate),
            elapsed_seconds=message.elapsed_seconds,
            epsilon=epsilon,
            text=message.text,
            reconstruction=(
                ReconstructionReport.from_wire(message.reconstruction)
                if message.HasField("reconstruction")
                else None
            ),
            finer=(
                FinerEpsilon(message.finer.epsilon, message.finer.reason)
                if message.HasField("finer")
                else None
            ),
        )

    def refused(self, why: str) -> Report:
        """For a reason that the client knows better than the server, which goes in place of its."""
        certificate = dataclasses.replace(self.certificate, verdict=f"not certified: {why}")
        mine = {"certificate": f"NOT CERTIFIED: {why}"}  # other titles may come again and again
        text = "".join(entry(title, mine.get(title, said)) for title, said in self.lines())
        return dataclasses.replace(self, certificate=certificate, text=text)

    def with_line(self, title: str, words: str) -> Report:
        """With a line more at its end, and its words at the end of the verdict."""
        verdict = f"{self.certificate.verdict}; {words}"
        certificate = dataclasses.replace(self.certificate, verdict=verdict)
        text = self.text.rstrip("\n") + "\n" + entry(title, words)
        return dataclasses.replace(self, certificate=certificate, text=text)

    def reworded(self, words: Callable[[str], str]) -> Report:
        """With `words` of all that the server says in sentences: the verdict, warnings, a failure."""
        c, failure = self.certificate, self.failure
        warnings = tuple(map(words, c.warnings))
        certificate = dataclasses.replace(c, verdict=words(c.verdict), warnings=warnings)
        if failure is not None:
            failure = dataclasses.replace(failure, message=words(failure.message))
        text = ""
        for title, said in dataclasses.replace(self, epsilon_reason="").lines():
            before = said.replace("\n", " ")
            after = words(before)
            as_it_was = f"{title:>{_TITLE_WIDTH}}  " + said.replace("\n", "\n" + _MARGIN) + "\n"
            text += as_it_was if after == before else entry(title, after)
        return dataclasses.replace(self, failure=failure, certificate=certificate, text=text)

    def __str__(self) -> str:
        why = f"{self.epsilon:g}, {self.epsilon_reason}" if self.epsilon_reason else ""
        return (self.text + (entry("epsilon", why) if why else "")).rstrip("\n")

    def _repr_html_(self) -> str:
        marks = {"failure": "bad", "warning": "mind"}
        marks["certificate"] = "good" if self.certified else "bad"
        rows = [(title, words, marks.get(title, "")) for title, words in self.lines()]
        return _html.table("Stellate: report", rows)

    def lines(self) -> list[tuple[str, str]]:
        """What str() says, as (title, words)."""
        lines: list[tuple[str, str]] = []
        for line in str(self).splitlines():
            title, words = line[:_TITLE_WIDTH].strip(), line[_TITLE_WIDTH + 2 :]
            if title or not lines:
                lines.append((title, words))
            else:
                lines[-1] = (lines[-1][0], f"{lines[-1][1]}\n{words}")
        return lines


_TITLE_WIDTH = 13  # of the server's lines
_MARGIN = " " * (_TITLE_WIDTH + 2)  # before what is folded


def entry(title: str, words: str) -> str:
    """A line of a report, folded as the server folds its own."""
    lines = textwrap.wrap(words, 85, break_long_words=False, break_on_hyphens=False)
    return f"{title:>{_TITLE_WIDTH}}  " + f"\n{_MARGIN}".join(lines) + "\n"


def _plain_verdict(c: Certificate) -> str:
    """Without the word that says whether it is certified."""
    return re.sub(r"^((not )?certified|proved)\W+", "", c.verdict, flags=re.IGNORECASE)


def _for_json(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _for_json(entry) for key, entry in value.items()}
    if isinstance(value, tuple):
        return [_for_json(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
