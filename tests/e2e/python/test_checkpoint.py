"""stellate.mesh(..., checkpoint=DIRECTORY): the same call goes on where the last one ended."""

import fcntl
import json
import os
import pathlib
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest
import stellate
from stellate import manifolds

EPSILON = 0.05


class Torus(manifolds.Torus):
    """Counts what it is asked; after `limit` questions it breaks down."""

    def __init__(self, limit=None):
        super().__init__()
        self.asked, self.limit = 0, limit

    def closest_point(self, x):
        self.asked += len(x)
        if self.limit is not None and self.asked > self.limit:
            raise ZeroDivisionError("on purpose")
        return super().closest_point(x)


@pytest.fixture(scope="module")
def undisturbed():
    oracle = Torus()
    return stellate.mesh(oracle, EPSILON), oracle.asked


def assert_same(mesh, expected):
    assert mesh.points.tobytes() == expected.points.tobytes()
    assert np.array_equal(mesh.simplices, expected.simplices)
    assert mesh.report.certificate == expected.report.certificate
    assert mesh.report.counts == expected.report.counts


PROGRAM = """
import os, sys, threading
sys.path.insert(0, {package!r})
import stellate
from stellate import manifolds

asked = 0

class Torus(manifolds.Torus):
    def closest_point(self, x):
        global asked
        if asked + len(x) > {limit}:
            os.kill(os.getpid(), {signal})
            threading.Event().wait()  # what was asked last has no answer
        asked += len(x)
        return super().closest_point(x)

try:
    stellate.mesh(Torus(), {epsilon}, checkpoint={directory!r})
except KeyboardInterrupt as error:
    print(error, asked, len(error.mesh.points), sep="|")
"""


def run_until(limit, number, directory):
    package = str(pathlib.Path(stellate.__file__).parents[1])
    program = PROGRAM.format(
        package=package,
        limit=limit,
        signal=int(number),
        epsilon=EPSILON,
        directory=str(directory),
    )
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)


def test_interrupted_and_killed_it_goes_on_and_is_the_same_mesh(undisturbed, tmp_path):
    expected, questions = undisturbed
    interrupted = run_until(questions // 4, signal.SIGINT, tmp_path)
    assert interrupted.returncode == 0, interrupted.stderr
    words, asked, vertices = interrupted.stdout.split("|")
    assert f"is kept in {tmp_path}: the same call goes on" in words
    assert 0 < int(asked) <= questions // 4 and 0 < int(vertices) < len(expected.points)
    killed = run_until(questions // 2, signal.SIGKILL, tmp_path)
    assert killed.returncode == -signal.SIGKILL
    rest = Torus()
    mesh = stellate.mesh(rest, EPSILON, checkpoint=tmp_path)
    assert_same(mesh, expected)
    assert rest.asked < questions - int(asked)


def test_finished_it_is_there_at_once(undisturbed, tmp_path, monkeypatch):
    first = stellate.mesh(Torus(), EPSILON, checkpoint=tmp_path)
    assert_same(first, undisturbed[0])
    monkeypatch.setenv("STELLATED", "/nonexistent")  # no server, no question
    other = Torus(limit=0)
    other.about = "in other words"
    again = stellate.mesh(other, EPSILON, checkpoint=tmp_path, label="any")
    assert_same(again, first)
    assert (again.report, again.progress, again.revision) == (
        first.report,
        first.progress,
        first.revision,
    )
    assert sorted(os.listdir(tmp_path)) == ["lock", "mesh.json", "mesh.npz"]


def test_an_oracle_that_breaks_down_loses_nothing(undisturbed, tmp_path):
    expected, questions = undisturbed
    with pytest.raises(ZeroDivisionError, match="on purpose"):
        stellate.mesh(Torus(limit=questions // 2), EPSILON, checkpoint=tmp_path)
    rest = Torus()
    assert_same(stellate.mesh(rest, EPSILON, checkpoint=tmp_path), expected)
    assert rest.asked < 0.75 * questions


class Doubled(Torus):
    """Changes its answers, which the server finds out."""

    def closest_point(self, x):
        return super().closest_point(x) * (1 + 1e-3 * self.asked)


def test_a_mesh_that_failed_begins_anew(undisturbed, tmp_path):
    with pytest.raises(stellate.OracleError):
        stellate.mesh(Doubled(), EPSILON, checkpoint=tmp_path)
    assert_same(stellate.mesh(Torus(), EPSILON, checkpoint=tmp_path), undisturbed[0])


def test_another_specification_is_refused(tmp_path):
    stellate.mesh(manifolds.Torus(), 0.2, checkpoint=tmp_path)
    with pytest.raises(stellate.InvalidArgument, match="epsilon is 0.2 there and 0.3 here"):
        stellate.mesh(manifolds.Torus(), 0.3, checkpoint=tmp_path)
    with pytest.raises(stellate.InvalidArgument, match="limits.max_vertices is not given there"):
        stellate.mesh(manifolds.Torus(), 0.2, checkpoint=tmp_path, max_vertices=100)
    with pytest.raises(stellate.InvalidArgument, match="seeds differs"):
        stellate.mesh(manifolds.Torus(), 0.2, checkpoint=tmp_path, seeds=[[1.4, 0, 0]])


def test_automatic_epsilon_is_chosen_once(tmp_path):
    first = stellate.mesh(Torus(), "auto", checkpoint=tmp_path)
    again = stellate.mesh(Torus(limit=0), "auto", checkpoint=tmp_path)
    assert again.report == first.report and first.report.epsilon_reason


class TwoCircles:
    """The unit circle, and a small one beside it that few questions of the doctor fall upon."""

    dimension, ambient_dimension = 1, 2
    bounding_box = [-1.1, -1.1], [1.2, 1.1]
    seeds = [[-1, 0], [1.05, 0.01]]

    def closest_point(self, x):
        y = x - [1.05, 0]
        away, beside = (np.sqrt((z * z).sum(axis=1, keepdims=True)) for z in (x, y))
        large = np.abs(away - 1) <= np.abs(beside - 0.01)
        return np.where(large, x / away, [1.05, 0] + y * (0.01 / beside))


class Leaving:
    """Leaves at the first progress of the second mesh."""

    def __init__(self):
        self.told = []

    def note(self, text):
        self.told.append(text)

    def __call__(self, progress):
        if len(self.told) == 3:  # that it is looked for, the first, the second
            raise ZeroDivisionError("on purpose")


def test_what_automatic_epsilon_goes_on_with_is_kept(tmp_path):
    def record():
        return json.loads((tmp_path / "mesh.json").read_text())

    leaving = Leaving()
    with pytest.raises(ZeroDivisionError):
        stellate.mesh(TwoCircles(), "auto", checkpoint=tmp_path, on_progress=leaving)
    kept = record()
    assert kept["retries"] == 1 and "too coarse" in kept["epsilon_reason"]
    mesh = stellate.mesh(TwoCircles(), "auto", checkpoint=tmp_path)
    assert mesh.certified and mesh.report.certificate.components == 2
    assert mesh.report.epsilon == kept["spec"]["epsilon"]
    assert f"epsilon {mesh.report.epsilon:g}, {mesh.report.epsilon_reason}" == leaving.told[2]
    assert record() == kept


def test_one_process_at_a_time(tmp_path):
    seen = []

    def twice(progress):
        with pytest.raises(stellate.FailedPrecondition, match="another process") as caught:
            stellate.mesh(manifolds.Torus(), 0.2, checkpoint=tmp_path)
        seen.append(caught.value)

    stellate.mesh(manifolds.Torus(), 0.2, checkpoint=tmp_path, on_progress=twice)
    assert seen


def test_a_server_that_comes_to_its_end_is_waited_for(tmp_path):
    """As that of a killed process does."""
    (tmp_path / "server").mkdir()
    holder = open(tmp_path / "server" / "lock", "w")
    fcntl.flock(holder, fcntl.LOCK_EX)
    timer = threading.Timer(0.5, holder.close)
    timer.start()
    assert stellate.mesh(manifolds.Torus(), 0.3, checkpoint=tmp_path).certified
    timer.join()


@pytest.mark.parametrize(
    "name, damage", [("mesh.json", "{"), ("mesh.json", "[]"), ("mesh.npz", "x")]
)
def test_a_damaged_directory_is_named(name, damage, tmp_path):
    stellate.mesh(manifolds.Torus(), 0.3, checkpoint=tmp_path)
    (tmp_path / name).write_text(damage)
    with pytest.raises(stellate.InvalidArgument, match=f"{name}.*remove"):
        stellate.mesh(manifolds.Torus(), 0.3, checkpoint=tmp_path)


def test_a_server_that_is_named_keeps_meshes_itself(tmp_path, server):
    with pytest.raises(stellate.InvalidArgument, match="private server"):
        stellate.mesh(manifolds.Torus(), 0.3, server, checkpoint=tmp_path / "c")
    assert not (tmp_path / "c").exists()


def test_what_is_put_down_is_readable(tmp_path):
    stellate.mesh(manifolds.Torus(), 0.3, checkpoint=tmp_path)
    record = json.loads((tmp_path / "mesh.json").read_text())
    assert record["spec"]["epsilon"] == 0.3 and record["spec"]["dimension"] == 2
