"""Events of a watch, made by hand."""

from __future__ import annotations

import numpy as np
from fake_server import indices
from stellate._generated import mesh_pb2, stellate_pb2
from stellate._wire.arrays import to_wire

Event = stellate_pb2.WatchMeshResponse


def delta(
    revision, first=0, points=(), added=(), removed=(), complete=True, walls=(), labels=()
) -> Event:
    """`walls`: pairs of a vertex and its walls as bits. `labels`: of the added simplices."""
    body = mesh_pb2.MeshDelta(revision=revision, first_vertex=first)
    if len(points):
        body.points.CopyFrom(to_wire(np.asarray(points, dtype=float)))
    if len(added):
        body.added.CopyFrom(indices(added))
    if len(removed):
        body.removed.CopyFrom(indices(removed))
    body.boundary_vertices.extend(vertex for vertex, _ in walls)
    body.boundary_walls.extend(bits for _, bits in walls)
    body.added_labels = bytes(labels)
    return Event(delta=stellate_pb2.DeltaChunk(delta=body, complete=complete))


def orientation(turned=b"", first=0, orientable=True) -> Event:
    return Event(
        orientation=mesh_pb2.Orientation(
            orientable=orientable, first_simplex=first, turned=bytes(turned)
        )
    )


def final(vertices=0, simplices=0, state="SUCCEEDED", termination="CONVERGED", level="SAMPLED"):
    """`state` and the others may be numbers."""

    def number(enum, prefix, value):
        return value if isinstance(value, int) else enum.Value(prefix + value)

    mesh = mesh_pb2.Mesh(
        name="meshes/recorded", state=number(mesh_pb2.MeshState, "MESH_STATE_", state)
    )
    report = mesh.report
    report.termination = number(mesh_pb2.Termination, "TERMINATION_", termination)
    report.counts.vertices, report.counts.simplices = vertices, simplices
    report.certificate.level = number(mesh_pb2.CertificateLevel, "CERTIFICATE_LEVEL_", level)
    mesh.progress.phase = mesh_pb2.PHASE_DONE
    return Event(final=mesh)
