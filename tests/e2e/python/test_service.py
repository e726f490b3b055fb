"""Watching, cancelling, several workers, and the embedded server."""

import contextlib
import itertools
import os
import pathlib
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
import stellate
import topology
from stellate import manifolds


@pytest.fixture(autouse=True)
def no_leftovers(client):
    yield
    for info in client.list():
        client.delete(info.name)


class Gate(manifolds.Torus):
    """A torus that answers for a few rounds, in whatever chunks, and waits until it may go on."""

    def __init__(self, questions=300):
        super().__init__()
        self.left, self.waiting, self.go_on = questions, threading.Event(), threading.Event()

    def closest_point(self, points):
        if self.left <= 0:
            self.waiting.set()
            self.go_on.wait()
        self.left -= len(points)
        return super().closest_point(points)


def test_watching_the_mesh_grow(server):
    meshes = list(stellate.watch(manifolds.Torus(), 0.15, server=server))
    assert len(meshes) > 3
    *growing, last = meshes
    assert all(mesh.report is None for mesh in growing) and last.certified
    assert isinstance(last, stellate.FinishedMesh)
    revisions = [mesh.revision for mesh in growing]
    assert revisions == sorted(set(revisions))
    for earlier, later in zip(meshes, meshes[1:]):
        count = len(earlier.points)
        assert len(later.points) >= count
        assert np.array_equal(later.points[:count], earlier.points)  # vertices stay what they are
    topology.assert_closed_manifold(last, 0, [1, 2, 1])


def test_progress(server):
    seen = []
    mesh = stellate.mesh(manifolds.Torus(), 0.15, server=server, on_progress=seen.append)
    assert seen[-1].phase == "DONE" and seen[-1].fraction == 1
    assert seen[-1].vertices == len(mesh.points)
    assert seen[-1].queries <= mesh.report.counts.queries
    for grows in ("round", "vertices", "queries"):
        values = [getattr(progress, grows) for progress in seen]
        assert values == sorted(values), grows
    assert all(0 <= progress.fraction <= 1 for progress in seen)


def test_an_exception_in_on_progress_cancels(client):
    class Enough(Exception):
        pass

    def stop(progress):
        if progress.round >= 3:
            raise Enough

    with pytest.raises(Enough):
        stellate.mesh(manifolds.Torus(), 0.05, server=client, on_progress=stop)
    assert list(client.list()) == []


def test_closing_the_iterator_cancels(client):
    oracle = manifolds.Torus()
    meshes = stellate.watch(oracle, 0.02, server=client, label="to be cancelled")
    next(meshes)
    (info,) = client.list()
    assert info.label == "to be cancelled" and info.workers == 1 and not info.over
    meshes.close()
    assert list(client.list()) == []
    assert not [t for t in threading.enumerate() if t.name.startswith("oracle-")]


def test_cancelled_by_another_client(client, server):
    gate = Gate()
    result = []

    def run():
        try:
            stellate.mesh(gate, 0.1, server=server)
        except stellate.Cancelled as error:
            result.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    gate.waiting.wait()
    (info,) = client.list()
    assert client.cancel(info.name).state == "CANCELLED"
    gate.go_on.set()
    thread.join()
    assert result[0].reason == "CANCELLED"
    assert len(result[0].mesh.points) > 0


def test_watched_by_name_from_the_beginning_by_many(client, server):
    oracle = manifolds.Torus()
    info = client.create(oracle, 0.15)
    assert info.state == "WAITING" and (info.dimension, info.ambient_dimension) == (2, 3)
    results = []

    def watch():
        *_, last = stellate.watch(info.name, server=server)
        results.append(last)

    watchers = [threading.Thread(target=watch, daemon=True) for _ in range(3)]
    for thread in watchers[:2]:
        thread.start()
    assert stellate.serve(oracle, info.name, server=server) == "SUCCEEDED"
    watchers[2].start()  # after the end: it sees the same
    for thread in watchers:
        thread.join()
    assert len(results) == 3
    for mesh in results:
        assert mesh.certified
        assert mesh.points.tobytes() == results[0].points.tobytes()
        assert mesh.simplices.tobytes() == results[0].simplices.tobytes()
    over = client.get(info.name)
    assert over.state == "SUCCEEDED" and over.over and over.end_time >= over.create_time
    assert client.serve(oracle, info.name) == "SUCCEEDED"  # who comes late has nothing to do
    client.delete(info.name)
    with pytest.raises(stellate.MeshNotFound):
        client.get(info.name)


class Slow(manifolds.ProductOfCircles):
    """Circles whose first calls take longer than three leases together."""

    def __init__(self, calls):
        super().__init__((1.0,))
        self.left, self.most = calls, 0

    def closest_point(self, points):
        self.most = max(self.most, len(points))
        self.left -= 1
        if self.left >= 0:
            time.sleep(0.8)
        return super().closest_point(points)


def test_a_slow_worker_says_so_and_is_waited_for(server):
    mesh = stellate.mesh(Slow(2), 0.3, server=server, answer_seconds=0.2)
    assert mesh.certified


def test_no_more_points_at_once_than_the_oracle_wants(client):
    oracle = Slow(0)
    stellate.mesh(oracle, 0.05, server=client, max_chunk=3)
    assert oracle.most == 3
    info = client.create(oracle, 0.05)
    oracle.most = 0
    assert stellate.serve(oracle, info.name, server=client, max_chunk=2) == "SUCCEEDED"
    assert oracle.most == 2
    for wrong in (0, -1, 1.5):
        with pytest.raises(stellate.InvalidArgument, match="max_chunk"):
            stellate.serve(oracle, info.name, server=client, max_chunk=wrong)


def test_a_worker_that_comes_late_is_told_how_it_ended(client):
    info = client.create(manifolds.ProductOfCircles((1.0,)), 0.3)
    client.cancel(info.name)
    assert client.serve(manifolds.ProductOfCircles((1.0,)), info.name) == "CANCELLED"


def test_a_worker_that_leaves_mid_round_is_replaced(client):
    """The first worker stops with a chunk in its hands; the second finishes the mesh, the same."""
    expected = stellate.mesh(manifolds.Torus(), 0.15, server=client)
    gate = Gate()
    info = client.create(gate, 0.15)
    leaving = client.worker(gate, info.name, "leaving")
    thread = threading.Thread(target=leaving.run, daemon=True)
    thread.start()
    gate.waiting.wait()
    leaving.stop()
    assert client.serve(manifolds.Torus(), info.name) == "SUCCEEDED"
    gate.go_on.set()
    thread.join()
    *_, mesh = stellate.watch(info.name, server=client)
    assert mesh.points.tobytes() == expected.points.tobytes()
    assert mesh.simplices.tobytes() == expected.simplices.tobytes()
    client.delete(info.name)


def test_listing_goes_page_by_page(client):
    names = [client.create(manifolds.Torus(), 0.2, label=str(i)).name for i in range(5)]
    assert [info.name for info in client.list(page_size=2)] == names
    for name in names:
        client.delete(name)


def test_server_info(client):
    info = client.info()
    assert info.version.count(".") == 2 and "stellate.v1" in info.protocols
    assert info.max_dimension >= 5 and info.max_ambient_dimension >= 100


def children(pid="self"):
    """The processes that a process has started. Its threads come and go while we look."""
    for attempt in itertools.count():
        try:
            tasks = list(pathlib.Path(f"/proc/{pid}/task").iterdir())
            return {child for task in tasks for child in (task / "children").read_text().split()}
        except (FileNotFoundError, ProcessLookupError):
            if attempt == 1000:
                raise


def test_the_embedded_server_comes_and_goes():
    before = children()
    during = []

    def note(progress):
        during.append(children() - before)

    mesh = stellate.mesh(manifolds.Sphere(1), 0.3, on_progress=note)
    assert mesh.certified
    assert all(len(started) == 1 for started in during) and during
    assert children() == before


def test_the_embedded_server_goes_also_when_things_fail():
    before = children()
    with pytest.raises(stellate.InvalidArgument):
        stellate.mesh(manifolds.Sphere(1), -1.0)
    meshes = stellate.watch(manifolds.Torus(), 0.05)
    next(meshes)
    assert len(children() - before) == 1
    meshes.close()
    assert children() == before


def test_a_server_that_is_killed_is_reported():
    with stellate.Server() as server:
        gate = Gate()
        meshes = stellate.watch(gate, 0.1, server=server)
        next(meshes)
        gate.waiting.wait()
        os.kill(server._process.pid, signal.SIGKILL)
        with pytest.raises(stellate.Unavailable) as caught:
            list(meshes)
        gate.go_on.set()
        assert caught.value.reason == "SERVER_GONE"


PROGRAM = """
import sys
sys.path.insert(0, {package!r})
import stellate
from stellate import manifolds

said = False

def progress(p):
    global said
    if p.round >= 3 and not said:  # events are coalesced: 3 itself may never be seen
        said = True
        print("running", flush=True)

try:
    stellate.mesh(manifolds.Torus(), 0.004, server={server}, on_progress=progress)
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


@contextlib.contextmanager
def running_program(repository, server):
    package = str(repository / "clients" / "python")
    code = PROGRAM.format(package=package, server=repr(server) if server else None)
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout.readline() == "running\n"
        yield process
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def test_ctrl_c_cancels_the_mesh(repository, server, client):
    with running_program(repository, server.address) as process:
        assert len(list(client.list())) == 1
        process.send_signal(signal.SIGINT)
        assert process.stdout.read() == "interrupted\n"
        assert process.wait() == 0
    assert list(client.list()) == []


def test_a_client_that_is_killed_takes_its_server_with_it(repository):
    with running_program(repository, None) as process:
        (server_pid,) = children(process.pid)
    command_line = pathlib.Path(f"/proc/{server_pid}/cmdline")
    with contextlib.suppress(OSError):  # gone between two looks
        while command_line.read_bytes():  # empty once it ended and waits for its new parent
            time.sleep(0.01)
