"""The Snakemake example: its meshes, its table, and that it does nothing twice."""

import csv
import os
import shutil
import subprocess

import pytest

EPSILONS = ["0.2", "0.1"]


@pytest.fixture
def snakemake(repository, tmp_path):
    source = repository / "examples" / "snakemake"
    for name in ("Snakefile", "shapes.py", "areas.py"):
        shutil.copy(source / name, tmp_path)
    environment = {
        **os.environ,
        "PATH": f"/usr/bin:{os.environ['PATH']}",
        "PYTHONPATH": str(repository / "clients" / "python"),
        "HOME": str(tmp_path),
    }

    def run(*more):
        return subprocess.run(
            ["/usr/bin/snakemake", "--cores", "1", "--nocolor",
             "--config", f"epsilons=[{','.join(EPSILONS)}]", *more],
            cwd=tmp_path, env=environment, capture_output=True, text=True,
        )  # fmt: skip

    return run


def test_it_makes_its_table_and_nothing_twice(snakemake, tmp_path):
    done = snakemake()
    assert done.returncode == 0, done.stderr
    rows = list(csv.DictReader((tmp_path / "results" / "areas.csv").open()))
    coarse, fine = (abs(float(row["error"])) for row in rows)
    assert fine < coarse < 0.1 and fine < 0.02
    assert coarse / fine > 2.5  # of second order: about 4
    assert "Nothing to be done" in snakemake().stderr

    (tmp_path / "results" / "torus-0.1.txt").unlink()
    again = snakemake()
    assert again.returncode == 0, again.stderr
    text = (tmp_path / "results" / "torus-0.2.log").read_text()
    assert "Traceback" not in text


def test_a_mesh_without_a_certificate_fails_the_workflow(snakemake, tmp_path):
    (tmp_path / "shapes.py").write_text(
        "import stellate\ntorus = stellate.manifolds.Torus(1, 0.9)\n"
    )
    done = snakemake("results/torus-0.2.txt")
    assert done.returncode != 0
    assert not (tmp_path / "results" / "torus-0.2.txt").exists()
