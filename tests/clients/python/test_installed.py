"""The package where it is installed, and not beside its source."""

import os
import pathlib
import shutil
import subprocess
import sys

import pytest
import stellate

IMPORT = """
import sys
import google.protobuf, grpc, meshio, numpy  # which may run what they like
started = []
sys.addaudithook(lambda event, about: event == "subprocess.Popen" and started.append(about))
import stellate
stellate.manifolds.Torus()
assert not started, started
print(stellate.__file__, stellate.__version__)
"""


def contents(folder):
    return {str(path): path.stat().st_mtime_ns for path in folder.rglob("*")}


@pytest.mark.parametrize("place", ["python3/dist-packages", "clients/python"])
def test_it_neither_runs_protoc_nor_writes(tmp_path, place):
    """Where a folder `proto/stellate` lies where a source tree has one, too: somebody else's."""
    installed = tmp_path / place / "stellate"
    shutil.copytree(
        pathlib.Path(stellate.__file__).parent,
        installed,
        ignore=shutil.ignore_patterns("__pycache__", ".generated-*", ".lock"),
    )
    proto = tmp_path / "proto" / "stellate" / "v1" / "other.proto"
    proto.parent.mkdir(parents=True)
    proto.write_text("syntax = 'proto3'; // of another program\n")
    before = contents(tmp_path)
    run = subprocess.run(
        [sys.executable, "-B", "-c", IMPORT],
        cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(tmp_path / place)},
        capture_output=True, text=True,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    assert run.stdout.split() == [str(installed / "__init__.py"), stellate.__version__]
    assert contents(tmp_path) == before
