"""The quickstart's program, as a user runs it."""

import subprocess
import sys

import meshio
import stellate
import topology


def test_quickstart(repository, tmp_path):
    program = repository / "clients" / "python" / "examples" / "quickstart.py"
    run = subprocess.run([sys.executable, program, tmp_path], capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr
    assert run.stdout.count("CERTIFIED") == 2 and "NOT CERTIFIED" not in run.stdout
    torus = stellate.load_txt(tmp_path / "torus.txt")
    topology.assert_closed_manifold(torus, 0, [1, 2, 1])
    so3 = stellate.load_txt(tmp_path / "so3.txt")
    assert (so3.dimension, so3.ambient_dimension) == (3, 9)
    topology.assert_closed_manifold(so3, 0)
    for name in ("torus.vtu", "torus.obj"):
        assert len(meshio.read(tmp_path / name).points) == len(torus.points)
    assert (tmp_path / "torus.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
