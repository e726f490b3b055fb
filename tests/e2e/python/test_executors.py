"""Oracles on executors: real processes, which die and raise as processes do."""

import concurrent.futures as futures
import multiprocessing
import os
import pathlib
import signal
import threading

import numpy as np
import pytest
import stellate
from stellate import manifolds

EPSILON = 0.3
_SPAWN = multiprocessing.get_context("spawn")


class Torus:
    """A torus that may misbehave once, and leaves a mark in `marks` for each process it is in."""

    dimension, ambient_dimension = 2, 3
    bounding_box = manifolds.Torus().bounding_box

    def __init__(self, marks, mischief=""):
        self.marks, self.mischief, self.torus = str(marks), mischief, manifolds.Torus()

    def _first_time(self, what):
        try:
            (pathlib.Path(self.marks) / what).touch(exist_ok=False)
        except FileExistsError:
            return False
        return True

    def closest_point(self, points):
        (pathlib.Path(self.marks) / f"process-{os.getpid()}").touch()
        if self.mischief == "die" and self._first_time("died"):
            os.kill(os.getpid(), signal.SIGKILL)
        if self.mischief == "always die":
            os.kill(os.getpid(), signal.SIGKILL)
        if self.mischief == "raise":
            raise Odd("the solver", "has no licence")
        if self.mischief == "interrupted":
            raise futures.CancelledError("what an executor may raise, too")
        if self.mischief == "hang":
            (pathlib.Path(self.marks) / "hanging").touch()
            threading.Event().wait()
        return self.torus.closest_point(points)


class Odd(Exception):
    """Cannot be unpickled: its __init__ wants more than Exception keeps."""

    def __init__(self, who, what):
        super().__init__(f"{who} {what}")


def processes(count=2):
    return futures.ProcessPoolExecutor(count, mp_context=_SPAWN)


@pytest.fixture(scope="module")
def undisturbed(server):
    return stellate.mesh(manifolds.Torus(), EPSILON, server=server)


@pytest.fixture
def declare(client):
    """A function that declares a mesh for an oracle; what is left of it goes in the end."""
    names = []

    def make(oracle):
        names.append(client.create(oracle, EPSILON).name)
        return names[-1]

    yield make
    for name in names:
        client.delete(name)


def same(one, other):
    return (
        one.points.tobytes() == other.points.tobytes()
        and one.simplices.tobytes() == other.simplices.tobytes()
    )


def test_processes_make_the_same_mesh(client, declare, tmp_path):
    plain = stellate.mesh(Torus(tmp_path), EPSILON, server=client)
    oracle = Torus(tmp_path)
    name = declare(oracle)
    with processes() as pool:
        states = stellate.executors.workers_on(pool, oracle, name, 4, server=client).wait()
    assert states == ["SUCCEEDED"] * 4
    assert same(stellate.download(name, server=client), plain)
    elsewhere = [mark.name for mark in tmp_path.glob("process-*")]
    assert f"process-{os.getpid()}" in elsewhere and len(elsewhere) >= 2


def test_tangents_go_along(client, declare, undisturbed):
    name = declare(manifolds.Torus())
    with futures.ThreadPoolExecutor(2) as pool:
        stellate.executors.workers_on(pool, manifolds.Torus(), name, 2, server=client).wait()
    assert same(stellate.download(name, server=client), undisturbed)


def test_an_executor_made_anew_survives_a_dead_process(client, declare, tmp_path, caplog):
    name = declare(Torus(tmp_path))
    workers = stellate.executors.workers_on(
        processes, Torus(tmp_path, "die"), name, 2, server=client
    )
    assert workers.wait() == ["SUCCEEDED"] * 2
    assert (tmp_path / "died").exists() and "making another" in caplog.text
    plain = stellate.mesh(Torus(tmp_path), EPSILON, server=client)
    assert same(stellate.download(name, server=client), plain)


def test_a_broken_pool_is_no_failure_of_the_oracle(client, declare, tmp_path):
    name = declare(Torus(tmp_path))
    with processes() as pool:
        workers = stellate.executors.workers_on(
            pool, Torus(tmp_path, "die"), name, 2, server=client
        )
        with pytest.raises(stellate.ExecutorError, match="new executor") as broken:
            workers.wait()
    assert isinstance(broken.value.__cause__, futures.BrokenExecutor)
    assert not client.get(name).over
    with processes() as pool:  # as the message says
        stellate.executors.workers_on(pool, Torus(tmp_path), name, 2, server=client).wait()
    assert stellate.download(name, server=client).certified


def test_a_chunk_that_always_kills_is_given_up(client, declare, tmp_path):
    name = declare(Torus(tmp_path))
    workers = stellate.executors.workers_on(
        processes, Torus(tmp_path, "always die"), name, 1, server=client
    )
    with pytest.raises(stellate.ExecutorError, match="3 times"):
        workers.wait()
    assert not client.get(name).over


def test_what_the_oracle_raises_is_told_as_its_own(client, declare, tmp_path):
    name = declare(Torus(tmp_path))
    with processes(1) as pool:
        workers = stellate.executors.workers_on(
            pool, Torus(tmp_path, "raise"), name, 2, server=client
        )
        with pytest.raises(stellate.OracleError, match="the solver has no licence") as raised:
            workers.wait()
    assert "in closest_point" in str(raised.value.__cause__)  # the other process's traceback
    with pytest.raises(stellate.OracleError, match="the solver has no licence"):
        stellate.download(name, server=client)


def test_an_oracles_errors_are_not_taken_for_the_executors(client, declare, tmp_path):
    name = declare(Torus(tmp_path))
    with futures.ThreadPoolExecutor(1) as pool:
        workers = stellate.executors.workers_on(
            pool, Torus(tmp_path, "interrupted"), name, 1, server=client
        )
        with pytest.raises(futures.CancelledError):
            workers.wait()
    assert client.get(name).state == "FAILED"


def test_answers_that_break_a_rule_are_the_oracles(client, declare, tmp_path):
    class Flat(Torus):
        def closest_point(self, points):
            return np.full(points.shape, np.nan)

    name = declare(Torus(tmp_path))
    with futures.ThreadPoolExecutor(1) as pool:
        with pytest.raises(stellate.OracleError, match="not finite") as raised:
            stellate.executors.workers_on(pool, Flat(tmp_path), name, 1, server=client).wait()
    assert raised.value.reason == "ORACLE_NOT_FINITE"


def test_leaving_takes_the_workers_away_and_the_mesh_stays(client, declare, tmp_path):
    name = declare(Torus(tmp_path))
    pool = processes(1)
    with stellate.executors.workers_on(
        pool, Torus(tmp_path, "hang"), name, 2, server=client
    ) as workers:
        while not (tmp_path / "hanging").exists():
            with pytest.raises(TimeoutError):
                workers.wait(timeout=0.05)
    assert workers.wait() == ["", ""]  # left, without an error
    assert not client.get(name).over
    for process in list(pool._processes.values()):
        process.kill()
    pool.shutdown()
    with futures.ThreadPoolExecutor(1) as threads:
        stellate.executors.workers_on(threads, Torus(tmp_path), name, 1, server=client).wait()
    assert stellate.download(name, server=client).certified


@pytest.mark.parametrize("held", [threading.Lock(), lambda x: x], ids=["lock", "lambda"])
def test_what_cannot_be_sent_is_said(held, client, declare, tmp_path):
    oracle = Torus(tmp_path)
    oracle.held = held
    name = declare(oracle)
    words = "cannot be sent .*pickle.*: they .* no lambda and .* a file or a lock"
    with processes(1) as pool, pytest.raises(stellate.ExecutorError, match=words):
        stellate.executors.workers_on(pool, oracle, name, 1, server=client).wait()
    assert not client.get(name).over


def test_an_executor_that_is_closed_is_said(client, declare, tmp_path):
    pool = futures.ThreadPoolExecutor(1)
    pool.shutdown()
    name = declare(Torus(tmp_path))
    with pytest.raises(stellate.ExecutorError, match="shutdown"):
        stellate.executors.workers_on(pool, Torus(tmp_path), name, 1, server=client).wait()


@pytest.mark.parametrize("slots", [0, -1, 1.5])
def test_slots_are_a_whole_number(client, slots):
    with pytest.raises(ValueError, match="slots"):
        stellate.executors.workers_on(None, manifolds.Torus(), "meshes/x", slots, server=client)


def test_a_mesh_that_is_not_there(client):
    with futures.ThreadPoolExecutor(1) as pool:
        workers = stellate.executors.workers_on(
            pool, manifolds.Torus(), "meshes/" + "0" * 32, 2, server=client
        )
        with pytest.raises(stellate.MeshNotFound):
            workers.wait()
