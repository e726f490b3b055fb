"""What epsilon="auto" goes on with after a mesh that is not certified."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
import stellate
from stellate import Client, Mesh, _run, manifolds
from stellate._epsilon import finer


def report(epsilon=0.1, reach=0.2, certified=False, refuted=False, termination="CONVERGED"):
    certificate = SimpleNamespace(certified=certified, reach_refuted=refuted, estimated_reach=reach)
    return SimpleNamespace(epsilon=epsilon, termination=termination, certificate=certificate)


def test_a_mesh_that_was_too_coarse_is_followed_by_a_quarter_of_the_reach_that_it_shows():
    epsilon, why = finer(report(epsilon=0.1, reach=0.2))
    assert epsilon == 0.05
    assert why.startswith("a quarter of the reach, about 0.2 by the certificate of epsilon 0.1")
    assert finer(report(termination="NO_PROGRESS"))[0] == 0.05


def test_it_is_never_finer_at_once_than_a_quarter_of_before():
    epsilon, why = finer(report(epsilon=0.1, reach=0.001))
    assert epsilon == 0.025 and why.startswith("no finer at once, though")


@pytest.mark.parametrize(
    "last",
    [
        report(certified=True),
        report(refuted=True),
        report(reach=0.26),  # what was refused is something else
        report(reach=float("inf")),
        report(reach=0.0),  # of a run that saw none
        report(termination="VERTEX_BUDGET"),
        report(termination="CANCELLED"),
        report(epsilon=None),
    ],
)
def test_what_a_smaller_epsilon_would_not_mend_is_left_alone(last):
    assert finer(last) is None


@dataclasses.dataclass(frozen=True)
class Report:
    epsilon: float
    certificate: SimpleNamespace
    termination: str = "CONVERGED"
    epsilon_reason: str = ""

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
            SimpleNamespace(
                certified=info.epsilon <= client.enough,
                reach_refuted=False,
                estimated_reach=1.5 * info.epsilon,
            ),
        )

    def __iter__(self):
        none = np.zeros((0, 3)), np.zeros((0, 3), dtype=np.uint32)
        if self.every:
            yield Mesh(*none)
        yield Mesh(*none, self.report)


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
    monkeypatch.setattr(
        _run, "choose", lambda oracle, epsilon: (0.8, "so") if epsilon == "auto" else (epsilon, "")
    )


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
