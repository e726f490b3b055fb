"""A server that is killed or frozen in the middle of a mesh: the client never notices."""

import logging
import os
import pathlib
import subprocess
import time

import pytest
import stellate
from stellate import manifolds


class MortalServer:
    """A stellated that can be killed and started again on the same address and data."""

    def __init__(self, directory: pathlib.Path) -> None:
        self._directory = directory
        self.address = f"unix:{directory}/socket"
        self.start()

    def start(self, remembers: bool = True) -> None:
        ready = self._directory / "ready"
        ready.unlink(missing_ok=True)
        command = [
            stellate.server.find_stellated(),
            "--listen",
            self.address,
            "--ready-file",
            str(ready),
        ]
        command += ["--log-level", "off", "--exit-with-parent"]
        if remembers:
            command += ["--data-dir", str(self._directory / "data")]
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        while not ready.exists():
            assert self._process.poll() is None, "the server did not start"
            time.sleep(0.002)

    def kill(self) -> None:
        self._process.kill()
        self._process.wait()


@pytest.fixture
def mortal(tmp_path):
    # Short, as a socket's path must be.
    directory = pathlib.Path(os.path.relpath(tmp_path))
    directory = directory if len(str(directory)) < len(str(tmp_path)) else tmp_path
    server = MortalServer(directory)
    yield server
    server.kill()


class Disaster(manifolds.Torus):
    """A torus at whose n-th batches something happens."""

    def __init__(self, happens, *batches):
        super().__init__()
        self._happens, self.left, self._calls = happens, list(batches), 0

    def closest_point(self, points):
        self._calls += 1
        if self.left and self._calls == self.left[0]:
            self.left.pop(0)
            self._happens()
        return super().closest_point(points)


def assert_undisturbed(mesh, client):
    expected = stellate.mesh(manifolds.Torus(), 0.15, server=client)
    assert mesh.certified
    assert mesh.points.tobytes() == expected.points.tobytes()
    assert mesh.simplices.tobytes() == expected.simplices.tobytes()


def test_a_server_killed_and_started_again_is_waited_for(mortal, caplog):
    def restart():
        mortal.kill()
        mortal.start()

    oracle = Disaster(restart, 4, 9)
    with stellate.Client(mortal.address) as client, caplog.at_level(logging.WARNING, "stellate"):
        meshes = list(stellate.watch(oracle, 0.15, server=client))
        assert not oracle.left
        assert_undisturbed(meshes[-1], client)
        revisions = [mesh.revision for mesh in meshes[:-1]]
        assert revisions == sorted(set(revisions))
    said = [record.getMessage() for record in caplog.records]
    assert any("lost the server" in line for line in said)
    assert any("the server is back" in line for line in said)


def test_a_worker_by_itself_comes_back(mortal):
    """Nobody watches; after the end another worker is told how it ended."""

    def restart():
        mortal.kill()
        mortal.start()

    oracle = Disaster(restart, 3)
    with stellate.Client(mortal.address) as client:
        info = client.create(oracle, 0.15)
        assert client.serve(oracle, info.name) == "SUCCEEDED"
        *_, mesh = stellate.watch(info.name, server=client)
        assert_undisturbed(mesh, client)


def test_a_server_that_stays_away_is_given_up(mortal):
    oracle = Disaster(mortal.kill, 3)
    with stellate.Client(mortal.address, reconnect_seconds=0.2) as client:
        with pytest.raises(stellate.Unavailable, match="waited"):
            stellate.mesh(oracle, 0.15, server=client)


def test_a_server_that_forgot_is_not_waited_for(mortal):
    def lose_memory():
        mortal.kill()
        mortal.start(remembers=False)

    oracle = Disaster(lose_memory, 3)
    with pytest.raises(stellate.Unavailable, match="--data-dir"):
        stellate.mesh(oracle, 0.15, server=mortal.address)


def test_calls_are_repeated_where_that_does_no_harm(mortal):
    with stellate.Client(mortal.address) as client:
        info = client.create(manifolds.Torus(), 0.3)
        mortal.kill()
        mortal.start()
        assert [mesh.name for mesh in client.list()] in ([info.name], [])
        mortal.kill()
        mortal.start()
        assert client.info().protocols == ("stellate.v1",)
