"""What is said where a library that the package stands on is missing."""

import pathlib
import re
import subprocess
import sys

import pytest
import stellate

PACKAGES = str(pathlib.Path(stellate.__file__).parents[1])
IMPORTS = """
import sys
missing, package = sys.argv[1].split(), sys.argv[2]

class Without:
    def find_spec(self, name, path, target=None):
        if name in missing:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Without())
sys.path.insert(0, package)
import stellate
"""


@pytest.mark.parametrize(
    "missing, words",
    [
        ("numpy", "needs numpy, .* apt-get install python3-numpy, .* pip install numpy"),
        ("grpc google.protobuf", "needs google.protobuf and grpc, .* install protobuf grpcio"),
    ],
)
def test_a_missing_library_is_named_with_what_to_install(missing, words):
    run = subprocess.run(
        [sys.executable, "-c", IMPORTS, missing, PACKAGES], capture_output=True, text=True
    )
    assert run.returncode == 1
    last = run.stderr.strip().splitlines()[-1]
    assert re.search(f"^ImportError: stellate {words}", last), last
