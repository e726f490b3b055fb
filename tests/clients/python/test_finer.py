"""What epsilon="auto" goes on with after a mesh that is not certified."""

import dataclasses
import json
import pathlib
from types import SimpleNamespace

import numpy as np
import pytest
import stellate
from stellate import Client, FinishedMesh, Mesh, _run, manifolds
from stellate._epsilon import finer

HERE = pathlib.Path(__file__).resolve().parent

CASES = json.loads((HERE.parents[1] / "conformance" / "finer.json").read_text())


@pytest.mark.parametrize("case", CASES, ids=[case["about"] for case in CASES])
def test_what_a_mesh_is_followed_by_is_what_the_kit_says(case):
    said = {
        "certified": False,
        "reach_refuted": False,
        "termination": "CONVERGED",
        **case["report"],
    }
    certificate = SimpleNamespace(
        certified=said["certified"],
        reach_refuted=said["reach_refuted"],
        estimated_reach=float(said["estimated_reach"]),
    )
    last = SimpleNamespace(
        epsilon=said["epsilon"], termination=said["termination"], certificate=certificate
    )
    then = case["then"]
    assert finer(last) == (then and (then["epsilon"], then["reason"]))


def test_a_mesh_without_an_epsilon_of_its_own_is_left_alone():
    assert finer(dataclasses.replace(Report(0.1, shows(0.2)), epsilon=None)) is None
    assert finer(Report(0.1, shows(0.2))) is not None


def shows(reach, certified=False):
    return SimpleNamespace(certified=certified, reach_refuted=False, estimated_reach=reach)


@dataclasses.dataclass(frozen=True)
class Report:
    epsilon: float
    certificate: SimpleNamespace
    termination: str = "CONVERGED"
    epsilon_reason: str = ""
    oracle: str = ""

    @property
    def certified(self):
        return self.certificate.certified


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
        self.report = Report(
            info.epsilon,
            shows(1.5 * info.epsilon, certified=info.epsilon <= client.enough),
        )

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
    [(1, [0.8]), (0.4, [0.8, 0.3]), (0.2, [0.8, 0.3, 0.11]), (0.01, [0.8, 0.3, 0.11])],
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
