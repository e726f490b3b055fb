"""What epsilon="auto" goes on with after a mesh that is not certified."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
import stellate
from stellate import Client, FinishedMesh, Mesh, _run, manifolds
from stellate.report import FinerEpsilon


@dataclasses.dataclass(frozen=True)
class Report:
    epsilon: float
    certified: bool
    finer: FinerEpsilon | None
    epsilon_reason: str = ""


class Server(Client):
    """Makes nothing: a mesh of it is certified where epsilon is fine enough."""

    def __init__(self, enough):
        self.enough, self.asked, self.deleted = enough, [], []

    def create(self, oracle, epsilon, **criteria):
        self.asked.append(epsilon)
        return SimpleNamespace(name=f"meshes/{len(self.asked)}", epsilon=epsilon)

    def delete(self, name, wait=True):
        self.deleted.append(name)


class Following:
    def __init__(self, client, info, on_progress, every):
        self.every = every
        certified = info.epsilon <= client.enough
        finer = None if certified else FinerEpsilon(info.epsilon / 2, "it was too coarse")
        self.report = Report(info.epsilon, certified, finer)

    def __iter__(self):
        none = np.zeros((0, 3)), np.zeros((0, 3), dtype=np.uint32)
        if self.every:
            yield Mesh(*none)
        yield FinishedMesh(*none, self.report)


class Workers:
    failure = None

    def __init__(self, *_):
        pass

    def finish(self):
        pass

    def stop(self):
        pass

    def join(self, seconds):
        pass


@pytest.fixture
def apart(monkeypatch):
    monkeypatch.setattr(_run, "Following", Following)
    monkeypatch.setattr(_run, "_Workers", Workers)

    def choose(oracle, epsilon, check, tell):
        return (0.8, "so") if epsilon == "auto" else (epsilon, "")

    monkeypatch.setattr(_run, "choose", choose)


@pytest.mark.parametrize(
    ("enough", "asked"),
    [(1, [0.8]), (0.4, [0.8, 0.4]), (0.2, [0.8, 0.4, 0.2]), (0.01, [0.8, 0.4, 0.2])],
)
def test_auto_goes_on_until_it_is_certified_or_twice(apart, enough, asked):
    server = Server(enough)
    mesh = stellate.mesh(manifolds.Sphere(2), "auto", server)
    assert server.asked == asked
    assert server.deleted == [f"meshes/{i + 1}" for i in range(len(asked))]
    assert mesh.report.epsilon == asked[-1] and mesh.certified == (enough >= asked[-1])
    assert mesh.report.epsilon_reason == "so" or "too coarse" in mesh.report.epsilon_reason
    *_, last = stellate.watch(manifolds.Sphere(2), "auto", Server(enough))
    assert last.report == mesh.report


def test_an_epsilon_that_was_given_is_kept(apart):
    server = Server(0.1)
    assert not stellate.mesh(manifolds.Sphere(2), 0.8, server).certified
    assert server.asked == [0.8]
