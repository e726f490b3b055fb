"""`stellate doctor --listen`: oracles of workers, which come as to a server."""

import contextlib
import json
import pathlib
import subprocess

import pytest
import stellate
from stellate.manifolds import ProductOfCircles, Sphere, Torus
from stellate.oracles import Clipped, HalfSpace, Solid


@contextlib.contextmanager
def doctor(*flags):
    """The process, and a client of it."""
    program = pathlib.Path(stellate.find_stellated()).parent / "stellate"
    command = [program, "doctor", "--listen", "127.0.0.1:0", "--exit-with-parent", *flags]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        said, _, address = process.stdout.readline().strip().rpartition(" ")
        assert said == "stellate doctor listening on"
        with stellate.Client(address) as client:
            yield process, client
        process.terminate()


def examine(client, oracle, epsilon):
    name = client.create(oracle, epsilon).name
    return client.serve(oracle, name)


class Moving(Torus):
    def closest_point(self, x):
        return 1.01 * super().closest_point(x)


class Raising(Torus):
    def closest_point(self, x):
        raise ArithmeticError("no such surface")


def test_finds_what_the_doctor_beside_the_oracle_finds():
    with doctor("--json") as (process, client):
        for oracle in Torus(), ProductOfCircles(), Sphere():
            assert examine(client, oracle, 0.01) == "SUCCEEDED"
        process.terminate()
        text = process.stdout.read()
    assert process.wait() == 0
    decoder, reports = json.JSONDecoder(), []
    while text.strip():
        report, end = decoder.raw_decode(text.lstrip())
        reports.append(report)
        text = text.lstrip()[end:]
    for report, oracle in zip(reports, [Torus(), ProductOfCircles(), Sphere()], strict=True):
        own = stellate.check(oracle, 0.01)
        assert report["ok"] and own.ok, report["text"]
        assert report["reach"] == pytest.approx(own.reach, rel=0.05)
        assert report["pieces"] == own.pieces
        assert report["epsilon"] == pytest.approx(own.reach / 4, rel=0.1)
        codes = {finding["code"] for finding in report["findings"]}
        assert codes == {finding.code for finding in own.findings}


def test_oracles_that_break_their_contract():
    with doctor() as (process, client):
        assert examine(client, Moving(), 0.1) == "SUCCEEDED"
        with pytest.raises(ArithmeticError, match="no such surface"):
            examine(client, Raising(), 0.1)
        name = client.create(Torus(), 0.1).name
        client.delete(name)
        with pytest.raises(stellate.MeshNotFound):
            client.serve(Torus(), name)
        process.terminate()
        text = " ".join(process.stdout.read().split())
    assert process.wait() == 1
    assert "error NOT_IDEMPOTENT: closest_point moves its own answer" in text
    assert "error RAISED: ClosestPoint failed on a batch of 400: ArithmeticError: no such" in text


def half_a_sphere():
    return Clipped(Sphere(), [HalfSpace([0, 0, 1], -0.1)])


class Inward(Clipped):
    def conormals(self, points, face):
        return -super().conormals(points, face)


class Afield(Clipped):
    def face_point(self, points, face):
        return super().face_point(points, face) + 0.01


WALLED = [
    half_a_sphere(),
    Solid(ball=([0, 0, 0], 1)),
    Inward(Sphere(), [HalfSpace([0, 0, 1], -0.1)]),
    Afield(Sphere(), [HalfSpace([0, 0, 1], -0.1)]),
    Clipped(Sphere(), [HalfSpace([0, 0, 1], 5)]),
    Clipped(half_a_sphere(), [HalfSpace([0, 0.2, 1], -0.1)]),
    Clipped(half_a_sphere(), [HalfSpace([0, 0, 1], -5)]),
    Solid([HalfSpace([0, 1, 0]), HalfSpace([0.5, -(0.75**0.5), 0])], ball=([0, 0, 0], 1)),
]
OF_WALLS = [
    set(),
    set(),
    {"CONORMAL_INWARD"},
    {"FACE_OFF_MANIFOLD"},
    {"NOTHING_LEFT"},
    {"WALLS_TANGENTIAL"},
    {"WALL_CUTS_NOTHING"},
    {"ACUTE_EDGE"},
]


@pytest.mark.parametrize("oracle, expected", zip(WALLED, OF_WALLS, strict=True))
def test_walls_are_examined_as_beside_the_oracle(oracle, expected):
    with doctor("--json") as (process, client):
        assert examine(client, oracle, 0.05) == "SUCCEEDED"
        process.terminate()
        report = json.loads(process.stdout.read())
    codes = {finding["code"] for finding in report["findings"]}
    assert expected <= codes, report["text"]
    own = stellate.check(oracle, 0.05)
    of_walls = ("WALL", "FACE", "CONORMAL", "ACUTE", "NOTHING_LEFT")
    assert {code for code in codes if code.startswith(of_walls)} == {
        code for code in own.codes if code.startswith(of_walls)
    }
    assert report["ok"] == own.ok
    if own.reach is not None:
        assert report["reach"] == pytest.approx(own.reach, rel=0.2)


def test_a_worker_that_goes_leaves_a_report():
    class Leaving(Torus):
        def closest_point(self, x):
            client.close()
            return super().closest_point(x)

    with doctor() as (process, client):
        with pytest.raises(Exception):  # noqa: B017 - gRPC's own, of a channel that was closed
            examine(client, Leaving(), 0.1)
        assert "the worker went away before it had answered" in process.stdout.readline()
