"""The package from the source tree, and the meshes and checks of the client's own tests."""

import pathlib
import sys

import pytest

_ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(_ROOT / "clients" / "python"))
sys.path.insert(0, str(_ROOT / "tests" / "clients" / "python"))  # shapes, topology


@pytest.fixture(scope="session")
def repository() -> pathlib.Path:
    return _ROOT
