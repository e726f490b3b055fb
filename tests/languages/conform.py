"""A client in another language against the files of tests/conformance.

    conform.py COMMAND [ARGUMENT]...

COMMAND is run with the address of a server that replays the recorded streams and statuses, and obeys
the lines of its standard input, each with one line of answer:

    watch NAME PATH   watches the mesh, saves it to PATH: "mesh REVISION TERMINATION LEVEL", also if the
                      mesh was cancelled, or "error CLASS REASON"
    save MESH PATH    reads the .txt file MESH and saves it to PATH: "saved", or "error CLASS REASON"
    create LABEL      declares any mesh with the label: "error CLASS REASON"

Classes may be written as a language likes to, without spaces: case and underscores do not count.
"""

from __future__ import annotations

import json
import pathlib
import struct
import subprocess
import sys
import tempfile

_ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(_ROOT / "clients" / "python"))
sys.path.insert(0, str(_ROOT / "tests" / "clients" / "python"))

import grpc  # noqa: E402
import stellate  # noqa: E402, F401  (makes the stubs)
from fake_server import FakeServer, serving  # noqa: E402
from stellate._generated import mesh_pb2, stellate_pb2  # noqa: E402

_KIT = _ROOT / "tests" / "conformance"
_SHORT = {"oracle": "oracleerror", "other": "stellateerror", "save": "saveerror"}


def recorded(path: str):
    raw, at = (_KIT / path).read_bytes(), 0
    while at < len(raw):
        (size,) = struct.unpack_from("<I", raw, at)
        yield stellate_pb2.WatchMeshResponse.FromString(raw[at + 4 : at + 4 + size])
        at += 4 + size


class Replay(FakeServer):
    """Streams by the name "meshes/ENTRY", failures as "meshes/failure-I", statuses as labels."""

    def __init__(self, streams, errors):
        super().__init__()
        self.entries = {f"meshes/{entry['name']}": entry for entry in streams}
        self.attempts = {name: list(entry["attempts"]) for name, entry in self.entries.items()}
        self.errors = errors

    def GetServerInfo(self, request, context):
        return stellate_pb2.ServerInfo()

    def GetMesh(self, request, context):
        entry = self.entries.get(request.name, {"dimension": 1, "ambient_dimension": 2})
        spec = mesh_pb2.MeshSpec(
            dimension=entry["dimension"], ambient_dimension=entry["ambient_dimension"]
        )
        return mesh_pb2.Mesh(name=request.name, spec=spec, state=mesh_pb2.MESH_STATE_RUNNING)

    def CreateMesh(self, request, context):
        status = self.errors["statuses"][int(request.spec.label)]
        details = bytes.fromhex(status["details"])
        if details:
            context.set_trailing_metadata((("grpc-status-details-bin", details),))
        code = next(code for code in grpc.StatusCode if code.value[0] == status["code"])
        context.abort(code, status["message"])

    def WatchMesh(self, request, context):
        if request.name.startswith("meshes/failure-"):
            failure = self.errors["failures"][int(request.name.split("-")[-1])]
            mesh = mesh_pb2.Mesh(name=request.name, state=mesh_pb2.MESH_STATE_FAILED)
            mesh.report.failure.reason = failure["reason"]
            mesh.report.failure.message = "what was wrong"
            yield stellate_pb2.WatchMeshResponse(final=mesh)
            return
        attempt = self.attempts[request.name].pop(0)
        if request.from_revision != attempt["from_revision"]:
            words = f"from_revision {request.from_revision}, not {attempt['from_revision']}"
            context.abort(grpc.StatusCode.INVALID_ARGUMENT, words)
        yield from recorded(attempt["file"])
        if attempt["then"] != "OK":
            context.abort(grpc.StatusCode[attempt["then"]], "the stream breaks here")


def canonical(line: str) -> str:
    words = line.split()
    if words[:1] == ["error"]:
        name = words[1].lower().replace("_", "")
        words[1] = _SHORT.get(name, name)
    return " ".join(words)


def same(path: pathlib.Path, file: str) -> bool:
    return path.exists() and path.read_bytes() == (_KIT / file).read_bytes()


def wanted(entry) -> str:
    if "error" in entry:
        return f"error stellateerror {entry['error']}"
    return f"mesh {entry['revision']} {entry['termination']} {entry['level']}"


def main() -> int:
    streams = json.loads((_KIT / "streams.json").read_text())
    errors = json.loads((_KIT / "errors.json").read_text())
    meshes = json.loads((_KIT / "meshes.json").read_text())
    wrong = []
    with tempfile.TemporaryDirectory() as folder, serving(Replay(streams, errors)) as address:
        client = subprocess.Popen(
            [*sys.argv[1:], address], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

        def ask(line: str, answer: str, *, any_reason: bool = False) -> None:
            print(line, file=client.stdin, flush=True)
            said = canonical(client.stdout.readline())
            if any_reason or answer == "error saveerror":
                said = said.rpartition(" ")[0]
            if said != answer:
                wrong.append(f"{line}: {said!r}, not {answer!r}")

        for entry in streams:
            path = pathlib.Path(folder) / f"{entry['name']}.txt"
            ask(f"watch meshes/{entry['name']} {path}", wanted(entry))
            if "mesh" in entry and not same(path, entry["mesh"]):
                wrong.append(f"{entry['name']}: the mesh differs from {entry['mesh']}")
        for entry in meshes:
            for ending in ("txt", "obj"):
                path = pathlib.Path(folder) / f"{entry['name']}-saved.{ending}"
                file = {"txt": entry["mesh"], **entry["files"]}.get(ending)
                ask(f"save {_KIT / entry['mesh']} {path}", "saved" if file else "error saveerror")
                if file and not same(path, file):
                    wrong.append(f"{entry['name']}: the file differs from {file}")
        for i, entry in enumerate(errors["failures"]):
            kind = entry["class"].lower()
            ask(f"watch meshes/failure-{i} {folder}/failed.txt", f"error {kind} {entry['reason']}")
        for i, entry in enumerate(errors["statuses"]):
            answer = f"error {entry['class'].lower()} {entry['reason']}".strip()
            ask(f"create {i}", answer, any_reason=not entry["reason"])
        client.stdin.close()
        client.wait()
    total = 2 * len(meshes) + len(streams) + len(errors["failures"]) + len(errors["statuses"])
    print("\n".join([*wrong, f"conformance: {total - len(wrong)} of {total}"]))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
