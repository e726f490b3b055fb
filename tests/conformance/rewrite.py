"""Writes the files of this folder anew; README.md says what they are."""

from __future__ import annotations

import json
import pathlib
import struct
import sys

import numpy as np

_HERE = pathlib.Path(__file__).resolve().parent
_ROOT = _HERE.parents[1]
sys.path.insert(0, str(_ROOT / "clients" / "python"))
sys.path.insert(0, str(_ROOT / "tests" / "clients" / "python"))

import grpc  # noqa: E402
import shapes  # noqa: E402
import stellate  # noqa: E402
from handmade_events import Event, delta, final, orientation  # noqa: E402
from python_client import named  # noqa: E402
from stellate import manifolds  # noqa: E402
from stellate._generated import errors_pb2, mesh_pb2, stellate_pb2  # noqa: E402
from stellate._generated import status_details_pb2 as details_pb  # noqa: E402
from stellate._shared import table  # noqa: E402
from stellate.errors import error_class, exit_status  # noqa: E402


def write_json(name: str, value: object) -> None:
    (_HERE / name).write_text(json.dumps(value, indent=1) + "\n")


# Streams ------------------------------------------------------------------------------------------


def write_stream(name: str, messages: list[bytes]) -> str:
    path = f"streams/{name}.watch"
    (_HERE / path).write_bytes(b"".join(struct.pack("<I", len(m)) + m for m in messages))
    return path


def record(oracle: object, epsilon: float, **criteria: object) -> tuple[list[Event], stellate.Mesh]:
    """A mesh's whole stream, from a real server."""
    with stellate.Server() as server, stellate.Client(server) as client:
        name = client.create(oracle, epsilon, **criteria).name
        watch = client.watch(name)
        first = next(watch)
        client.serve(oracle, name)
        events = [first, *watch]
        events = [event for event in events if event.WhichOneof("event") != "progress"]
        last = events[-1].final  # without what differs from run to run
        last.name = "meshes/recorded"
        for field in ("create_time", "end_time", "workers", "watchers"):
            last.ClearField(field)
        for message in (last.progress, last.report):
            message.elapsed_seconds = 0
        last.report.ClearField("text")  # it tells the time
        return events, stellate.download(name, server=client)


# A field of the number 99 that holds two bytes: what a newer server may send anywhere.
UNKNOWN_FIELD = b"\x9a\x06\x02hi"
TRIANGLE = [[1.0, 0], [-0.5, 0.75], [-0.5, -0.75]]
EDGES = [[0, 1], [0, 2], [1, 2]]


class Streams:
    def __init__(self) -> None:
        self.entries: list[dict[str, object]] = []

    def add(self, name, about, k, d, attempts, mesh=None, ends=("SUCCEEDED", "CONVERGED", "SAMPLED"),
            error=None, revision=0, only=None) -> None:  # fmt: skip
        """attempts: (from_revision, messages, then)."""
        entry = {"name": name, "about": about, "dimension": k, "ambient_dimension": d}
        if only:
            entry["only"] = only
        entry["attempts"] = []
        for i, (start, messages, then) in enumerate(attempts):
            raw = [m if isinstance(m, bytes) else m.SerializeToString() for m in messages]
            path = write_stream(name if len(attempts) == 1 else f"{name}-{i + 1}", raw)
            entry["attempts"].append({"from_revision": start, "file": path, "then": then})
        if error is not None:
            entry["error"] = error
        else:
            entry["mesh"] = f"streams/{name}.txt"
            mesh.save(_HERE / entry["mesh"])
            if mesh.walls is not None:
                entry["walls"] = f"streams/{name}.walls"
                lines = "".join(f"{bits}\n" for bits in mesh.walls)
                (_HERE / entry["walls"]).write_text(lines)
            entry["revision"] = revision
            entry["state"], entry["termination"], entry["level"] = ends
        self.entries.append(entry)

    def recorded(self, name, about, oracle, epsilon, cut=False, **criteria) -> None:
        events, mesh = record(oracle, epsilon, **criteria)
        last = events[-1].final
        ends = (
            mesh_pb2.MeshState.Name(last.state).removeprefix("MESH_STATE_"),
            mesh.report.termination,
            mesh.report.certificate.level,
        )
        attempts = [(0, events, "OK")]
        if cut:
            deltas = [i for i, event in enumerate(events) if event.HasField("delta")]
            middle = deltas[len(deltas) // 2]
            before = events[deltas[len(deltas) // 2 - 1]].delta.delta.revision
            torn = Event()
            torn.CopyFrom(events[middle])
            torn.delta.complete = False
            attempts = [
                (0, [*events[:middle], torn], "UNAVAILABLE"),
                (before, [], "UNAVAILABLE"),
                (before, events[middle:], "OK"),
            ]
        k, d = oracle.dimension, oracle.ambient_dimension
        self.add(name, about, k, d, attempts, mesh, ends, revision=last.revision)


def write_streams() -> None:
    streams = Streams()
    sphere = manifolds.Sphere
    streams.recorded("torus", "a surface of space", manifolds.Torus(), 0.4)
    streams.recorded("curve", "a circle", sphere(1), 0.3)
    streams.recorded("sphere-3", "dimension 3 in R^4", sphere(3), 0.8)
    streams.recorded(
        "clifford", "a surface in R^4, the stream broken twice within a revision",
        manifolds.ProductOfCircles(), 0.7, cut=True,
    )  # fmt: skip
    streams.recorded(
        "budget", "stopped: a complex that is not closed", manifolds.Torus(), 0.4, max_vertices=60
    )
    streams.recorded("lune", "a surface with boundary: two walls that meet", named("lune"), 0.4)
    triangle = stellate.Mesh(np.array(TRIANGLE), np.array(EDGES))
    end = final(3, 3)

    def made(name, about, attempts, mesh=triangle, **more) -> None:
        more.setdefault("revision", 1)
        streams.add(name, about, 1, 2, attempts, mesh, **more)

    def refused(name, about, messages, reason="PROTOCOL") -> None:
        streams.add(name, about, 1, 2, [(0, messages, "OK")], error=reason)

    whole = delta(1, 0, TRIANGLE, EDGES)
    pieces = [
        delta(1, 0, TRIANGLE[:1], complete=False),
        delta(1, 1, TRIANGLE[1:], EDGES[2:], complete=False),
        delta(1, added=EDGES[:2]),
    ]
    made("chunks", "one revision in three chunks", [(0, [*pieces, end], "OK")])
    made(
        "comes-back", "a simplex that goes and comes back in one chunk",
        [(0, [whole, delta(2, added=EDGES[1:2], removed=EDGES[1:2]), end], "OK")], revision=2,
    )  # fmt: skip
    lost = [
        (0, [whole, delta(3, removed=EDGES[:1], complete=False)], "UNAVAILABLE"),
        (1, [delta(3, removed=EDGES[:1]), delta(4, added=EDGES[:1]), end], "OK"),
    ]
    made("torn", "a chunk that is sent again, and revisions that are merged", lost, revision=4)
    made(
        "reset", "the server begins anew after the client had more",
        [(0, [delta(1, 0, [[9.0, 9.0]]), delta(5, 1, [[8.0, 8.0]], [[0, 1]]),
              Event(reset_mesh=stellate_pb2.ResetMesh()), whole, end], "OK")],
    )  # fmt: skip
    path = stellate.Mesh(np.array(TRIANGLE), np.array(EDGES[:2]), walls=np.array([0, 2, 5], "u8"))
    ends = [
        delta(1, 0, TRIANGLE[:2], EDGES[:1], complete=False, walls=[(1, 2)]),
        delta(1, 2, TRIANGLE[2:], EDGES[1:2], walls=[(2, 5)]),
    ]
    made(
        "walls", "walls of vertices, after chunks that were lost and a mesh that was begun anew",
        [(0, [delta(1, 0, TRIANGLE[:1], walls=[(0, 1)]), delta(2, 1, TRIANGLE[1:], complete=False,
              walls=[(2, 7)])], "UNAVAILABLE"),
         (1, [Event(reset_mesh=stellate_pb2.ResetMesh()), *ends, final(3, 2)], "OK")], path,
    )  # fmt: skip
    corners = np.column_stack([TRIANGLE, np.zeros(3)])
    outline = stellate.Mesh(corners, np.array(EDGES), walls=np.array([1, 1, 3], "u8"))
    streams.add(
        "outline", "the boundary alone of a surface in space: simplices of one dimension less", 2, 3,
        [(0, [delta(1, 0, corners[:2], EDGES[:1], walls=[(0, 1), (1, 1)], labels=[1, 0])], "UNAVAILABLE"),
         (1, [delta(2, 2, corners[2:], EDGES, EDGES[:1], walls=[(2, 3)], labels=[0, 1, 1, 0, 1, 2]),
              final(3, 3)], "OK")],
        outline, revision=2, only="boundary",
    )  # fmt: skip
    newer = [
        UNKNOWN_FIELD,
        whole.SerializeToString() + UNKNOWN_FIELD,
        Event(progress=mesh_pb2.Progress(phase=99)),
        final(3, 3, 99, 99, 99).SerializeToString() + UNKNOWN_FIELD,
    ]
    made(
        "newer", "events, fields and enum values of a newer server", [(0, newer, "OK")],
        ends=("UNKNOWN",) * 3,
    )  # fmt: skip
    nothing = stellate.Mesh(np.empty((0, 2)), np.empty((0, 2), dtype=np.int64))
    made(
        "empty", "cancelled before there was anything", [(0, [final(0, 0, "CANCELLED", "CANCELLED", "REFUSED")], "OK")],
        nothing, ends=("CANCELLED", "CANCELLED", "REFUSED"), revision=0,
    )  # fmt: skip
    ring = shuffled(shapes.polygon(20), 2)
    bits = bytes.fromhex(turned(ring))
    grown = delta(1, 0, ring.points, ring.simplices)
    made(
        "oriented", "an orientation in chunks, torn, and one that is overtaken by a change",
        [(0, [grown, orientation(bits[:1]), orientation(bits[1:2], 8)], "UNAVAILABLE"),
         (1, [delta(2, removed=ring.simplices[:1]), orientation(b"\0\0\0"),
              delta(3, added=ring.simplices[:1]), orientation(bits[:2]),
              orientation(bits[2:], 16), final(20, 20)], "OK")],
        ring, revision=3,
    )  # fmt: skip
    made(
        "not-oriented", "a mesh that has no orientation",
        [(0, [whole, orientation(orientable=False), end], "OK")],
    )  # fmt: skip
    refused("few-bits", "an orientation of too few simplices",
            [grown, orientation(bits[:1]), final(20, 20)])  # fmt: skip
    refused("bits-missing", "an orientation that leaves simplices out",
            [grown, orientation(bits[:1]), orientation(bits[2:], 16), final(20, 20)])  # fmt: skip
    refused("backwards", "a revision that is not after the last", [whole, whole, end])
    refused(
        "gap", "vertices that do not follow on those before", [delta(1, 5, TRIANGLE, EDGES), end]
    )
    refused(
        "stranger",
        "a simplex with a vertex that was not sent",
        [delta(1, 0, TRIANGLE, [[0, 7]]), final(3, 1)],
    )
    refused(
        "absent",
        "a simplex goes that is not there",
        [delta(1, 0, TRIANGLE, EDGES, [[0, 2], [0, 2]]), final(3, 1)],
    )
    refused(
        "twice",
        "a simplex comes that is there already",
        [delta(1, 0, TRIANGLE, EDGES), delta(2, added=EDGES[:1]), final(3, 4)],
    )
    refused(
        "strange-walls", "walls of a vertex that was not sent",
        [delta(1, 0, TRIANGLE, EDGES, walls=[(0, 1), (3, 1)]), end],
    )  # fmt: skip
    fewer = delta(1, 0, TRIANGLE, EDGES, walls=[(0, 1), (2, 1)])
    del fewer.delta.delta.boundary_walls[1]
    refused("fewer-walls", "fewer walls than vertices that lie on them", [fewer, end])
    wrong = delta(1, 0, TRIANGLE, EDGES)
    wrong.delta.delta.points.shape[:] = [2, 3]
    refused("shape", "an array of the wrong shape", [wrong, end])
    short = delta(1, 0, TRIANGLE, EDGES)
    short.delta.delta.added.data = short.delta.delta.added.data[:-4]
    refused("short", "an array with fewer bytes than its shape says", [short, end])
    write_json("streams.json", streams.entries)


# Files --------------------------------------------------------------------------------------------


def shuffled(mesh: stellate.Mesh, seed: int) -> stellate.Mesh:
    """The same with other ids, so that neighbours disagree."""
    order = np.random.default_rng(seed).permutation(len(mesh.points))
    points = np.empty_like(mesh.points)
    points[order] = mesh.points
    rows = np.sort(order[mesh.simplices], axis=1)
    return stellate.Mesh(points, rows[np.lexsort(rows.T[::-1])])


def turned(mesh: stellate.Mesh) -> str | None:
    """As Orientation.turned, in hexadecimal digits; None: not orientable."""
    oriented = mesh.oriented_simplices()
    if oriented is None:
        return None
    return np.packbits(oriented[:, -1] < oriented[:, -2], bitorder="little").tobytes().hex()


def together(*meshes: stellate.Mesh) -> stellate.Mesh:
    points = np.concatenate([mesh.points for mesh in meshes])
    first = np.cumsum([0, *(len(mesh.points) for mesh in meshes)])
    rows = np.concatenate([m.simplices + n for m, n in zip(meshes, first)])
    return stellate.Mesh(points, rows[np.lexsort(rows.T[::-1])])


def moved(mesh: stellate.Mesh, factor: float, by: object) -> stellate.Mesh:
    return stellate.Mesh(factor * mesh.points + np.asarray(by), mesh.simplices)


def write_meshes() -> None:
    torus, odd = shuffled(shapes.torus(5, 4), 7), shapes.polygon(3)
    odd.points[:] = [[-0.0, 1e-310], [1e22, 1 / 3], [-1234567.875, 1e-5]]
    tetrahedra = stellate.Mesh(
        np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0], [1, 1, 1]]),
        np.array([[0, 1, 2, 3], [1, 2, 3, 4]]),
    )
    fan = stellate.Mesh(tetrahedra.points, np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]]))
    cases = {
        "torus": (torus, "a surface of space whose rows disagree"),
        "open": (stellate.Mesh(torus.points, torus.simplices[3:]), "with a boundary"),
        "nested": (
            together(torus, moved(shuffled(shapes.torus(4, 3), 3), 0.1, [1.0, 0, 0])),
            "two components, each with its normals outwards",
        ),
        "polygon": (shuffled(shapes.polygon(7), 1), "a curve of the plane"),
        "knot": (shuffled(shapes.polygon(6, 3), 5), "a curve of space: no hypersurface"),
        "numbers": (odd, "minus zero, a subnormal, large and small"),
        "plane": (together(shapes.projective_plane(3)), "not orientable"),
        "fan": (fan, "three triangles at an edge"),
        "clifford": (stellate.Mesh(np.eye(6, 4) + 0.25, shapes.projective_plane(4).simplices), "R^4"),
        "solid": (tetrahedra, "tetrahedra of space"),
        "sphere-3": (shapes.simplex_boundary(3), "a hypersurface of R^4"),
    }  # fmt: skip
    entries = []
    for name, (mesh, about) in cases.items():
        entry = {"name": name, "about": about, "mesh": f"meshes/{name}.txt", "files": {}}
        if (bits := turned(mesh)) is not None:
            entry["turned"] = bits
        mesh.save(_HERE / entry["mesh"])
        for ending in ("off", "obj", "ply", "msh", "stl"):
            if name == "solid" and ending != "msh":
                continue  # its surface, its triangles in any order, or refused by clients without it
            path = f"meshes/{name}.{ending}"
            try:
                mesh.save(_HERE / path)
                entry["files"][ending] = path
            except stellate.SaveError:
                entry.setdefault("refused", []).append(ending)
        entries.append(entry)
    write_json("meshes.json", entries)


# Errors -------------------------------------------------------------------------------------------

# The codes that the comments of errors.proto name; INVALID_ARGUMENT for ORACLE_ reasons.
CODE_OF = {
    "INVALID_ARGUMENT": "INVALID_ARGUMENT",
    "LIMIT_EXCEEDED": "RESOURCE_EXHAUSTED",
    "MESH_NOT_FOUND": "NOT_FOUND",
    "FAILED_PRECONDITION": "FAILED_PRECONDITION",
    "OUT_OF_ORDER": "INVALID_ARGUMENT",
    "SHUTTING_DOWN": "UNAVAILABLE",
    "REVISION_TOO_NEW": "OUT_OF_RANGE",
    "UNAUTHENTICATED": "UNAUTHENTICATED",
    "INTERNAL": "INTERNAL",
    "ORACLE_FAILED": "ABORTED",
}


def details(code: int, message: str, reason: str, field: str = "") -> str:
    status = details_pb.Status(code=code, message=message)
    info = details_pb.ErrorInfo(reason=reason, domain="stellate.v1")
    info.metadata["limit"] = "max-meshes"
    status.details.add(
        type_url="type.googleapis.com/google.rpc.ErrorInfo",
        value=info.SerializeToString(deterministic=True),
    )
    if field:
        request = details_pb.BadRequest()
        request.field_violations.add(field=field, description="must be positive")
        status.details.add(
            type_url="type.googleapis.com/google.rpc.BadRequest",
            value=request.SerializeToString(deterministic=True),
        )
    return status.SerializeToString(deterministic=True).hex()


def judged(reason: str, code: str) -> dict[str, object]:
    kind = error_class(reason, code)
    return {
        "reason": reason,
        "class": kind.__name__,
        "fault": table("errors.toml")["classes"][kind.__name__],
        "exit_status": exit_status(kind("")),
    }


def write_errors() -> None:
    prefix = "ERROR_REASON_"
    names = [name.removeprefix(prefix) for name in errors_pb2.ErrorReason.keys()]
    reasons = [name for name in names if name != "UNSPECIFIED"]
    numbers = {code.name: code.value[0] for code in grpc.StatusCode}
    statuses = []
    for reason in [*reasons, "ORACLE_OF_TOMORROW", "REASON_OF_TOMORROW"]:
        oracle = reason.startswith("ORACLE_")
        code = CODE_OF.get(reason, "INVALID_ARGUMENT" if oracle else "RESOURCE_EXHAUSTED")
        number, message = numbers[code], f"what the server says of {reason}"
        field = "epsilon" if reason == "INVALID_ARGUMENT" else ""
        entry = {"code": number, "message": message}
        entry["details"] = details(number, message, reason, field)
        if field:
            entry["fields"] = {field: "must be positive"}
        statuses.append({**entry, **judged(reason, code)})
    for code, number in numbers.items():
        if code != "OK":
            entry = {"code": number, "message": "no details", "details": ""}
            statuses.append({**entry, **judged("", code)})
    foreign = details_pb.Status(code=3, message="of a proxy")
    info = details_pb.ErrorInfo(reason="MESH_NOT_FOUND", domain="example.org")
    foreign.details.add(
        type_url="type.googleapis.com/google.rpc.ErrorInfo", value=info.SerializeToString()
    )
    for raw in (foreign.SerializeToString(), b"\xff\xff\xff"):
        entry = {"code": 3, "message": "details that are not the server's", "details": raw.hex()}
        statuses.append({**entry, **judged("", "INVALID_ARGUMENT")})
    failures = [judged(reason, "") for reason in [*reasons, "ORACLE_OF_TOMORROW", "TOMORROW"]]
    write_json("errors.json", {"statuses": statuses, "failures": failures})


def main() -> None:
    for folder in ("streams", "meshes"):
        (_HERE / folder).mkdir(exist_ok=True)
        for old in (_HERE / folder).iterdir():
            old.unlink()
    write_errors()
    write_meshes()
    write_streams()


if __name__ == "__main__":
    main()
