"""The Python client and the files of this folder; README.md says what they are."""

import json
import pathlib
import struct

import grpc
import numpy as np
import pytest
import stellate
from fake_server import FakeServer, serving
from stellate import errors, manifolds
from stellate._generated import mesh_pb2, stellate_pb2

HERE = pathlib.Path(__file__).resolve().parent


def entries(name):
    return json.loads((HERE / name).read_text())


def named(name):
    return [pytest.param(entry, id=entry["name"]) for entry in entries(name)]


# Streams


class Replay(FakeServer):
    """Sends the streams of an entry, and keeps what they were asked for with."""

    def __init__(self, entry):
        super().__init__()
        self.entry, self.attempts, self.from_revisions = entry, list(entry["attempts"]), []

    def GetMesh(self, request, context):
        spec = mesh_pb2.MeshSpec(
            dimension=self.entry["dimension"],
            ambient_dimension=self.entry["ambient_dimension"],
            boundary_only=self.entry.get("only") == "boundary",
        )
        return mesh_pb2.Mesh(name=request.name, spec=spec, state=mesh_pb2.MESH_STATE_RUNNING)

    def GetServerInfo(self, request, context):
        return stellate_pb2.ServerInfo()

    def WatchMesh(self, request, context):
        self.from_revisions.append(request.from_revision)
        attempt = self.attempts.pop(0)
        raw, at = (HERE / attempt["file"]).read_bytes(), 0
        while at < len(raw):
            (size,) = struct.unpack_from("<I", raw, at)
            yield stellate_pb2.WatchMeshResponse.FromString(raw[at + 4 : at + 4 + size])
            at += 4 + size
        if attempt["then"] != "OK":
            context.abort(grpc.StatusCode[attempt["then"]], "the stream breaks here")


def watch(address):
    try:
        return list(stellate.watch("meshes/recorded", server=address))[-1]
    except stellate.Cancelled as error:
        return error.mesh


@pytest.mark.parametrize("entry", named("streams.json"))
def test_a_stream_makes_this_mesh(entry, tmp_path):
    replay = Replay(entry)
    with serving(replay) as address:
        if "error" in entry:
            with pytest.raises(stellate.StellateError) as caught:
                watch(address)
            assert caught.value.reason == entry["error"]
            return
        mesh = watch(address)
    assert replay.from_revisions == [attempt["from_revision"] for attempt in entry["attempts"]]
    mesh.save(tmp_path / "mesh.txt")
    assert (tmp_path / "mesh.txt").read_bytes() == (HERE / entry["mesh"]).read_bytes()
    if "walls" in entry:
        assert mesh.walls.tolist() == [int(line) for line in (HERE / entry["walls"]).open()]
    else:
        assert mesh.walls is None
    assert mesh.revision == entry["revision"]
    assert mesh.report.termination == entry["termination"]
    assert mesh.report.certificate.level == entry["level"]


@pytest.mark.parametrize("entry", named("streams.json"))
def test_the_state_at_the_end_has_its_name(entry):
    if "error" not in entry:
        raw = (HERE / entry["attempts"][-1]["file"]).read_bytes()
        at = 0
        while at < len(raw):
            (size,) = struct.unpack_from("<I", raw, at)
            last = stellate_pb2.WatchMeshResponse.FromString(raw[at + 4 : at + 4 + size])
            at += 4 + size
        assert stellate.client.MeshInfo.from_wire(last.final).state == entry["state"]


# Files


@pytest.mark.parametrize("entry", named("meshes.json"))
def test_a_mesh_is_saved_as_these_bytes(entry, tmp_path):
    mesh = stellate.load_txt(HERE / entry["mesh"])
    for ending, path in {"txt": entry["mesh"], **entry["files"]}.items():
        mesh.save(tmp_path / f"mesh.{ending}")
        assert (tmp_path / f"mesh.{ending}").read_bytes() == (HERE / path).read_bytes(), ending
    for ending in entry.get("refused", []):
        with pytest.raises(stellate.SaveError):
            mesh.save(tmp_path / f"mesh.{ending}")


def test_normals_of_a_hypersurface_point_outwards():
    """What the files say is right, by a law of its own: the volume within is positive."""
    entry = next(entry for entry in entries("meshes.json") if entry["name"] == "torus")
    mesh = stellate.load_txt(HERE / entry["mesh"])
    lines = (HERE / entry["files"]["off"]).read_text().splitlines()
    rows = np.array([line.split()[1:] for line in lines[-len(mesh.simplices) :]], dtype=int)
    assert (np.sort(rows, axis=1) == mesh.simplices).all()
    assert np.linalg.det(mesh.points[rows]).sum() > 0


# Errors


class Refusal(grpc.RpcError):
    def __init__(self, entry):
        self.entry = entry

    def code(self):
        return next(code for code in grpc.StatusCode if code.value[0] == self.entry["code"])

    def details(self):
        return self.entry["message"]

    def trailing_metadata(self):
        return (("grpc-status-details-bin", bytes.fromhex(self.entry["details"])),)


def judge(error, entry):
    assert type(error).__name__ == entry["class"]
    assert error.reason == (entry["reason"] or type(error).default_reason)
    assert errors.exit_status(error) == entry["exit_status"]


@pytest.mark.parametrize("entry", entries("errors.json")["statuses"])
def test_a_status_is_this_error(entry):
    error = errors.from_rpc(Refusal(entry))
    judge(error, entry)
    assert str(error).startswith(entry["message"])
    assert error.details.get("fields") == entry.get("fields")


@pytest.mark.parametrize("entry", entries("errors.json")["failures"])
def test_a_failed_mesh_is_this_error(entry):
    mesh = mesh_pb2.Mesh(name="meshes/recorded", state=mesh_pb2.MESH_STATE_FAILED)
    mesh.report.failure.reason, mesh.report.failure.message = entry["reason"], "what was wrong"
    fake = Replay({"dimension": 1, "ambient_dimension": 2, "attempts": []})
    fake.WatchMesh = lambda request, context: iter([stellate_pb2.WatchMeshResponse(final=mesh)])
    with serving(fake) as address, pytest.raises(stellate.StellateError) as caught:
        watch(address)
    judge(caught.value, entry)


def test_every_reason_of_the_protocol_is_there():
    from stellate._generated import errors_pb2

    names = {name.removeprefix("ERROR_REASON_") for name in errors_pb2.ErrorReason.keys()}
    for part in ("statuses", "failures"):
        assert names - {"UNSPECIFIED"} <= {
            entry["reason"] for entry in entries("errors.json")[part]
        }


# Oracles


class Broken:
    """A manifold of oracles.json with its defect."""

    dimension, ambient_dimension = 2, 3

    def __init__(self, manifold, defect):
        self.defect, self.calls = defect, 0
        self.dimension = {"dimension_3": 3, "dimension_1": 1}.get(defect, 2)
        torus = manifold == "torus"
        self.good = manifolds.Torus() if torus else manifolds.Sphere(2)
        corner = np.array([1.54, 1.54, 0.44] if torus else [1.1] * 3)
        if defect in ("small_box", "cube"):
            corner = np.full(3, 1.0 if defect == "small_box" else 1.1)
        self.bounding_box = None if defect == "no_box" else (-corner, corner)
        if defect not in ("dimension_1", "no_tangents", "cube"):
            self.tangent_basis = self.given_basis
        if defect in ("negative_sizes", "sizes_of_batches"):
            self.local_size = lambda p: np.full(len(p), -1.0 if "neg" in defect else len(p))
        if not torus:
            self.intersect_flat = self.line

    def closest_point(self, x):
        defect, p, n = self.defect, self.good.closest_point(x).copy(), len(x)
        self.calls += 1
        distance = np.linalg.norm(x - p, axis=1)
        if defect == "raises":
            raise RuntimeError("on purpose")
        if defect == "one_row_short":
            return p[:-1]
        if defect == "not_a_number":
            p[0, 0] = np.nan
        elif defect in ("nothing_found", "found_nearby"):
            limit = 0.1 if defect == "found_nearby" else -1
            if (distance >= limit).any():
                raise stellate.NotConverged(p, distance < limit)
        elif defect == "counts_calls":
            p += 1e-3 * self.calls
        elif defect == "alone_elsewhere" and n == 1:
            p += 1e-3
        elif defect == "half_way":
            p = (x + p) / 2
        elif defect == "trembles":
            p += 1e-8 * np.sin(1e6 * x)
        elif defect == "far_side":
            ring = x * [1, 1, 0] / np.hypot(x[:, 0], x[:, 1])[:, None]
            p = np.where((distance < 0.02)[:, None], p, 2 * ring - p)
        elif defect == "leans":
            c, s = np.cos(0.3 * distance), np.sin(0.3 * distance)
            p = np.stack([c * p[:, 0] - s * p[:, 1], s * p[:, 0] + c * p[:, 1], p[:, 2]], axis=1)
        elif defect == "cube":
            p = np.clip(x, -1, 1)
            rows = np.flatnonzero(np.abs(x).max(axis=1) < 1)
            axis = np.abs(x[rows]).argmax(axis=1)
            p[rows, axis] = np.where(x[rows, axis] < 0, -1.0, 1.0)
        return p

    def given_basis(self, points):
        bases = self.good.tangent_basis(points)
        if self.defect == "long_tangents":
            return 1.01 * bases
        return bases[:, ::-1] if self.defect == "other_tangents" else bases

    def line(self, c, bases, radii):
        along = np.cross(bases[:, :, 0], bases[:, :, 1])
        b = (c * along).sum(axis=1)
        root = np.sqrt(np.maximum(b * b - (c * c).sum(axis=1) + 1, 0))
        t = np.where(np.abs(-b + root) <= np.abs(-b - root), -b + root, -b - root)
        points, found = c + t[:, None] * along, np.abs(t) <= radii
        if self.defect == "any_radius":
            found[:] = True
        elif self.defect == "no_flat_met":
            found[:] = False
        elif self.defect == "off_flat":
            points = points + 0.01 * bases[:, :, 0]
        elif self.defect == "at_centre":
            points = c
        return points, found


@pytest.mark.parametrize("entry", named("oracles.json"))
def test_a_doctor_finds_this(entry):
    report = stellate.check(Broken(entry["manifold"], entry["defect"]), entry["epsilon"])
    found = set(report.codes) - {"PIECES", "SPEED", "SLOW"}
    assert sorted(found) == entry["finds"], report
