"""`stellate reconstruct`, as a user's shell runs it."""

import json
import pathlib
import subprocess

import numpy as np
import pytest
import samples
import stellate
import topology

STELLATE = pathlib.Path(stellate.server.find_stellated()).parent / "stellate"


def reconstruct(*arguments, given=None, cwd):
    command = [STELLATE, "reconstruct", *map(str, arguments)]
    return subprocess.run(
        command, input=given, capture_output=True, text=True, cwd=cwd, timeout=300
    )


@pytest.fixture
def torus(rng, tmp_path):
    points = samples.torus(rng)
    np.savetxt(tmp_path / "torus.xyz", points, "%.17g")
    return points


def test_a_file_becomes_a_mesh(torus, tmp_path):
    done = reconstruct(
        "torus.xyz", "-k", 2, "-o", "t.txt", "-o", "t.ply", "--report", "r.json", cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert "CERTIFIED" in done.stdout
    mesh = stellate.load_txt(tmp_path / "t.txt")
    assert mesh.points.tobytes() == torus.tobytes()
    topology.assert_closed_manifold(mesh, 0, [1, 2, 1])
    python = stellate.reconstruct(torus, 2)
    assert mesh.simplices.tobytes() == python.simplices.tobytes()
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["reconstruction"] == python.report.to_dict()["reconstruction"]


def test_standard_input_and_more_columns(torus, tmp_path):
    rows = "\n".join(f"{x:.17g} {y:.17g} {z:.17g} 7" for x, y, z in torus)
    done = reconstruct("-", "-k", 2, "--ambient", 3, "--json", given=rows, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["certificate"]["certified"]


def test_axes_of_different_units(torus, tmp_path):
    units = np.array([2.0**-7, 512.0, 1.0])
    np.savetxt(tmp_path / "units.xyz", torus * units, "%.17g")
    scale = "--scale=0.0078125,512,1"
    done = reconstruct("units.xyz", "-k", 2, scale, "-o", "t.txt", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    mesh, python = stellate.load_txt(tmp_path / "t.txt"), stellate.reconstruct(torus, 2)
    assert mesh.points.tobytes() == (torus * units).tobytes()
    assert np.array_equal(mesh.simplices, python.simplices)
    words = "coordinates were divided by 0.0078125, 512, 1, and lengths and angles are of these"
    assert done.stdout.rstrip().endswith(f"\n{'scale':>13}  {words}")
    for wrong in ("--scale=1,2", "--scale=1,2,0", "--scale=1,2,inf"):
        refused = reconstruct("units.xyz", "-k", 2, wrong, cwd=tmp_path)
        assert refused.returncode == 2 and "scale has to be 3 positive" in refused.stderr


def test_columns_of_a_scan(torus, tmp_path):
    rows = "\n".join(f"12:00,{x:.17g},{y:.17g},{z:.17g},7" for x, y, z in torus)
    (tmp_path / "scan.csv").write_text(f"time,x,y,z,intensity\n{rows}\n")
    asked = reconstruct("scan.csv", "-k", 2, cwd=tmp_path)
    assert asked.returncode == 2 and "--columns x,y,z" in asked.stderr
    done = reconstruct(
        "scan.csv", "-k", 2, "--columns", "x,y,z", "--weights", "only", "-o", "t.txt", cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert "Betti numbers 1 2 1" in done.stdout
    assert stellate.load_txt(tmp_path / "t.txt").points.tobytes() == torus.tobytes()


def test_what_is_not_certified_is_written_and_exits_with_1(torus, tmp_path):
    np.save(tmp_path / "half.npy", torus[torus[:, 0] > 0])
    done = reconstruct("half.npy", "-k", 2, "-o", "half.txt", cwd=tmp_path)
    assert done.returncode == 1
    assert "NOT CERTIFIED" in done.stdout and "EDGE" in done.stdout
    assert (tmp_path / "half.txt").exists()


@pytest.mark.parametrize(
    "arguments, given, words",
    [
        (["-"], "1 2 3\n", "-k is required: the dimension"),
        (["-", "-k", "2"], "1 2 3\n4 5\n", "line 2: has 2 numbers, and line 1 has 3"),
        (["-", "-k", "2"], "1 2 3\n4 nan 5\n", "line 2: 'nan' is no finite number"),
        (["-", "-k", "2"], "", "standard input cannot be read as points: it has no points"),
        (["-", "-k", "3"], "1 2 3\n" * 9, "dimension (k) is 3 and ambient_dimension (d) is 3"),
        (["-", "-k", "1"], "1 2\n", "points is 1"),
        (["missing.ply", "-k", "2"], None, "it is not there"),
        (["-", "-k", "2", "--ambient", "4"], "1 2 3\n", "4 are asked for"),
        (["-", "-k", "2", "-o", "a.stl"], "1 2 3 4\n", "stl"),
        (["-", "-k", "1", "--drop", "2"], "1 2\n" * 9, "drop is 2"),
        (["-", "-k", "1", "--weights", "no"], "1 2\n" * 9, "--weights"),
        (["-", "-k", "1", "--columns", "a,b"], "x y\n1 2\n", "no column 'a'"),
        (["-", "-k", "1", "--columns", "1", "--ambient", "2"], "1 2\n", "excludes"),
    ],
)
def test_mistakes_are_named_and_exit_with_2(arguments, given, words, tmp_path):
    done = reconstruct(*arguments, given=given, cwd=tmp_path)
    assert done.returncode == 2, done
    assert words in done.stderr


def test_help_says_what_there_is(tmp_path):
    said = reconstruct("--help", cwd=tmp_path).stdout
    for option in (
        "--ambient",
        "--columns",
        "--noise",
        "--reach",
        "--weights",
        "--steiner",
        "--drop",
        "--open",
        "--server",
        "--report",
    ):
        assert option in said


def test_a_file_in_place_of_a_manifold_is_led_here(tmp_path):
    (tmp_path / "scan.xyz").write_text("1 2 3\n")
    command = [STELLATE, "mesh", "scan.xyz", "-e", "0.1"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 2
    assert "'scan.xyz' is a file: points in one are meshed by 'stellate reconstruct'" in done.stderr
