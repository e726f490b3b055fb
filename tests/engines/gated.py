"""An oracle that waits in mid-run, so that a test can kill it just there, and what tests need.

Imported by the engines' own processes: standard library, numpy and stellate alone.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import pathlib
import sys
import tempfile
import time
from collections.abc import Iterator

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "clients" / "python"), str(pathlib.Path(__file__).resolve().parent)]

import stellate  # noqa: E402
from stellate import manifolds  # noqa: E402

EPSILON = 0.2
_FREELY = 80  # questions of 1,800 that a process answers before the gate holds it
_PATIENCE = 100.0  # seconds: for a hang, not for a measurement


class Gated:
    """A torus. A process that has answered a few questions waits while the gate is shut."""

    dimension, ambient_dimension = 2, 3

    def __init__(self, folder: str) -> None:
        self.folder, self.torus, self.answered = folder, manifolds.Torus(), 0
        self.bounding_box = self.torus.bounding_box

    def closest_point(self, points):
        gate = pathlib.Path(self.folder)
        if self.answered > _FREELY and (gate / "shut").exists():
            (gate / f"held-{os.getpid()}").touch()
            while (gate / "shut").exists():
                time.sleep(0.01)
        self.answered += len(points)
        return self.torus.closest_point(points)


def oracle() -> Gated:
    """For `python3 -m stellate serve gated:oracle`: the folder is $GATE."""
    return Gated(os.environ["GATE"])


class Gate:
    """The test's side of a Gated oracle: a folder that all processes see."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="gate-")
        self.folder = self._folder.name
        (pathlib.Path(self.folder) / "shut").touch()
        os.environ["GATE"] = self.folder  # for an engine's processes that are started later

    def held(self) -> int:
        """A process that waits at the gate, with questions leased to it."""
        found: list[pathlib.Path] = []

        def look() -> bool:
            found[:] = pathlib.Path(self.folder).glob("held-*")
            return bool(found)

        until(look, "no process of the engine came to the gate")
        return int(found[0].name.removeprefix("held-"))

    def open(self) -> None:
        with contextlib.suppress(FileNotFoundError):
            (pathlib.Path(self.folder) / "shut").unlink()

    def __enter__(self) -> Gate:
        return self

    def __exit__(self, *_: object) -> None:
        self.open()
        self._folder.cleanup()


def until(done, complaint: str) -> None:
    """Looks until it is done."""
    deadline = time.monotonic() + _PATIENCE
    while not done():
        assert time.monotonic() < deadline, complaint
        time.sleep(0.02)


def fingerprint(mesh: stellate.Mesh) -> str:
    """Of every bit of the mesh."""
    assert mesh.certified, mesh.report
    return hashlib.sha256(mesh.points.tobytes() + mesh.simplices.tobytes()).hexdigest()


@contextlib.contextmanager
def declared(gate: Gate) -> Iterator[tuple[stellate.Client, str, str]]:
    """A server for other processes, a mesh on it, and the undisturbed mesh's fingerprint."""
    with stellate.Server(listen="127.0.0.1:0") as server, stellate.Client(server) as client:
        with tempfile.TemporaryDirectory() as open_gate:
            undisturbed = fingerprint(stellate.mesh(Gated(open_gate), EPSILON, server=client))
        yield client, client.create(Gated(gate.folder), EPSILON).name, undisturbed


def pilot(client: stellate.Client, name: str) -> list[str]:
    """The command line of a pilot."""
    serve = ["-m", "stellate", "serve", "gated:oracle", name, "--server", client.address]
    return [sys.executable, *serve]


def finished(client: stellate.Client, name: str) -> str:
    """The fingerprint of a mesh that is waited for."""
    return fingerprint(stellate.download(name, server=client, unfinished="wait"))
