"""What many ranks make together is what one process makes, to the last byte."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from jobs import ROOT, job, mesh

MANIFOLDS = {
    "torus": ["torus:1:0.4", "-e", ".05"],
    "sphere": ["sphere:2", "-e", ".1"],
    "clifford": ["clifford-torus", "-e", ".15"],
    "rp2": ["rp2", "-e", ".1"],
    "sphere3": ["sphere:3", "-e", ".3"],
    "so3": ["so3", "-e", ".4"],
    "curve": ["torus-knot:2:3", "-e", ".02"],
    "speculative": ["torus:1:0.4", "-e", ".08", "--speculative"],
    "estimated_sizes": ["ellipsoid:1:0.6:0.4", "-e", ".2", "--size-rate", ".2"],
    "proved": ["sphere:2", "-e", ".08", "--reach", ".95"],
    "several_threads": ["torus:1:0.4", "-e", ".08", "--workers", "3", "--max-chunk", "50"],
    "solid": ["--solid", "box(-1,1) - cylinder(x, .5)", "-e", ".35"],
    "materials": ["--material", "a=ball(1)", "--material", "b=ball(.5)", "-e", ".3"],
    "boundary": ["--solid", "ball(1) - ball(.5, at=(1,0,0))", "-e", ".25", "--boundary-only"],
    "command": ["--oracle-command", f"perl {ROOT}/clients/pipe/torus.pl", "-e", ".1"],
    "not_certified": ["torus:1:0.4", "-e", ".05", "--max-vertices", "500"],
}


def said(report: Path) -> Any:
    """A report without its clock."""
    content = json.loads(report.read_text())
    del content["elapsed_seconds"]
    return content


@pytest.mark.parametrize("name", MANIFOLDS)
def test_the_files_are_those_of_one_process(name: str, tmp_path: Path) -> None:
    asked = MANIFOLDS[name]
    alone = mesh(*asked, "-o", tmp_path / "alone.vtu", "--report", tmp_path / "alone.json")
    assert alone.returncode == (1 if name == "not_certified" else 0), alone.stderr
    for count in (1, 2, 4):
        file, report = tmp_path / f"{count}.vtu", tmp_path / f"{count}.json"
        done = job(count, *asked, "-o", file, "--report", report)
        assert done.returncode == alone.returncode, done.stderr
        assert said(report) == said(tmp_path / "alone.json")
        assert file.read_bytes() == (tmp_path / "alone.vtu").read_bytes(), f"{count} ranks"


def test_several_files_of_any_format(tmp_path: Path) -> None:
    names = ["a.txt", "a.off", "a.obj", "a.ply", "a.stl", "a.npz", "a.msh", "a.glb", "a.3mf"]
    written = []
    for folder, run in (("alone", mesh), ("parts", lambda *words: job(2, *words))):
        (tmp_path / folder).mkdir()
        outputs = [word for name in names for word in ("-o", tmp_path / folder / name)]
        assert run("torus:1:0.4", "-e", ".1", *outputs).returncode == 0
        written.append({name: (tmp_path / folder / name).read_bytes() for name in names})
    for name in names:
        assert written[0][name] == written[1][name], name


def test_a_report_for_people_comes_once() -> None:
    done = job(3, "torus:1:0.4", "-e", ".2", "--json")
    assert json.loads(done.stdout)["certificate"]["certified"]
