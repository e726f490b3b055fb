"""What mypy says of a user's script, as of one that uses the installed package."""

import os
import pathlib
import re
import subprocess
import sys

import pytest
import stellate

pytest.importorskip("mypy", reason="tools/check installs it")

RIGHT = """
import stellate

settings: stellate.MeshOptions = {"max_vertices": 1000, "audit": "thorough"}
mesh = stellate.mesh(stellate.manifolds.Torus(), 0.2, candidates=3, workers=2, keep="box")
if not mesh.report.certified:
    print(mesh.report.certificate.verdict, mesh.slice(0).report is None)
for grown in stellate.watch(stellate.manifolds.Torus(), "auto", **settings):
    print(grown.revision)
    if isinstance(grown, stellate.FinishedMesh):
        print(grown.report.termination)
with stellate.Client("there:7717") as client:
    print(client.create(stellate.manifolds.Torus(), 0.2, reach=0.4, cover_box=True).name)
    waited = stellate.download("meshes/x", "torus.vtu", server=client, unfinished="wait")
    print(waited.report.epsilon)
print(stellate.mesh(stellate.manifolds.Torus(), 0.2, to="a.vtu", reach=0.4).cells[0])
stellate.ImplicitManifold(
    print, "jax", ambient_dimension=3, dimension=2, bounding_box=([-1.0] * 3, [1.0] * 3)
)
"""

# What is wrong, and what is said of it.
WRONG = {
    "stellate.mesh(torus, 0.2, max_vertexes=9)": 'No overload variant of "mesh"',
    "stellate.mesh(torus, 0.2, to='a.vtu').simplex_tree()": '"SavedMesh" has no attribute',
    "client.create(torus, 0.2, max_vertexes=9)": 'Unexpected keyword argument "max_vertexes"',
    "client.create(torus, 0.2, max_vertices='9')": 'Argument "max_vertices" .* "str"',
    "client.create(torus, 0.2, audit='through')": "'through'.*'standard', 'thorough'",
    "stellate.watch(torus, 'atuo')": "'atuo'.*'auto'",
    "stellate.watch(torus, 0.2, keep='seed')": "'seed'.*'box', 'seeds'",
    "stellate.watch(torus, 0.2, candidate=9)": 'Unexpected keyword argument "candidate"',
    "client.create(torus, 0.2, workers=2)": 'Unexpected keyword argument "workers"',
    "stellate.download('x', server=client, unfinished='no')": 'No overload variant of "download"',
    "stellate.download('x', server=client, unfinished='take').report.epsilon": '"None" of .* has no attribute "epsilon"',
    "stellate.load_txt('torus.txt').report.epsilon": '"None" of .* has no attribute "epsilon"',
    "stellate.ImplicitSolid(print, 'jaxx', bounding_box=[[0], [1]])": "'jaxx'.*'autograd'",
}
SETTING = (
    "import stellate\ntorus, client = stellate.manifolds.Torus(), stellate.Client('there:1')\n"
)


def test_mypy_strict_lets_a_right_script_pass_and_names_what_is_wrong(tmp_path):
    (tmp_path / "right.py").write_text(RIGHT)
    (tmp_path / "wrong.py").write_text(SETTING + "\n".join(WRONG) + "\n")
    packages = str(pathlib.Path(stellate.__file__).parents[1])
    # Of packages that are installed mypy does not report what is wrong inside. Unpack: for mypy 1.0.
    run = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", "--no-error-summary",
         "--ignore-missing-imports", "--disable-error-code=import", "--enable-incomplete-feature=Unpack", "--hide-error-context",
         "right.py", "wrong.py"],
        cwd=tmp_path, env={**os.environ, "MYPYPATH": packages}, capture_output=True, text=True,
    )  # fmt: skip
    assert not run.stderr
    said = re.findall(r"^(\w+)\.py:(\d+): error: (.*)$", run.stdout, re.M)
    first = SETTING.count("\n") + 1
    assert [(name, int(line) - first) for name, line, _ in said] == [
        ("wrong", i) for i in range(len(WRONG))
    ], run.stdout
    for (_, _, words), (code, wanted) in zip(said, WRONG.items()):
        assert re.search(wanted, words), f"{code}: {words}"
