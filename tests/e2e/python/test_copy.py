"""`stellated --copy-meshes` between data directories: what is copied goes on, and is the same."""

import pathlib
import subprocess

import stellate
from stellate import manifolds

PATIENCE = 300.0  # seconds: for a hang, not for a measurement


def copy(origin, target) -> subprocess.CompletedProcess:
    command = [stellate.server.find_stellated(), "--copy-meshes", str(origin), str(target)]
    return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)


def fill(directory: pathlib.Path) -> tuple[str, str, bytes]:
    """A finished mesh, its points, and one that waits for a worker."""
    with stellate.Server("--data-dir", str(directory)) as server, stellate.Client(server) as client:
        finished = client.create(manifolds.Torus(), 0.2).name
        client.serve(manifolds.Torus(), finished)
        waiting = client.create(manifolds.Torus(), 0.2, worker_wait_seconds=PATIENCE).name
        points = stellate.download(finished, server=client).points.tobytes()
    return finished, waiting, points


def test_meshes_are_copied_and_go_on(tmp_path):
    finished, waiting, points = fill(tmp_path / "a")
    done = copy(tmp_path / "a", tmp_path / "b")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("copied 2 meshes: ")
    again = copy(tmp_path / "a", tmp_path / "b")
    assert again.stdout.startswith("copied 0 meshes: "), again.stderr
    assert again.stdout.endswith("2 were there already\n")
    for name in ("a", "b"):  # nothing was taken from the first
        data = str(tmp_path / name)
        with stellate.Server("--data-dir", data) as server, stellate.Client(server) as client:
            assert stellate.download(finished, server=client).points.tobytes() == points
            assert client.serve(manifolds.Torus(), waiting) == "SUCCEEDED"
            assert stellate.download(waiting, server=client).points.tobytes() == points


def test_a_copy_that_is_killed_is_begun_again(tmp_path):
    fill(tmp_path / "a")
    command = [stellate.server.find_stellated(), "--copy-meshes", tmp_path / "a", tmp_path / "b"]
    for wait in range(8):
        with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:
            try:
                process.wait(0.01 * wait)
            except subprocess.TimeoutExpired:
                process.kill()
    done = copy(tmp_path / "a", tmp_path / "b")
    assert done.returncode == 0, done.stderr
    again = copy(tmp_path / "a", tmp_path / "b")
    assert again.stdout.endswith("2 were there already\n"), again.stderr
    with stellate.Server("--data-dir", str(tmp_path / "b")) as server:
        with stellate.Client(server) as client:
            assert len(list(client.list())) == 2


def test_a_mesh_that_went_on_in_one_of_them_is_named(tmp_path):
    _, waiting, _ = fill(tmp_path / "a")
    assert copy(tmp_path / "a", tmp_path / "b").returncode == 0
    data = str(tmp_path / "b")
    with stellate.Server("--data-dir", data) as server, stellate.Client(server) as client:
        client.serve(manifolds.Torus(), waiting)
    done = copy(tmp_path / "a", tmp_path / "b")
    assert done.returncode == 1
    assert "with other records" in done.stderr


def test_refusals(tmp_path):
    nothing = tmp_path / "nothing"
    assert "is not there" in copy(nothing, tmp_path / "b").stderr
    assert not nothing.exists()
    assert "name two places" in copy(tmp_path, tmp_path).stderr
    fill(tmp_path / "a")
    with stellate.Server("--data-dir", str(tmp_path / "a")):
        done = copy(tmp_path / "a", tmp_path / "b")
    assert done.returncode == 1
    assert "another server uses" in done.stderr
