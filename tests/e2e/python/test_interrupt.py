"""Ctrl-C, sent as a real signal to a real program."""

import contextlib
import os
import pathlib
import signal
import subprocess
import sys

import pytest
import stellate

PROGRAM = """
import sys, threading, time
sys.path.insert(0, {package!r})
import stellate
from stellate import manifolds

class Torus(manifolds.Torus):
    asked = 0

    def closest_point(self, x):
        Torus.asked += len(x)
        return super().closest_point(x)

    def hang(self, x):
        time.sleep(1000)

torus = Torus()
said = False

def progress(p):
    global said
    if p.round >= 3 and not said:
        said = True
        print("running", flush=True)

{body}
"""
MESH = "mesh = stellate.mesh(torus, 0.004, on_progress=progress)\n"
CAUGHT = """
try:
    {call}
except KeyboardInterrupt as stop:
    print(type(stop).__name__, stop, flush=True)
    print(len(stop.mesh.points) > 10 and not stop.mesh.certified, flush=True)
"""


@contextlib.contextmanager
def running(body):
    """The program, once its mesh grows, and the process ids of its private servers."""
    package = str(pathlib.Path(__file__).resolve().parents[3] / "clients" / "python")
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM.format(package=package, body=body)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout.readline() == "running\n", process.stderr.read()
        children = pathlib.Path(f"/proc/{process.pid}/task").glob("*/children")
        yield process, [int(pid) for child in children for pid in child.read_text().split()]
    finally:
        process.kill()
        process.communicate()


def gone(pid):
    with contextlib.suppress(OSError):
        return not pathlib.Path(f"/proc/{pid}/cmdline").read_bytes()
    return True


@pytest.mark.parametrize(
    "call", [MESH, MESH.replace("stellate.mesh(", "list(stellate.watch(") + ")"]
)
def test_the_exception_has_the_mesh_so_far(call):
    with running(CAUGHT.format(call=call.replace("\n", ""))) as (process, servers):
        process.send_signal(signal.SIGINT)
        said, complaints = process.communicate()
        assert said.startswith("Interrupted the mesh is cancelled; what there was of it, "), said
        assert said.endswith("True\n") and complaints == ""
        assert process.returncode == 0 and servers and all(map(gone, servers))


def test_not_caught_it_says_what_happened_and_nothing_of_the_machinery():
    with running(MESH) as (process, _):
        process.send_signal(signal.SIGINT)
        _, complaints = process.communicate()
    assert complaints.splitlines()[-1].startswith(
        "stellate.errors.Interrupted: the mesh is cancelled"
    )
    assert "grpc" not in complaints and "During handling" not in complaints
    assert complaints.count("  File ") <= 4, complaints


@pytest.mark.parametrize("checkpoint", ["", ", checkpoint='kept'"])
def test_a_second_one_ends_it_at_once(checkpoint, tmp_path, monkeypatch):
    """The server is frozen and the oracle hangs: nothing comes to an end by itself."""
    monkeypatch.chdir(tmp_path)
    body = MESH.replace(")\n", checkpoint + ")\n").replace("progress)", "hold)")
    body = body.replace("progress,", "hold,")
    hold = """
def hold(p):
    progress(p)
    if p.round >= 3:
        torus.closest_point = torus.hang
        Torus.closest_point = Torus.hang
        while stop_here:
            time.sleep(0.01)

stop_here = True
"""
    with running(hold + body) as (process, servers):
        for pid in servers:
            os.kill(pid, signal.SIGSTOP)
        process.send_signal(signal.SIGINT)
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(0.3)
        process.send_signal(signal.SIGINT)
        _, complaints = process.communicate(timeout=60)  # for a hang, not for a measurement
        assert "stellate.errors.Interrupted: ended immediately" in complaints
        assert "grpc" not in complaints
        assert servers and all(map(gone, servers))


def test_a_worker_leaves_in_good_order(server, client):
    name = client.create(stellate.manifolds.Torus(), 0.004).name
    body = f"""
class Seen(Torus):
    def closest_point(self, x):
        print("running", flush=True)
        return super().closest_point(x)

stellate.serve(Seen(), {name!r}, server={server.address!r})
"""
    with running(body) as (process, _):
        process.send_signal(signal.SIGINT)
        _, complaints = process.communicate()
        assert complaints.splitlines()[-1].startswith(
            "stellate.errors.Interrupted: this worker left"
        )
        assert "grpc" not in complaints
    assert not client.get(name).over
    client.delete(name)
