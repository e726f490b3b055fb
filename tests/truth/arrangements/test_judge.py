"""The judge of arrangements finds what is wrong with a mesh that was right."""

import dataclasses
import pathlib
import sys

import numpy as np
import pytest

_HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(_HERE), str(_HERE.parents[2] / "clients" / "python")]

import stellate  # noqa: E402
from families import FAMILIES  # noqa: E402
from judge import judge, judge_surface  # noqa: E402


@dataclasses.dataclass
class Judged:
    points: np.ndarray
    simplices: np.ndarray
    labels: np.ndarray
    case: object
    epsilon: float
    alone: bool

    def wrong(self) -> str:
        by = judge_surface if self.alone else judge
        found = by(self.points, self.simplices, self.labels, self.case.truth, self.epsilon)
        return "; ".join(found.wrong)


@pytest.fixture(scope="module")
def server():
    with stellate.Server() as running:
        yield running


def meshed(family, server, alone=False):
    case = FAMILIES[family](np.random.default_rng(3))
    mesh = stellate.mesh(
        case.oracle, case.coarsest * case.motion.scale, server=server, boundary_only=alone or None
    )
    sides = mesh.labels[:, ::-1] if alone and np.linalg.det(case.motion.turn) < 0 else mesh.labels
    points, epsilon = case.motion.back(mesh.points), case.coarsest
    return Judged(points, mesh.simplices.copy(), np.array(sides), case, epsilon, alone)


@pytest.fixture(scope="module", params=["two discs, three labels", "ball in a cube"])
def right(request, server):
    made = meshed(request.param, server)
    assert made.wrong() == ""
    return made


@pytest.fixture
def mesh(right):
    arrays = (right.points, right.simplices, right.labels)
    return Judged(*(a.copy() for a in arrays), right.case, right.epsilon, right.alone)


def test_a_label_that_is_another(mesh):
    middles = mesh.points[mesh.simplices].mean(axis=1)
    deep = np.argmax(np.abs(mesh.case.truth.walls(middles)).min(axis=1))
    mesh.labels[deep] = 3 - mesh.labels[deep] if mesh.labels[deep] < 3 else 1
    wrong = mesh.wrong()
    assert "barycentres have another label" in wrong and "lie on no wall" in wrong


def test_labels_that_are_exchanged(mesh):
    mesh.labels = np.where(mesh.labels < 3, 3 - mesh.labels, mesh.labels)
    wrong = mesh.wrong()
    assert "have another label" in wrong and "between other labels" in wrong


def test_a_simplex_that_is_missing(mesh):
    middles = mesh.points[mesh.simplices].mean(axis=1)
    deep = np.argmax(np.abs(mesh.case.truth.walls(middles)).min(axis=1))
    mesh.simplices = np.delete(mesh.simplices, deep, axis=0)
    mesh.labels = np.delete(mesh.labels, deep)
    wrong = mesh.wrong()
    assert "lie on no wall" in wrong and "components and chi" in wrong


def test_a_simplex_that_is_there_twice(mesh):
    mesh.simplices = np.concatenate([mesh.simplices, mesh.simplices[:1]])
    mesh.labels = np.concatenate([mesh.labels, mesh.labels[:1]])
    assert "there twice" in mesh.wrong()


def test_a_vertex_off_its_wall(mesh):
    on = np.flatnonzero((np.abs(mesh.case.truth.walls(mesh.points)) < 1e-8).sum(axis=1) == 1)
    mesh.points[on[0]] += 1e-4
    assert "lie on no wall" in mesh.wrong()


def test_two_vertices_that_are_one(mesh):
    far = np.argmax(np.linalg.norm(mesh.points - mesh.points[0], axis=1))
    mesh.simplices = np.sort(np.where(mesh.simplices == far, 0, mesh.simplices), axis=1)
    assert "touches itself" in mesh.wrong()


def test_another_size(mesh):
    volumes = {label: (1.5 * v, doubt) for label, (v, doubt) in mesh.case.truth.volumes.items()}
    mesh.case = dataclasses.replace(
        mesh.case, truth=dataclasses.replace(mesh.case.truth, volumes=volumes)
    )
    assert "has the volume" in mesh.wrong()


def test_a_boundary_alone(server):
    mesh = meshed("ball in a cube", server, alone=True)
    assert mesh.wrong() == ""
    turned = dataclasses.replace(mesh, labels=mesh.labels[:, ::-1])
    assert "has the volume" in turned.wrong()
    torn = dataclasses.replace(mesh, simplices=mesh.simplices[1:], labels=mesh.labels[1:])
    assert "is not closed" in torn.wrong()
