"""epsilon: always asked for, or found from the oracle's answers."""

import functools
import io
import re
import subprocess
import threading

import numpy as np
import pytest
import stellate
from stellate import manifolds
from stellate._command_line import main
from stellate._waiting import Waiting
from stellate.viewer import find_stellate


def test_epsilon_has_no_default(client):
    for call in (stellate.mesh, client.create, lambda oracle: next(stellate.watch(oracle))):
        with pytest.raises(
            TypeError, match='^epsilon is missing: .* or epsilon="auto", which takes'
        ):
            call(manifolds.Torus())


@pytest.mark.parametrize("command", ["mesh", "declare"])
def test_command_lines_of_both_languages_say_alike_what_is_missing(command, capfd):
    assert main([command, "stellate.manifolds:Torus"]) == 2
    words = capfd.readouterr().err.splitlines()[0].removeprefix("stellate: ")
    assert words.startswith("--epsilon is required: ") and "or --epsilon auto" in words
    program = subprocess.run([find_stellate(), command, "torus"], capture_output=True, text=True)
    assert program.returncode == 2 and words in " ".join(program.stderr.split())


@pytest.mark.parametrize("make", [stellate.reconstruct, stellate.oracles.PointCloud])
def test_dimension_has_no_default(make, rng):
    with pytest.raises(TypeError, match="dimension is missing: .*2 for a surface: dimension=2"):
        make(rng.normal(size=(100, 3)))


@pytest.mark.parametrize(
    "oracle, expected",
    [(manifolds.Torus(1000.0, 400.0), 100.0), (manifolds.Sphere(2, radius=1e-3), 0.00025)],
)
def test_auto_goes_by_the_reach_whatever_the_unit(oracle, expected, server):
    seen = io.StringIO()
    mesh = stellate.mesh(oracle, "auto", server, on_progress=stellate.progress_bar("m:", seen))
    report = mesh.report
    assert report.certified and report.epsilon == pytest.approx(expected, rel=0.05)
    assert report.epsilon == float(f"{report.epsilon:.2g}")
    assert report.epsilon_reason.startswith("a quarter of the reach, about ")
    assert report.to_dict()["epsilon_reason"] == report.epsilon_reason
    said = f"{report.epsilon:g}, {report.epsilon_reason}"
    assert f"epsilon  {said}" in str(report)
    first, second = seen.getvalue().splitlines()[:2]
    assert first == "m: epsilon='auto': the oracle is asked for its reach first"
    assert second == f"m: epsilon {said}"
    given = stellate.mesh(oracle, report.epsilon, server)
    assert np.array_equal(given.points, mesh.points) and given.report.epsilon_reason == ""


def test_auto_is_the_same_by_any_way(client):
    chosen = client.get(client.create(manifolds.Torus(), "auto").name).epsilon
    *_, last = stellate.watch(manifolds.Torus(), "auto", client)
    assert last.report.epsilon == chosen == pytest.approx(0.1, rel=0.05)


class Doubled(manifolds.Torus):
    """Answers half the way to the torus: no closest points."""

    def closest_point(self, x):
        return (x + super().closest_point(x)) / 2


def test_auto_refuses_an_oracle_that_breaks_its_contract(server):
    with pytest.raises(stellate.OracleError, match="NOT_IDEMPOTENT") as caught:
        stellate.mesh(Doubled(), "auto", server)
    assert caught.value.reason == "ORACLE_BREAKS_CONTRACT"


def test_what_is_misspelt_is_said_before_the_oracle_is_asked(server):
    class Untouchable(manifolds.Torus):
        def closest_point(self, x):
            raise AssertionError("was asked")

    with pytest.raises(stellate.InvalidArgument, match="'aut'"):
        stellate.mesh(Untouchable(), "aut", server)
    with pytest.raises(TypeError, match="max_vertices"):
        stellate.mesh(Untouchable(), "auto", server, max_vertex=10)


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize("epsilon", ["auto", 0.3])
def test_a_mesh_that_takes_long_says_so_on_a_terminal(epsilon, server, monkeypatch):
    screen, waiting = Terminal(), []

    def patience(file):
        waiting.append(stellate.progress.Patience(file, 3600.0))
        return waiting[-1]

    class Slow(manifolds.Torus):
        def closest_point(self, x):
            if not screen.getvalue():
                waiting[0]._timer.function()  # its time has passed
            return super().closest_point(x)

    monkeypatch.setattr("stellate._api.Patience", patience)
    monkeypatch.setattr("sys.stderr", screen)
    assert stellate.mesh(Slow(), epsilon, server).certified
    (line,) = screen.getvalue().splitlines()
    asked = "epsilon='auto': the oracle is asked for its reach first"
    assert line.startswith("stellate: at work for ") and (asked in line) == (epsilon == "auto")
    stellate.mesh(manifolds.Torus(), 0.3, server, on_progress=lambda progress: None)
    assert len(waiting) == 1


@pytest.mark.parametrize("batch", [1, 4])
def test_an_oracle_that_hangs_is_named_as_what_is_waited_for(batch, server, monkeypatch):
    told, goes_on, calls = [], threading.Event(), []

    class Hanging(manifolds.Torus):
        def closest_point(self, x):
            calls.append(len(x))
            if len(calls) == batch:
                goes_on.wait()
            return super().closest_point(x)

    class Bar(stellate.progress.ProgressBar):
        def note(self, text):
            told.append(text)
            if calls[batch - 1 :]:  # not of one that was only slow
                goes_on.set()

    monkeypatch.setattr("stellate._run.Waiting", functools.partial(Waiting, 0.01))
    monkeypatch.setattr("stellate._waiting._UNUSUAL", 0)
    assert stellate.mesh(Hanging(), 0.3, server, on_progress=Bar("", io.StringIO())).certified
    which = "first answer, to" if batch == 1 else "answer to"
    assert re.fullmatch(rf"waiting for the oracle's {which} \d+ \w.*, \d+ s", told[-1])


def test_a_note_breaks_a_live_line():
    screen = Terminal()
    bar = stellate.progress.ProgressBar("t", screen)
    bar._open = True
    bar.note("epsilon 0.1")
    assert screen.getvalue() == "\r\x1b[Kt epsilon 0.1\n"
    bar.close()
    assert screen.getvalue().count("\n") == 1
