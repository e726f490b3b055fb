"""Walls through the pipe: batches of faces, clearances and conormals, in both framings."""

import pathlib
import shutil

import numpy as np
import pytest
import stellate
from stellate import manifolds, oracles
from stellate._pipe.framing import Question, reader
from stellate._pipe.greeting import Garbled, parse_greeting

PIPE = pathlib.Path(__file__).resolve().parents[3] / "clients" / "pipe"
COMMANDS = {
    "binary": f"perl {PIPE}/half_torus.pl",
    "text": f"mawk -W interactive -f {PIPE}/half_torus.awk",
}


@pytest.fixture(params=COMMANDS)
def half(request):
    if shutil.which(COMMANDS[request.param].split()[0]) is None:
        pytest.fail(f"docker/packages.txt: {COMMANDS[request.param]}")
    with stellate.CommandOracle(COMMANDS[request.param]) as oracle:
        yield oracle


def test_answers_are_those_of_a_clipped_torus(half):
    ours = oracles.Clipped(manifolds.Torus(), [oracles.HalfSpace([1, 0, 0])])
    assert (half.walls, half.dimension) == (1, 2)
    x = np.random.default_rng(1).uniform(-1, 1, (50, 3))
    y = half.closest_point(x)
    assert np.allclose(y, ours.closest_point(x))
    assert np.allclose(half.clearances(y), ours.clearances(y))
    near = ours.face_point(x, (0,)) + 0.05
    on = half.face_point(near, (0,))
    assert np.allclose(on, ours.face_point(near, (0,)), atol=1e-8)
    assert np.allclose(half.conormals(on, (0,)), ours.conormals(on, (0,)), atol=1e-7)
    assert half.face_point(on[:0], (0,)).shape == (0, 3)
    assert half.conormals(on[:0], (0,)).shape == (0, 1, 3)
    assert half.clearances(on[:0]).shape == (0, 1)


def test_the_doctor_examines_it_as_any_other(half):
    report = stellate.check(half)
    assert report.ok, report


def test_points_not_found_have_no_walls(half):
    with pytest.raises(stellate.NotConverged) as raised:
        half.face_point(np.array([[0.3, 0.0, 0.0], [0.1, 1.3, 0.1]]), (0,))
    assert raised.value.converged.tolist() == [False, True]


def greeted(tmp_path, words):
    """A command that says this as its first line."""
    program = tmp_path / "program.sh"
    program.write_text(f"echo 'stellate-oracle 1 text {words}'; cat >/dev/null\n")
    return stellate.CommandOracle(f"sh {program}")


@pytest.mark.parametrize(
    ("words", "error", "message"),
    [
        ("k=2 d=3 walls=1 box=0,0,0:1,1,1", stellate.InvalidArgument, "takes tangents"),
        ("k=3 d=3 tangents=1 box=0,0,0:1,1,1", stellate.InvalidArgument, "less than d = 3"),
        ("k=2 d=3 walls=65 tangents=1", stellate.OracleError, "whole number up to 64"),
    ],
)
def test_bad_first_lines_are_refused(tmp_path, words, error, message):
    with pytest.raises(error, match=message):
        greeted(tmp_path, words)


def test_a_solid_has_as_many_dimensions_as_space(tmp_path):
    with greeted(tmp_path, "k=3 d=3 walls=2 tangents=1 box=0,0,0:1,1,1") as oracle:
        assert oracle.walls == 2
    assert parse_greeting(b"stellate-oracle 1 text walls=64").walls == 64


def answer(question, text, came):
    reading = reader(question, text)
    assert reading.take(bytearray(came))
    return reading.finish()


def test_what_an_answer_lacks_is_told():
    question = Question(1, np.zeros((1, 2)), walls=2, face=(1,))
    assert question.to_bytes(text=True) == b"face 1 0 0 1\n0.0 0.0\n"
    assert question.to_bytes(text=False)[:20] == np.array([3, 1, 0, 1, 1], np.uint32).tobytes()
    whole = answer(question, True, b"1 2 3 4 5 6\n")
    assert whole.clearances.tolist() == [[3, 4]] and whole.conormals.tolist() == [[[5, 6]]]
    for came, words in ((b"1 2\n", "and 4 of walls"), (b"1 2 3 4 5 nan\n", "a conormal")):
        with pytest.raises(Garbled, match=words):
            answer(question, True, came)
    bare = np.array([1, 0], np.uint32).tobytes() + np.zeros(2).tobytes()
    with pytest.raises(Garbled, match="has no walls"):
        answer(question, False, bare)
    nowhere = answer(question, True, b"-\n")
    assert not nowhere.found.any() and nowhere.clearances.shape == (1, 2)
