"""Fetching meshes that are on a server."""

import os
import pathlib
import resource
import subprocess
import sys
import threading

import grpc
import numpy as np
import pytest
import stellate
from fake_server import FakeServer, indices, serving
from stellate import manifolds
from stellate._generated import mesh_pb2, stellate_pb2
from stellate._wire.arrays import to_wire

UNKNOWN = "meshes/" + 32 * "0"


@pytest.fixture(scope="module")
def finished(server):
    """The name of a finished mesh, and the mesh as it was watched."""
    with stellate.Client(server) as client:
        name = client.create(manifolds.Torus(), 0.3).name
        assert client.serve(manifolds.Torus(), name) == "SUCCEEDED"
        *_, mesh = stellate.watch(name, server=client)
        yield name, mesh
        client.delete(name)


def assert_same(a, b):
    assert a.points.tobytes() == b.points.tobytes()
    assert a.simplices.tobytes() == b.simplices.tobytes()


def test_a_finished_mesh_is_fetched_with_its_report(finished, server, tmp_path):
    name, watched = finished
    parts = []
    path = tmp_path / "torus.txt"
    mesh = stellate.download(name, path, server=server, on_part=lambda *here: parts.append(here))
    assert_same(mesh, watched)
    assert mesh.report == watched.report and mesh.certified
    assert mesh.revision == watched.revision
    assert_same(stellate.load_txt(path), watched)
    assert parts[-1] == 2 * (len(mesh.points) + len(mesh.simplices),)
    assert_same(stellate.download(name, server=server), watched)  # it is still there


def test_a_mesh_that_was_asked_to_stay_is_there_until_it_is_deleted(server, client):
    made = stellate.mesh(manifolds.Torus(), 0.3, server=server, keep_on_server=True)
    again = stellate.download(made.name, server=server)
    assert_same(again, made)
    assert again.report.certified
    client.delete(made.name)
    with pytest.raises(stellate.MeshNotFound, match="deleted, or it ended too long ago"):
        stellate.download(made.name, server=server)
    before = {info.name for info in client.list()}
    gone = stellate.mesh(manifolds.Torus(), 0.3, server=server)
    assert gone.name == "" and {info.name for info in client.list()} == before
    with pytest.raises(stellate.InvalidArgument, match="a private one ends"):
        stellate.mesh(manifolds.Torus(), 0.3, keep_on_server=True)


def test_what_does_not_finish_does_not_stay(server, client):
    before = {info.name for info in client.list()}

    def stop(progress):
        raise KeyError("enough")

    with pytest.raises(KeyError):
        stellate.mesh(manifolds.Torus(), 0.05, server=server, on_progress=stop, keep_on_server=True)
    assert {info.name for info in client.list()} <= before


def test_what_a_format_cannot_hold_is_refused_before_anything_is_waited_for(client, tmp_path):
    name = client.create(manifolds.SpecialOrthogonal3(), 0.4).name  # which nobody serves
    with pytest.raises(stellate.SaveError, match="surfaces"):
        stellate.download(name, tmp_path / "so3.stl", server=client, unfinished="wait")
    program = pathlib.Path(stellate.server.find_stellated()).with_name("stellate")
    command = [program, "download", name, "-o", "so3.stl", "--wait", "--server", client.address]
    refused = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert refused.returncode == 2 and "surfaces" in refused.stderr
    assert not list(tmp_path.iterdir())
    client.delete(name)


def test_any_revision_is_fetched(finished, client):
    name, watched = finished
    early = stellate.download(name, server=client, revision=2)
    assert early.revision == 2 and early.report is None
    assert 0 < len(early.points) < len(watched.points)
    assert early.points.tobytes() == watched.points[: len(early.points)].tobytes()
    last = stellate.download(name, server=client, revision=watched.revision)
    assert last.report == watched.report
    with pytest.raises(stellate.InvalidArgument, match=str(watched.revision + 1)):
        stellate.download(name, server=client, revision=watched.revision + 1)


def test_a_mesh_that_is_not_there(client, tmp_path):
    with pytest.raises(stellate.MeshNotFound):
        stellate.download(UNKNOWN, server=client)
    name = client.create(manifolds.Torus(), 0.3).name
    client.delete(name)
    with pytest.raises(stellate.MeshNotFound):
        stellate.download(name, tmp_path / "none.txt", server=client, unfinished="wait")
    assert not (tmp_path / "none.txt").exists()


def test_a_mesh_that_is_not_over(finished, client):
    name = client.create(manifolds.Torus(), 0.3).name
    with pytest.raises(stellate.FailedPrecondition, match="not over: WAITING"):
        stellate.download(name, server=client)
    empty = stellate.download(name, server=client, unfinished="take")
    assert empty.points.shape == (0, 3) and empty.simplices.shape == (0, 3)
    assert empty.report is None
    with pytest.raises(ValueError, match="unfinished"):
        stellate.download(name, server=client, unfinished="maybe")

    worker = threading.Thread(target=lambda: client.serve(manifolds.Torus(), name))
    seen = []
    worker.start()
    mesh = stellate.download(name, server=client, unfinished="wait", on_progress=seen.append)
    worker.join()
    assert mesh.certified
    assert_same(mesh, finished[1])
    client.delete(name)


def test_a_cancelled_and_a_failed_mesh(client):
    name = client.create(manifolds.Torus(), 0.3).name
    client.cancel(name)
    with pytest.raises(stellate.Cancelled) as caught:
        stellate.download(name, server=client)
    assert caught.value.mesh.report.termination == "CANCELLED"
    client.delete(name)

    class Wrong(manifolds.Torus):
        def closest_point(self, points):
            return super().closest_point(points) * np.nan

    name = client.create(Wrong(), 0.3).name
    with pytest.raises(stellate.StellateError):
        client.serve(Wrong(), name)
    with pytest.raises(stellate.OracleError) as caught:
        stellate.download(name, server=client, unfinished="wait")
    assert caught.value.reason == "ORACLE_FAILED"
    taken = stellate.download(name, server=client, unfinished="take")
    assert taken.report.failure.reason == "ORACLE_FAILED" and taken.points.shape[1] == 3
    client.delete(name)


class Scattered(FakeServer):
    """A hexagon, sent a row at a time; `breaks`: after so many parts the stream is broken off."""

    points = np.array([[np.cos(a), np.sin(a)] for a in np.arange(6) * np.pi / 3])
    cells = np.array([[0, 1], [1, 2], [2, 3], [3, 4], [4, 5], [0, 5]])

    def __init__(self, breaks=(), code=grpc.StatusCode.UNAVAILABLE):
        super().__init__()
        self.breaks, self.code, self.asked = list(breaks), code, []

    def GetServerInfo(self, request, context):
        return stellate_pb2.ServerInfo(version="fake")

    def GetMesh(self, request, context):
        mesh = mesh_pb2.Mesh(name=request.name, state=mesh_pb2.MESH_STATE_SUCCEEDED, revision=7)
        mesh.spec.dimension, mesh.spec.ambient_dimension = 1, 2
        mesh.report.termination = mesh_pb2.TERMINATION_CONVERGED
        mesh.end_time.GetCurrentTime()
        return mesh

    def DownloadMesh(self, request, context):
        self.asked.append((request.revision, request.position))
        sent = 0
        for position in range(request.position, 12):
            if self.breaks and sent == self.breaks[0]:
                self.breaks.pop(0)
                context.abort(self.code, "broken by the test")
            sent += 1
            yield self.part(position)

    def part(self, position):
        part = stellate_pb2.DownloadMeshResponse(
            revision=7, vertices=6, simplices=6, first_vertex=min(position, 6)
        )
        if position < 6:
            part.points.CopyFrom(to_wire(self.points[position : position + 1]))
        else:
            part.cells.CopyFrom(indices(self.cells[position - 6 : position - 5]))
        part.next_position = position + 1
        part.complete = position == 11
        return part


def test_a_broken_download_goes_on_where_it_was():
    fake = Scattered(breaks=[4, 0, 5])
    with serving(fake) as address:
        mesh = stellate.download("meshes/x", server=address)
    assert fake.asked == [(0, 0), (7, 4), (7, 4), (7, 9)]
    assert mesh.points.tobytes() == Scattered.points.tobytes()
    assert mesh.simplices.tolist() == sorted(Scattered.cells.tolist())
    assert mesh.report.termination == "CONVERGED"


def test_a_download_that_cannot_be_resumed():
    with serving(Scattered(breaks=[4])) as address:
        with stellate.Client(address, reconnect_seconds=0) as client:
            with pytest.raises(stellate.Unavailable, match="broken by the test"):
                stellate.download("meshes/x", server=client)

    class Forgetful(Scattered):
        def DownloadMesh(self, request, context):
            if request.position > 0:
                context.abort(grpc.StatusCode.NOT_FOUND, "no such mesh")
            yield from super().DownloadMesh(request, context)

    with serving(Forgetful(breaks=[4])) as address:
        with pytest.raises(stellate.Unavailable, match="--data-dir"):
            stellate.download("meshes/x", server=address)
    fake = Scattered(breaks=[4], code=grpc.StatusCode.RESOURCE_EXHAUSTED)
    with serving(fake) as address, pytest.raises(stellate.LimitExceeded):
        stellate.download("meshes/x", server=address)
    assert len(fake.asked) == 1


def with_fault(fault, parts):
    """A stream of parts that makes no sense."""
    for part in parts:
        if fault == "skips" and part.first_vertex == 2:
            continue
        if fault == "promises":
            part.simplices = 8
        if fault == "ends" and part.complete:
            return
        if fault == "refers" and part.complete:
            part.cells.CopyFrom(indices([[4, 9]]))
        if fault == "turns":
            part.orientation.turned = b"more"
        yield part


@pytest.mark.parametrize("fault", ["skips", "promises", "ends", "refers"])
def test_a_server_that_makes_no_sense(fault):
    class Faulty(Scattered):
        def DownloadMesh(self, request, context):
            yield from with_fault(fault, super().DownloadMesh(request, context))

    with serving(Faulty()) as address, pytest.raises(stellate.StellateError) as caught:
        stellate.download("meshes/x", server=address)
    assert caught.value.reason == "PROTOCOL"


# Into files as it comes.


class Sorted(Scattered):
    """The hexagon with its rows in order, and how they are turned."""

    order = np.array([[0, 1], [0, 5], [1, 2], [2, 3], [3, 4], [4, 5]])

    def part(self, position):
        part = super().part(position)
        if position >= 6:
            part.cells.CopyFrom(indices(self.order[position - 6 : position - 5]))
            part.orientation.orientable = True
            part.orientation.turned = b"\1" if position == 7 else b"\0"
        return part


def _files(folder):
    return sorted(path.name for path in folder.iterdir())


ENDINGS = ("txt", "off", "obj", "ply", "msh", "vtu")


def test_files_of_parts_are_those_of_the_whole_mesh(finished, server, tmp_path):
    name, watched = finished
    paths = [tmp_path / f"parts.{ending}" for ending in ENDINGS]
    parts = []
    saved = stellate.download(
        name, to=paths, server=server, on_part=lambda *here: parts.append(here)
    )
    assert saved.report == watched.report and saved.certified
    assert (saved.vertices, saved.simplices) == (len(watched.points), len(watched.simplices))
    assert (saved.dimension, saved.ambient_dimension) == (2, 3)
    assert saved.revision == watched.revision
    assert parts[-1] == 2 * (saved.vertices + saved.simplices,)
    program = pathlib.Path(stellate.server.find_stellated()).with_name("stellate")
    command = [program, "download", name, "-q", "--server", server.address]
    for ending in ENDINGS:
        command += ["-o", f"cpp.{ending}"]
    subprocess.run(command, check=True, cwd=tmp_path)
    for ending, path in zip(ENDINGS, paths):
        watched.save(tmp_path / f"whole.{ending}")
        assert path.read_bytes() == (tmp_path / f"whole.{ending}").read_bytes(), ending
        assert path.read_bytes() == (tmp_path / f"cpp.{ending}").read_bytes(), ending
    assert isinstance(saved.points, np.memmap) and isinstance(saved.cells, np.memmap)
    assert np.array_equal(saved.points, watched.points)
    assert np.array_equal(saved.cells, watched.oriented_simplices())
    text = stellate.download(name, to=paths[0], server=server)
    with pytest.raises(stellate.InvalidArgument, match="[.]vtu"):
        assert text.points is None
    with pytest.raises(TypeError, match="either"):
        stellate.download(name, paths[0], to=paths[0], server=server)


@pytest.mark.parametrize(
    "oracle, epsilon, endings",
    [
        (manifolds.SpecialOrthogonal3(), 0.6, ("txt", "vtu")),
        (manifolds.ProductOfCircles(), 0.4, ("txt", "off", "vtu")),
    ],
)
def test_all_coordinates_are_mapped(client, oracle, epsilon, endings, tmp_path):
    name = client.create(oracle, epsilon).name
    client.serve(oracle, name)
    mesh = stellate.download(name, server=client)
    saved = stellate.download(name, to=[tmp_path / f"a.{it}" for it in endings], server=client)
    for ending in endings:
        mesh.save(tmp_path / f"b.{ending}")
        assert (tmp_path / f"a.{ending}").read_bytes() == (tmp_path / f"b.{ending}").read_bytes()
    assert np.array_equal(saved.points, mesh.points)
    assert np.array_equal(saved.cells, mesh.oriented_simplices())
    client.delete(name)


def test_walls_and_early_revisions(finished, client, tmp_path):
    name, watched = finished
    early = stellate.download(name, to=tmp_path / "early.txt", server=client, revision=2)
    assert early.report is None and early.revision == 2
    again = stellate.load_txt(tmp_path / "early.txt")
    assert len(again.points) == early.vertices < len(watched.points)


def two_materials():
    """A ball of radius 1/2 in one of radius 1."""
    walls = [lambda x, r=r: r**2 - (x**2).sum(axis=1) for r in (1.0, 0.5)]
    room = ([-1.2] * 3, [1.2] * 3)
    return stellate.oracles.Solid(walls, room, labels=[0, 1, 0, 2])


def half_torus():
    half_spaces = [stellate.oracles.HalfSpace(normal) for normal in ([1, 0, 0], [0, 1, 0.2])]
    return stellate.oracles.Clipped(manifolds.Torus(), half_spaces)


@pytest.mark.parametrize("make", [half_torus, two_materials])
def test_files_with_walls_and_regions_are_those_of_both_languages(make, client, tmp_path):
    endings = ("vtu", "msh", "obj", "txt")
    name = client.create(make(), 0.3).name
    client.serve(make(), name)
    mesh = stellate.download(name, server=client)
    stellate.download(name, to=[tmp_path / f"a.{it}" for it in endings], server=client)
    program = pathlib.Path(stellate.server.find_stellated()).with_name("stellate")
    command = [program, "download", name, "-q", "--server", client.address]
    for ending in endings:
        command += ["-o", f"c.{ending}"]
    subprocess.run(command, check=True, cwd=tmp_path)
    for ending in endings:
        mesh.save(tmp_path / f"b.{ending}")
        of_parts, whole, cpp = (tmp_path / f"{it}.{ending}" for it in "abc")
        assert of_parts.read_bytes() == whole.read_bytes() == cpp.read_bytes(), ending
    client.delete(name)


def test_a_broken_stream_of_parts_goes_on_in_the_same_file(tmp_path):
    fake = Sorted(breaks=[4, 0, 5])
    with serving(fake) as address:
        saved = stellate.download("meshes/x", to=tmp_path / "a.vtu", server=address)
    assert fake.asked == [(7, 0), (7, 4), (7, 4), (7, 9)]
    assert saved.points.tobytes() == Scattered.points.tobytes()
    assert saved.cells.tolist() == [[0, 1], [5, 0], *Sorted.order.tolist()[2:]]


def test_a_server_that_sends_no_order_is_asked_for_the_whole_mesh(tmp_path):
    fake = Scattered()
    with serving(fake) as address:
        stellate.download("meshes/x", to=tmp_path / "a.txt", server=address)
    assert fake.asked == [(7, 0), (0, 0)]
    assert stellate.load_txt(tmp_path / "a.txt").simplices.tolist() == Sorted.order.tolist()
    assert _files(tmp_path) == ["a.txt"]


@pytest.mark.filterwarnings("ignore::stellate.UncertifiedWarning")
@pytest.mark.parametrize(
    "fault", ["skips", "promises", "ends", "refers", "turns", "breaks", "stops"]
)
def test_no_file_is_there_by_halves(fault, tmp_path):
    class Faulty(Sorted):
        def DownloadMesh(self, request, context):
            yield from with_fault(fault, super().DownloadMesh(request, context))

    (tmp_path / "a.vtu").write_text("old")

    def on_part(received, of_all):
        if fault == "stops" and received == 8:
            raise KeyboardInterrupt

    expected = KeyboardInterrupt if fault == "stops" else stellate.StellateError
    with serving(Faulty(breaks=[8] if fault == "breaks" else [])) as address:
        with stellate.Client(address, reconnect_seconds=0) as client:
            with pytest.raises(expected):
                stellate.download(
                    "meshes/x", to=[tmp_path / "a.vtu", tmp_path / "b.txt"], server=client,
                    on_part=on_part,
                )  # fmt: skip
    assert _files(tmp_path) == ["a.vtu"]
    assert (tmp_path / "a.vtu").read_text() == "old"


@pytest.mark.filterwarnings("ignore::stellate.UncertifiedWarning")
def test_a_file_that_cannot_be_written(tmp_path):
    fake = Sorted()
    with serving(fake) as address:
        with pytest.raises(FileNotFoundError, match="no folder"):
            stellate.download("meshes/x", to=tmp_path / "missing" / "a.vtu", server=address)
        assert fake.asked == []
        limits = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (400, limits[1]))
        try:
            with pytest.raises(OSError, match="too large.*a[.]vtu"):
                stellate.download("meshes/x", to=tmp_path / "a.vtu", server=address)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert _files(tmp_path) == []


class Large(FakeServer):
    """Two triangles for each vertex but the last ones; the first thousand vertices are on a wall."""

    walls = 0
    rows = 4000  # in a part
    vertices = 150 * rows
    simplices = 2 * (vertices - rows)

    def GetMesh(self, request, context):
        mesh = mesh_pb2.Mesh(name=request.name, state=mesh_pb2.MESH_STATE_SUCCEEDED, revision=1)
        mesh.spec.dimension, mesh.spec.ambient_dimension = 2, 3
        mesh.spec.walls = self.walls
        mesh.report.termination = mesh_pb2.TERMINATION_CONVERGED
        mesh.end_time.GetCurrentTime()
        return mesh

    def DownloadMesh(self, request, context):
        end = self.vertices + self.simplices
        for first in range(0, end, self.rows):
            part = stellate_pb2.DownloadMeshResponse(
                revision=1, vertices=self.vertices, simplices=self.simplices,
                first_vertex=min(first, self.vertices), next_position=first + self.rows,
                complete=first + self.rows == end,
            )  # fmt: skip
            if first < self.vertices:
                part.points.CopyFrom(to_wire(np.full((self.rows, 3), float(first))))
                if first == 0 and self.walls:
                    part.boundary_vertices.extend(range(1000))
                    part.boundary_walls.extend([1] * 1000)
            else:
                s = np.arange(first - self.vertices, first - self.vertices + self.rows)
                cells = np.stack([s // 2, s // 2 + 1, s // 2 + 2 + s % 2], axis=1)
                part.cells.CopyFrom(indices(cells))
                part.orientation.orientable = True
                part.orientation.turned = bytes(self.rows // 8)
            yield part


@pytest.mark.parametrize("walls", [0, 1])
def test_a_large_download_takes_little_memory(walls, tmp_path, repository):
    """The mesh itself takes 43 MB; it took some 750 B a vertex on its way into the file, 450 MB."""
    program = """
import resource, sys, warnings, stellate
warnings.simplefilter("ignore")
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
saved = stellate.download("meshes/x", to=sys.argv[2], server=sys.argv[1])
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, before, saved.vertices)
"""
    large = Large()
    large.walls = walls
    with serving(large) as address:
        done = subprocess.run(
            [sys.executable, "-c", program, address, tmp_path / "a.vtu"],
            env={**os.environ, "PYTHONPATH": str(repository / "clients" / "python")},
            capture_output=True, text=True, check=True,
        )  # fmt: skip
    peak, before, vertices = map(int, done.stdout.split())
    assert vertices == Large.vertices
    assert peak < 150 << 10 and peak - before < 60 << 10, (peak, before)
    assert (tmp_path / "a.vtu").stat().st_size > 48 * Large.vertices
