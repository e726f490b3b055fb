"""Fixtures: the package from the source tree, and one real stellated for a whole file."""

import pathlib
import sys

import numpy as np
import pytest

_ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path.insert(0, str(_ROOT / "clients" / "python"))
sys.path.insert(0, str(_ROOT / "tests" / "clients" / "python"))  # shapes, topology, fake_server
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

import stellate  # noqa: E402


@pytest.fixture(scope="session")
def repository() -> pathlib.Path:
    return _ROOT


@pytest.fixture(scope="module")
def server():
    with stellate.Server() as running:
        yield running


@pytest.fixture
def client(server):
    with stellate.Client(server) as connected:
        yield connected


@pytest.fixture
def rng():
    return np.random.default_rng(20250)
