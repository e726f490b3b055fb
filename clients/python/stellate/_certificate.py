"""What was proved of a mesh: its certificate, and the parts of that."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from ._generated import mesh_pb2 as pb
from ._wire import enums


def copy_fields(cls: type, message: Any) -> Any:
    """A dataclass from the message with the same plain fields."""
    values = {}
    for field in dataclasses.fields(cls):
        value = getattr(message, field.name)
        values[field.name] = tuple(value) if str(field.type) == "tuple[str, ...]" else value
    return cls(**values)


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

    @classmethod
    def from_fields(cls, fields: dict[str, Any]) -> Certificate:
        """Back from dataclasses.asdict(certificate), or from JSON of it.

        Checkpoints of earlier versions lack some fields.
        """
        plain = dict(fields)
        plain["warnings"] = tuple(plain["warnings"])
        if "violations" in plain:
            plain["violations"] = Violations.from_fields(plain["violations"])
        plain["faces"] = tuple(map(FaceCertificate.from_fields, plain.get("faces", ())))
        plain["regions"] = tuple(map(RegionCertificate.from_fields, plain.get("regions", ())))
        if plain.get("sharpest"):
            plain["sharpest"] = WallAngle.from_fields(plain["sharpest"])
        plain["betti"] = tuple(plain.get("betti", ()))
        if plain.get("protection"):
            plain["protection"] = Protection.from_fields(plain["protection"])
        return cls(**plain)

    @classmethod
    def from_wire(cls, message: pb.Certificate) -> Certificate:
        plain = copy_fields(cls, message)
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
