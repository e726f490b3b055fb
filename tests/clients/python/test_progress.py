"""Reports and progress, as people read them."""

import dataclasses
import io
import itertools
import json
import sys
import threading
import types

import IPython.display
import numpy as np
import pytest
import shapes
import stellate
from stellate._generated import mesh_pb2
from stellate._notebook import NotebookBar, calm_output
from stellate.progress import ProgressBar


def progress(**changed):
    message = mesh_pb2.Progress(
        phase=mesh_pb2.PHASE_REFINING,
        round=7,
        queries=4000,
        vertices=3456,
        fraction=0.43,
        elapsed_seconds=1.5,
        remaining_seconds=2.0,
    )
    return dataclasses.replace(stellate.Progress.from_wire(message), **changed)


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_live_line_on_a_terminal(monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    out = Terminal()
    bar = stellate.progress_bar("torus", out)
    bar(progress())
    bar(progress(phase="DONE", fraction=1.0))
    bar.close()
    first, second = out.getvalue().split("\r")[1:]
    assert first.startswith("torus  43 % │") and "3,456 vertices" in first and "2 s left" in first
    assert second.startswith("torus 100 % │██████████") and second.endswith("\x1b[K\n")
    assert all(len(line.replace("\x1b[K", "").strip()) < 100 for line in (first, second))


@pytest.mark.parametrize("columns", ["20", "40", "80"])
def test_a_line_never_wraps(columns, monkeypatch):
    monkeypatch.setenv("COLUMNS", columns)
    out = Terminal()
    stellate.progress_bar("a rather long title", out)(progress())
    assert len(out.getvalue().replace("\r", "").replace("\x1b[K", "")) < int(columns)


def test_plain_lines_elsewhere_one_a_phase():
    out = io.StringIO()
    bar = stellate.progress_bar("torus", out)
    for _ in range(50):
        bar(progress())
    bar(progress(phase="CERTIFYING"))
    bar.close()
    lines = out.getvalue().splitlines()
    assert len(lines) == 2 and "refining, round 7" in lines[0] and "certifying" in lines[1]
    assert "\r" not in out.getvalue() and "\x1b" not in out.getvalue()


class Heard(Terminal):
    """A terminal that tells when something was written there."""

    def __init__(self):
        super().__init__()
        self.spoke = threading.Event()

    def flush(self):
        self.spoke.set()


def test_who_gave_no_progress_is_told_once_that_work_goes_on():
    screen = Heard()
    patience = stellate.progress.Patience(screen, 0.0)
    patience(progress())
    with patience:
        assert screen.spoke.wait(60)
    assert screen.getvalue().count("\n") == 1
    assert "3,456 vertices by 4,000 queries so far" in screen.getvalue()
    assert "on_progress=stellate.progress_bar()" in screen.getvalue()


def test_what_was_noted_is_said_without_its_time_until_there_is_an_answer():
    screen = Heard()
    patience = stellate.progress.Patience(screen, 0.0)
    patience.note("waiting for the oracle's first answer, to 9 closest points, 5 s")
    patience(dataclasses.replace(progress(), vertices=0, queries=0))
    with patience:
        assert screen.spoke.wait(60)
    assert (
        "for 0 s, waiting for the oracle's first answer, to 9 closest points; on"
        in screen.getvalue()
    )


def test_what_is_over_soon_says_nothing():
    screen = Heard()
    with stellate.progress.Patience(screen, 3600.0) as patience:
        patience(progress())
    patience._timer.join(60)
    assert not patience._timer.is_alive() and screen.getvalue() == ""


def test_a_line_that_nobody_asked_for_is_for_people_alone():
    looks_on = stellate.progress.somebody_looks_on
    notebook = type("OutStream", (io.StringIO,), {"__module__": "ipykernel.iostream"})()
    assert looks_on(Terminal()) and looks_on(notebook)
    assert not looks_on(io.StringIO()) and not looks_on(None)
    elsewhere = []
    thread = threading.Thread(target=lambda: elsewhere.append(looks_on(Terminal())))
    thread.start()
    thread.join()
    assert elsewhere == [False]


def report(certified):
    message = mesh_pb2.Report(termination=mesh_pb2.TERMINATION_CONVERGED, elapsed_seconds=0.5)
    message.counts.vertices = 1234
    certificate = message.certificate
    certificate.certified = certified
    certificate.verdict = (
        "Certified: a closed 2-manifold" if certified else "3 links are not spheres"
    )
    certificate.closed = True
    certificate.bad_links = 0 if certified else 3
    certificate.links_are_spheres = certified
    certificate.components, certificate.euler_characteristic = 1, -8
    certificate.warnings.append("epsilon is coarse")
    return stellate.Report.from_wire(message, 0.1)


AS_THE_SERVER_SAYS = """\
          run  converged: no refinement rule applies any more
  certificate  CERTIFIED: a closed 2-manifold, of which much more could be said than fits into
               a line of the report
      warning  epsilon is coarse
"""


def test_a_report_is_shown_in_the_servers_words():
    message = mesh_pb2.Report(text=AS_THE_SERVER_SAYS)
    given = stellate.Report.from_wire(message, 0.1)
    assert str(given) + "\n" == AS_THE_SERVER_SAYS
    assert [title for title, _ in given.lines()] == ["run", "certificate", "warning"]
    assert given.lines()[1][1].endswith("than fits into\na line of the report")
    chosen = dataclasses.replace(given, epsilon_reason="for a reason " + "that is long " * 9)
    lines = str(chosen).splitlines()
    assert AS_THE_SERVER_SAYS.splitlines() == lines[:-2] and max(map(len, lines)) <= 100
    assert lines[-2].startswith("      epsilon  0.1, for a reason that is long")
    assert chosen.lines()[-1][0] == "epsilon" and lines[-1].startswith(" " * 15 + "that is")


def test_a_report_tells_what_came_of_the_mesh():
    assert report(True).certified and report(True).warnings == ("epsilon is coarse",)
    assert report(True).what_failed == "" and not report(False).certified
    assert report(False).what_failed == "3 links are not spheres"


def test_a_report_of_an_earlier_checkpoint_still_has_its_verdict():
    fields = dataclasses.asdict(report(False))
    del fields["text"]
    kept = stellate.Report.from_fields(fields)
    assert str(kept) == "  certificate  3 links are not spheres"


def test_a_failure_is_told():
    message = mesh_pb2.Report(termination=mesh_pb2.TERMINATION_ORACLE_FAILED)
    message.failure.reason, message.failure.message = "ORACLE_NOT_FINITE", "query 3 is nan"
    failed = stellate.Report.from_wire(message)
    assert failed.failure == stellate.report.Failure("ORACLE_NOT_FINITE", "query 3 is nan")


def test_a_mesh_says_that_it_is_not_certified():
    mesh = stellate.Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]]), report(False))
    for text in (repr(mesh), str(mesh)):
        assert "NOT CERTIFIED (CONVERGED)" in text
    good = repr(dataclasses.replace(mesh, report=report(True)))
    assert good.endswith(" 3 points, 1 simplices, CERTIFIED>")


# What the C++ client writes of the same report: see report_test.cc.
AS_JSON = (
    '{"termination": "ORACLE_FAILED", "failure": {"reason": "ORACLE_RAISED", "message": '
    '"a \\"quote\\""}, "epsilon": 0.1, "epsilon_reason": "", "counts": {"vertices": 1234567, '
    '"simplices": 42, "rounds": 0, "queries": 0, "tangent_queries": 0, "inserted_size": 0, '
    '"inserted_radius_edge": 0, "inserted_sliver": 0, "inserted_inconsistent": 0, '
    '"inserted_protection": 0, "duplicates": 0}'
    ', "certificate": {"certified": false, "verdict": "3 links", "warnings": ["coarse", "dear"], '
    '"closed": false, "bad_faces": 0, "links_are_spheres": false, "links_decided_exactly": false, '
    '"bad_links": 3, "inconsistent_simplices": 0, "unembedded_stars": 0, "fibre_failures": 0, '
    '"fibre_samples": 0, "max_circumradius": 0.25, "max_radius_edge": 0, "min_fatness": 0, '
    '"min_angle_degrees": 0, "max_tangent_angle_degrees": 0, "max_barycentre_distance": 0, '
    '"estimated_reach": null, "epsilon_over_reach": 0, "components": 1, '
    '"euler_characteristic": -8, "orientable": false, "level": "UNKNOWN", '
    '"declared_reach": 0, "reach_refuted": false, "proved_distance": 0, "answers_checked": 0, '
    '"violations": {"faces": [[1, 2], [1, 5]], "links": [], "stars": [7], "inconsistent": [], '
    '"fibres": [0, 3]}, "boundary_simplices": 0, "boundary_components": 0, '
    '"boundary_euler_characteristic": 0, "faces": [], "sharpest": null, "regions": [], '
    '"pinched_vertices": 0, "volume": 0, "only_too_coarse": false, "protection": null, "betti": [1, 10]}, "elapsed_seconds": 0.5, '
    f'"version": "{stellate.__version__}"}}'
)


def test_a_report_is_the_json_of_all_clients():
    message = mesh_pb2.Report(termination=mesh_pb2.TERMINATION_ORACLE_FAILED, elapsed_seconds=0.5)
    message.failure.reason, message.failure.message = "ORACLE_RAISED", 'a "quote"'
    message.counts.vertices, message.counts.simplices = 1234567, 42
    certificate = message.certificate
    certificate.verdict, certificate.bad_links = "3 links", 3
    certificate.warnings.extend(["coarse", "dear"])
    certificate.max_circumradius, certificate.estimated_reach = 0.25, float("inf")
    certificate.components, certificate.euler_characteristic = 1, -8
    certificate.betti.extend((1, 10))
    for kind, ids in {"faces": [[1, 2], [1, 5]], "stars": [7], "fibres": [0, 3]}.items():
        array = np.array(ids, dtype="<u4")
        wire = getattr(certificate.violations, kind)
        wire.shape.extend(array.shape)
        wire.data = array.tobytes()
    ours = stellate.Report.from_wire(message, 0.1)
    assert stellate.Report.from_fields(dataclasses.asdict(ours)) == ours
    assert stellate.Report.from_fields(json.loads(json.dumps(dataclasses.asdict(ours)))) == ours
    assert list(json.loads(AS_JSON)) == list(ours.to_dict())  # in this order
    assert json.loads(ours.to_json()) == json.loads(AS_JSON) == ours.to_dict()
    assert len(ours.to_json(indent=2).splitlines()) > 40
    assert stellate.Report.from_wire(message).to_dict()["epsilon"] is None


class Cell:
    """What IPython.display shows, and how often it changed."""

    def __init__(self, monkeypatch):
        self.outputs = []
        monkeypatch.setattr(IPython.display, "display", self._display)

    def _display(self, shown, display_id):
        assert display_id is True
        states = [shown.data]
        self.outputs.append(states)
        return types.SimpleNamespace(update=lambda again: states.append(again.data))


def test_a_notebook_has_a_bar_and_the_mesh_in_its_cell(monkeypatch, capsys):
    cell = Cell(monkeypatch)
    bar = NotebookBar("a <torus>", ProgressBar._numbers)
    bar.note("epsilon 0.1 & so on")
    bar(progress(simplices=0))
    bar.look(lambda: pytest.fail("there is nothing to see yet"))
    bar(progress(simplices=24, phase="DONE", fraction=1.0))
    bar.look(shapes.torus)
    bar.close()
    (states,) = cell.outputs  # one, that changed
    assert "a &lt;torus&gt;" in states[-1] and "epsilon 0.1 &amp; so on" in states[-1]
    assert 'value="43"' in states[1] and "img" not in states[1]
    assert 'value="100"' in states[-1] and "done, round 7, 3,456 vertices" in states[-1]
    assert "data:image/png;base64,iVBOR" in states[-1]
    bar(progress())
    assert len(cell.outputs) == 2 and "img" not in cell.outputs[1][0]  # of the next mesh
    assert capsys.readouterr() == ("", "")


def test_pictures_take_a_small_share_of_the_time(monkeypatch):
    Cell(monkeypatch)
    clock = itertools.count(0, 3)  # each look at it is 3 s later
    at_three = types.SimpleNamespace(monotonic=lambda: float(next(clock)))
    monkeypatch.setattr(stellate._notebook, "time", at_three)
    bar, looks = NotebookBar("", ProgressBar._numbers), []
    for _ in range(10):
        bar(progress(simplices=24))
        bar.look(lambda: looks.append(1) or shapes.torus())
    passed = next(clock)
    assert 2 <= len(looks) <= passed / 30 + 1  # 3 s for one leave 30 s until the next


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_what_cannot_be_drawn_leaves_the_bar(monkeypatch, dimension):
    cell = Cell(monkeypatch)
    bar = NotebookBar("", ProgressBar._numbers)
    bar(progress(simplices=70_000))
    bar.look(lambda: pytest.fail("it is too large to draw while others wait"))
    bar(progress(simplices=1, phase="DONE"))
    bar.look(lambda: stellate.Mesh(np.zeros((0, 3)), np.zeros((0, dimension + 1), dtype=int)))
    assert "img" not in cell.outputs[0][-1]


def test_who_is_in_no_notebook_gets_lines(monkeypatch):
    assert isinstance(stellate.progress_bar(), ProgressBar)
    kind = type("OutStream", (io.StringIO,), {"__module__": "ipykernel.iostream"})
    monkeypatch.setattr(sys, "stderr", kind())
    assert isinstance(stellate.progress_bar(), NotebookBar)
    assert isinstance(stellate.progress_bar(file=Terminal()), ProgressBar)
    assert calm_output() is sys.stdout
