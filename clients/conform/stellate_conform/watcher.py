"""The rules of those who watch, and of those who write files: tests/conformance/README.md."""

from __future__ import annotations

import pathlib
from collections.abc import Iterator
from typing import Any

import grpc
from stellate import load_txt
from stellate._generated import mesh_pb2
from stellate._generated import stellate_pb2 as pb
from stellate._wire.arrays import to_wire

from .files import carried, entries, recorded
from .scenario import Refusal, Scenario, agree


class Declared(Scenario):
    """A mesh that clients which watch only what they declared can declare, by its name."""

    def create(self, request: Any, metadata: dict[str, str]) -> mesh_pb2.Mesh:
        return self.get()

    def serve(self, stream: Any) -> None:
        self.over.wait(self.patience)


class Recorded(Declared):
    """Streams that were recorded, or written by hand, and the mesh that they end in."""

    def __init__(self, entry: Any, folder: pathlib.Path, *arguments: Any) -> None:
        self.name, self.rules = "watcher", (f"{entry['name']}: {entry['about']}",)
        super().__init__(*arguments)
        self.entry, self.attempts = entry, list(entry["attempts"])
        self.spec.dimension = entry["dimension"]
        self.spec.ambient_dimension = entry["ambient_dimension"]
        self.spec.boundary_only = entry.get("only") == "boundary"
        self.path = folder / f"{entry['name']}.txt"
        self.complaint = ""

    @property
    def line(self) -> str:
        k, d = self.spec.dimension, self.spec.ambient_dimension
        return f"watch {self.mesh} {self.path} {k} {d}"

    def watch(self, request: pb.WatchMeshRequest) -> Iterator[pb.WatchMeshResponse]:
        if not self.attempts:
            self.complaint = "it came back after the end"
            raise Refusal(grpc.StatusCode.INVALID_ARGUMENT, self.complaint)
        attempt = self.attempts.pop(0)
        if request.from_revision != attempt["from_revision"]:
            self.complaint = f"from_revision was {request.from_revision}"
            self.complaint += f" where {attempt['from_revision']} was the last whole one"
            raise Refusal(grpc.StatusCode.INVALID_ARGUMENT, self.complaint)
        yield from recorded(attempt["file"])
        if attempt["then"] != "OK":
            raise Refusal(grpc.StatusCode[attempt["then"]], "the stream breaks here")
        self.over.set()

    def hear(self, answer: str) -> None:
        entry, rule = self.entry, self.rules[0]
        if "error" in entry:
            wanted = f"error stellateerror {entry['error']}"
        else:
            wanted = f"mesh {entry['revision']} {entry['termination']} {entry['level']}"
        if self.complaint or not agree(answer, wanted):
            self.judge(rule, False, self.complaint or f"`{answer}`", f"`{wanted}`")
        elif "mesh" in entry:
            same = same_file(self.path, entry["mesh"])
            if same[0] and "walls" in entry:
                same = same_file(self.path.with_name(self.path.name + ".walls"), entry["walls"])
            self.judge(rule, *same)
        self.judge(rule, True)


def same_file(path: pathlib.Path, file: str) -> tuple[bool, str, str]:
    """Whether a client wrote what it should have, and the first difference."""
    wanted = carried(file)
    if not path.exists():
        return False, "no file", str(path)
    said = path.read_bytes()
    if said == wanted:
        return True, "", ""
    for i, (ours, theirs) in enumerate(zip(wanted.split(b"\n"), said.split(b"\n"))):
        if ours != theirs:
            return False, f"line {i + 1} of {path.name}: {theirs[:80]!r}", repr(ours[:80])
    return False, f"{path.name} has {len(said)} bytes", f"{len(wanted)} bytes"


class Failed(Declared):
    """A mesh that ended as FAILED."""

    def __init__(self, failure: Any, folder: pathlib.Path, *arguments: Any) -> None:
        self.name, self.rules = "watcher", (f"failure {failure['reason']}",)
        super().__init__(*arguments)
        self.failure, self.path = failure, folder / "failed.txt"

    @property
    def line(self) -> str:
        return f"watch {self.mesh} {self.path} 1 2"

    def watch(self, request: pb.WatchMeshRequest) -> Iterator[pb.WatchMeshResponse]:
        mesh = mesh_pb2.Mesh(name=self.mesh, state=mesh_pb2.MESH_STATE_FAILED)
        mesh.report.failure.reason = self.failure["reason"]
        mesh.report.failure.message = "what was wrong"
        yield pb.WatchMeshResponse(final=mesh)
        self.over.set()

    def hear(self, answer: str) -> None:
        wanted = f"error {self.failure['class'].lower()} {self.failure['reason']}"
        self.judge(self.rules[0], agree(answer, wanted), f"`{answer}`", f"`{wanted}`")


class Saved(Scenario):
    """A mesh as a file, byte for byte."""

    def __init__(self, entry: Any, ending: str, folder: pathlib.Path, *arguments: Any) -> None:
        self.name, self.rules = "files", (f"{entry['name']}.{ending}",)
        super().__init__(*arguments)
        self.entry = entry
        self.given = folder / f"{entry['name']}-given.txt"
        self.given.write_bytes(carried(entry["mesh"]))
        self.path = folder / f"{entry['name']}-saved.{ending}"
        self.file = {"txt": entry["mesh"], **entry["files"]}.get(ending)

    @property
    def line(self) -> str:
        return f"save {self.given} {self.path}"

    def hear(self, answer: str) -> None:
        wanted = "saved" if self.file else "error saveerror"
        if agree(answer, wanted) and self.file:
            self.judge(self.rules[0], *same_file(self.path, self.file))
        self.judge(self.rules[0], agree(answer, wanted), f"`{answer}`", f"`{wanted}`")


class Drawn(Saved, Declared):
    """A mesh as a file of oriented simplices, as a watch tells how they are oriented."""

    @property
    def line(self) -> str:
        mesh = load_txt(self.given)
        self.spec.dimension, self.spec.ambient_dimension = mesh.dimension, mesh.ambient_dimension
        return f"watch {self.mesh} {self.path} {mesh.dimension} {mesh.ambient_dimension}"

    def watch(self, request: pb.WatchMeshRequest) -> Iterator[pb.WatchMeshResponse]:
        mesh, turned = load_txt(self.given), self.entry.get("turned")
        delta = mesh_pb2.MeshDelta(revision=1)
        delta.points.CopyFrom(to_wire(mesh.points))
        delta.added.shape[:] = mesh.simplices.shape
        delta.added.data = mesh.simplices.astype("<u4").tobytes()
        yield pb.WatchMeshResponse(delta=pb.DeltaChunk(delta=delta, complete=True))
        yield pb.WatchMeshResponse(
            orientation=mesh_pb2.Orientation(
                orientable=turned is not None, turned=bytes.fromhex(turned or "")
            )
        )
        end = mesh_pb2.Mesh(name=self.mesh, state=mesh_pb2.MESH_STATE_SUCCEEDED)
        end.report.termination = mesh_pb2.TERMINATION_CONVERGED
        end.report.certificate.level = mesh_pb2.CERTIFICATE_LEVEL_SAMPLED
        end.report.counts.vertices = len(mesh.points)
        end.report.counts.simplices = len(mesh.simplices)
        yield pb.WatchMeshResponse(final=end)
        self.over.set()

    def hear(self, answer: str) -> None:
        wanted = "mesh 1 CONVERGED SAMPLED"
        if agree(answer, wanted) and self.file:
            self.judge(self.rules[0], *same_file(self.path, self.file))
        self.judge(self.rules[0], agree(answer, wanted), f"`{answer}`", f"`{wanted}`")


def watcher_scenarios(folder: pathlib.Path, *arguments: Any) -> Iterator[Scenario]:
    for entry in entries("streams.json"):
        yield Recorded(entry, folder, *arguments)
    for failure in entries("errors.json")["failures"]:
        yield Failed(failure, folder, *arguments)


def file_scenarios(folder: pathlib.Path, *arguments: Any) -> Iterator[Scenario]:
    for entry in entries("meshes.json"):
        told = {"txt", *entry["files"], *entry.get("refused", ())}
        # What every client writes; the rest `stellate download` does.
        for ending in sorted(told & {"txt", "obj"}):
            is_drawn = ending == "obj" and "obj" in entry["files"]
            yield (Drawn if is_drawn else Saved)(entry, ending, folder, *arguments)
