"""How a mesh stands, how it ended, and what was proved of it."""

from __future__ import annotations

import dataclasses
import json
import math
import re
import textwrap
from typing import Any, Callable

import numpy as np

from . import _html
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


def _copy_fields(cls: type, message: Any) -> Any:
    """A dataclass from the message with the same plain fields."""
    values = {}
    for field in dataclasses.fields(cls):
        value = getattr(message, field.name)
        values[field.name] = tuple(value) if str(field.type) == "tuple[str, ...]" else value
    return cls(**values)


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


def _ids(array: Any) -> list[Any]:
    """Of an IndexArray, nested as its shape is."""
    ids: list[Any] = np.frombuffer(array.data, "<u4").reshape(tuple(array.shape) or 0).tolist()
    return ids


@dataclasses.dataclass(frozen=True)
class Violations:
    """Where a mesh is at fault: of each kind the first 100 that the certificate counts, ascending.

    All but `faces` are vertex ids.
    """

    # (k-1)-faces that are not in exactly two simplices, k ids each; with a boundary, the number of
    # vertices stands for what is beyond it
    faces: tuple[tuple[int, ...], ...] = ()
    links: tuple[int, ...] = ()  # whose link is no sphere
    stars: tuple[int, ...] = ()  # whose star overlaps itself
    inconsistent: tuple[int, ...] = ()  # whose star has a simplex that is not in all stars
    fibres: tuple[int, ...] = ()  # near which a normal flat fails

    @classmethod
    def from_wire(cls, message: pb.Violations) -> Violations:
        kinds = [field.name for field in dataclasses.fields(cls)]
        return cls.from_fields({kind: _ids(getattr(message, kind)) for kind in kinds})

    @classmethod
    def from_fields(cls, fields: dict[str, Any]) -> Violations:
        """Back from dataclasses.asdict(violations), or from JSON of it."""
        plain: dict[str, Any] = {kind: tuple(ids) for kind, ids in fields.items()}
        plain["faces"] = tuple(map(tuple, plain["faces"]))
        return cls(**plain)


@dataclasses.dataclass(frozen=True)
class FaceCertificate:
    """A face of a manifold with boundary: where some of its walls are 0."""

    walls: tuple[int, ...]
    dimension: int  # k - 1 of the boundary, less of edges, 0 of corners
    simplices: int
    components: int
    euler_characteristic: int
    # Of a wall of an arrangement: the labels where it is negative and where it is positive.
    label_below: int | None = None
    label_above: int | None = None
    volume: float = 0.0  # an area, a length; of corners their number
    betti: tuple[int, ...] = ()  # over Z/2, from dimension 0 on; empty: not computed

    @classmethod
    def from_fields(cls, fields: dict[str, Any]) -> FaceCertificate:
        """Back from dataclasses.asdict(face), or from JSON of it."""
        plain: dict[str, Any] = {**fields, "walls": tuple(fields["walls"])}
        plain["betti"] = tuple(plain.get("betti", ()))
        return cls(**plain)


@dataclasses.dataclass(frozen=True)
class RegionCertificate:
    """A region of an arrangement of walls: the part of the mesh with one label.

    Of the boundary alone the region's surface, except the volume.
    """

    label: int
    simplices: int
    components: int
    euler_characteristic: int
    volume: float = 0.0  # 0 of the boundary alone of what does not fill space
    min_dihedral_degrees: float = 0.0  # the least angle between two facets of a simplex
    betti: tuple[int, ...] = ()  # over Z/2, from dimension 0 on; empty: not computed

    @classmethod
    def from_fields(cls, fields: dict[str, Any]) -> RegionCertificate:
        """Back from dataclasses.asdict(region), or from JSON of it."""
        plain: dict[str, Any] = {**fields, "betti": tuple(fields.get("betti", ()))}
        return cls(**plain)


@dataclasses.dataclass(frozen=True)
class WallAngle:
    """Two walls that meet, at a vertex."""

    walls: tuple[int, ...]
    degrees: float  # between them, inside of the manifold
    point: tuple[float, ...]

    @classmethod
    def from_fields(cls, fields: dict[str, Any]) -> WallAngle:
        """Back from dataclasses.asdict(angle), or from JSON of it."""
        return cls(tuple(fields["walls"]), fields["degrees"], tuple(fields["point"]))


@dataclasses.dataclass(frozen=True)
class Protection:
    """How well a mesh is protected, in lengths.

    The gap of a simplex is how much farther than its circumradius the nearest other vertex is from its
    centre.
    """

    asked: float
    least: float  # gap; below 0: a ball is not empty
    percentile: float  # the gap that 99 % of the simplices have or exceed
    median: float
    least_ratio: float  # least gap over circumradius
    weak: int  # simplices with a smaller gap than was asked for
    worst: tuple[int, ...]  # the simplex with the least gap
    stability_radius: float  # vertices that each move by less change no simplex
    thickness_bound: float  # heights are at least this share of k times the longest edge
    # If the reach is as declared: the intrinsic and the restricted Delaunay complex of the vertices, and
    # their stars in tangent spaces, are all this mesh.
    is_delaunay: bool

    @classmethod
    def from_fields(cls, fields: dict[str, Any]) -> Protection:
        """Back from dataclasses.asdict(protection), or from JSON of it."""
        plain: dict[str, Any] = {**fields, "worst": tuple(fields["worst"])}
        return cls(**plain)

    @classmethod
    def from_wire(cls, message: pb.Protection) -> Protection:
        return cls.from_fields({f.name: getattr(message, f.name) for f in dataclasses.fields(cls)})


@dataclasses.dataclass(frozen=True)
class Certificate:
    """What was computed from the finished complex. Lengths are in the units of the coordinates."""

    certified: bool  # every claim holds and the run converged
    verdict: str  # plain words; the first thing wrong if not certified
    warnings: tuple[str, ...]
    closed: bool  # every (k-1)-face is in exactly two simplices
    bad_faces: int
    links_are_spheres: bool
    links_decided_exactly: bool  # k <= 3, or a closed mesh whose stars embed
    bad_links: int
    inconsistent_simplices: int
    unembedded_stars: int  # stars whose projection on the tangent space overlaps itself
    fibre_failures: int  # sampled normal flats that do not meet the mesh exactly once nearby
    fibre_samples: int
    max_circumradius: float
    max_radius_edge: float
    min_fatness: float  # volume / diameter^k
    min_angle_degrees: float  # k = 2 only
    max_tangent_angle_degrees: float
    max_barycentre_distance: float  # of a simplex to the manifold
    estimated_reach: float  # an estimate from above; unless `certified`, no more than a bound
    epsilon_over_reach: float
    components: int
    euler_characteristic: int
    orientable: bool
    # "REFUSED", "SAMPLED" or "PROVED": from the declared reach; of reconstructions "DECIDED" as well: a
    # manifold, but the points say too little for more, and it is not certified; else "UNKNOWN"
    level: str
    declared_reach: float  # 0: none
    reach_refuted: bool  # points of the manifold contradict it; the verdict names them
    proved_distance: float  # PROVED: bounds the Hausdorff distance to the components it meets
    answers_checked: int = 0  # answers of the whole run, besides vertices, compared with the mesh
    violations: Violations = Violations()
    # Of manifolds with boundary:
    boundary_simplices: int = 0  # of dimension k - 1
    boundary_components: int = 0
    boundary_euler_characteristic: int = 0
    faces: tuple[FaceCertificate, ...] = ()  # by dimension, the lowest first
    sharpest: WallAngle | None = None  # where walls meet at the smallest angle, if any meet
    regions: tuple[RegionCertificate, ...] = ()  # of an arrangement of walls, by label
    pinched_vertices: int = 0  # where a region touches itself in an edge or a point alone
    # Of all simplices, to which regions add up; of the boundary alone what it encloses.
    volume: float = 0.0
    only_too_coarse: bool = False  # refused for its size alone: nothing seen contradicts it
    protection: Protection | None = None  # where `protection` was asked for
    # Over Z/2, from dimension 0 on, of a closed manifold of dimension 3 or less with at most a million
    # simplices; else empty: see Mesh.betti.
    betti: tuple[int, ...] = ()


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
        failure, certificate = fields["failure"], dict(fields["certificate"])
        if "text" not in fields:  # checkpoints of earlier versions lack it
            fields = {**fields, "text": entry("certificate", certificate["verdict"])}
        certificate["warnings"] = tuple(certificate["warnings"])
        if "violations" in certificate:  # checkpoints of earlier versions lack it
            certificate["violations"] = Violations.from_fields(certificate["violations"])
        if "faces" in certificate:
            faces = map(FaceCertificate.from_fields, certificate["faces"])
            certificate["faces"] = tuple(faces)
        regions = certificate.get("regions", ())  # checkpoints of earlier versions lack it
        certificate["regions"] = tuple(map(RegionCertificate.from_fields, regions))
        if certificate.get("sharpest"):
            certificate["sharpest"] = WallAngle.from_fields(certificate["sharpest"])
        certificate["betti"] = tuple(certificate.get("betti", ()))
        if certificate.get("protection"):
            certificate["protection"] = Protection.from_fields(certificate["protection"])
        told = dict(fields.get("reconstruction") or {})  # checkpoints of earlier versions lack it
        finer = fields.get("finer")  # likewise
        if told:
            told["looks"] = tuple(told["looks"])
        more = {
            "reconstruction": ReconstructionReport(**told) if told else None,
            "failure": failure and Failure(**failure),
            "finer": FinerEpsilon(**finer) if finer else None,
            "counts": Counts(**{"inserted_protection": 0, **fields["counts"]}),
            "certificate": Certificate(**certificate),
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
            counts=_copy_fields(Counts, message.counts),
            certificate=_certificate(message.certificate),
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


def _certificate(message: pb.Certificate) -> Certificate:
    plain = _copy_fields(Certificate, message)
    violations = Violations.from_wire(message.violations)
    faces = tuple(
        FaceCertificate(
            tuple(f.walls),
            f.dimension,
            f.simplices,
            f.components,
            f.euler_characteristic,
            f.label_below if f.HasField("label_below") else None,
            f.label_above if f.HasField("label_above") else None,
            f.volume,
            tuple(f.betti),
        )
        for f in message.faces
    )
    regions = tuple(
        RegionCertificate(
            r.label,
            r.simplices,
            r.components,
            r.euler_characteristic,
            r.volume,
            r.min_dihedral_degrees,
            tuple(r.betti),
        )
        for r in message.regions
    )
    s = message.sharpest
    sharpest = None
    if message.HasField("sharpest"):
        sharpest = WallAngle(tuple(s.walls), s.degrees, tuple(s.point))
    level = enums.level(message.level)
    return dataclasses.replace(
        plain,
        level=level,
        violations=violations,
        faces=faces,
        regions=regions,
        sharpest=sharpest,
        protection=(
            Protection.from_wire(message.protection) if message.HasField("protection") else None
        ),
        betti=tuple(message.betti),
    )


def _plain_verdict(c: Certificate) -> str:
    """Without the word that says whether it is certified."""
    return re.sub(r"^((not )?certified|proved)\W+", "", c.verdict, flags=re.IGNORECASE)


def _for_json(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _for_json(entry) for key, entry in value.items()}
    if isinstance(value, tuple):
        return [_for_json(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
