"""What a server says of a mesh and of itself."""

from __future__ import annotations

import dataclasses
import datetime
from typing import Any

from ._generated import mesh_pb2
from ._generated import stellate_pb2 as pb
from ._mesh import Mesh
from ._wire import enums
from .errors import Cancelled, error_class
from .report import Progress, Report


@dataclasses.dataclass(frozen=True)
class MeshInfo:
    """A mesh on the server, without its geometry."""

    name: str  # "meshes/<unguessable>"
    # "WAITING", "RUNNING", "SUCCEEDED", "STOPPED", "CANCELLED", "FAILED"; "UNKNOWN": a newer one
    state: str
    label: str
    dimension: int  # of its simplices
    ambient_dimension: int
    epsilon: float
    create_time: datetime.datetime | None
    end_time: datetime.datetime | None
    revision: int
    progress: Progress
    report: Report | None  # once it is over
    workers: int
    watchers: int
    owner: str = ""  # known to administrators of the server alone
    boundary_only: bool = False  # its simplices are those of the boundary, each with two labels
    region_names: tuple[str, ...] = ()  # of the labels 1, 2, ...; "": none
    scale: tuple[
        float, ...
    ] = ()  # d lengths: what is meshed is x / scale, and its points come in x

    @property
    def over(self) -> bool:
        """Whether it has come to its end: nothing changes from here on."""
        return self.state not in ("WAITING", "RUNNING")

    @classmethod
    def from_wire(cls, mesh: mesh_pb2.Mesh) -> MeshInfo:
        def at(field: str) -> datetime.datetime | None:
            if not mesh.HasField(field):
                return None
            return getattr(mesh, field).ToDatetime(tzinfo=datetime.timezone.utc)

        report = None
        if mesh.HasField("report"):
            report = Report.from_wire(mesh.report, mesh.spec.epsilon or None)
        return cls(
            name=mesh.name,
            state=enums.state(mesh.state),
            label=mesh.spec.label,
            dimension=mesh.spec.dimension - mesh.spec.boundary_only,
            ambient_dimension=mesh.spec.ambient_dimension,
            epsilon=mesh.spec.epsilon,
            create_time=at("create_time"),
            end_time=at("end_time"),
            revision=mesh.revision,
            progress=Progress.from_wire(mesh.progress),
            report=report,
            workers=mesh.workers,
            watchers=mesh.watchers,
            owner=mesh.owner,
            boundary_only=mesh.spec.boundary_only,
            region_names=tuple(mesh.spec.region_names),
            scale=tuple(mesh.spec.scale),
        )


@dataclasses.dataclass(frozen=True)
class ServerInfo:
    """What a server is and allows."""

    version: str
    protocols: tuple[str, ...]
    max_dimension: int
    max_ambient_dimension: int
    max_vertices: int
    max_rounds: int
    max_meshes: int
    max_message_bytes: int
    owner_meshes: int  # of one owner at a time, where the server tells owners apart
    max_memory_bytes: int  # of all meshes, as the server estimates it
    owner_memory_bytes: int  # of one owner's meshes
    max_workers: int  # of one mesh
    max_watchers: int  # of one mesh, downloads included
    check_share: float  # of the queries, asked of two workers to compare the answers

    @classmethod
    def from_wire(cls, message: pb.ServerInfo) -> ServerInfo:
        names = (field.name for field in dataclasses.fields(cls))
        values: dict[str, Any] = {name: getattr(message, name) for name in names}
        values["protocols"] = tuple(message.protocols)
        return cls(**values)


def unless_failed(mesh: Mesh, info: MeshInfo) -> None:
    """Raises: Cancelled, or how the mesh failed, by what the server says, with the mesh."""
    if info.state == "CANCELLED":
        raise Cancelled("the mesh was cancelled", mesh=mesh)
    if info.state == "FAILED":
        failure = info.report.failure if info.report is not None else None
        reason = failure.reason if failure else "ORACLE_FAILED"
        message = failure.message if failure else "the mesh failed, and the server does not say why"
        raise error_class(reason)(message, reason, mesh=mesh)
