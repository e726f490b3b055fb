"""The package from the source tree, for tests that need no server but for stellate.check."""

import pathlib
import sys

import numpy as np
import pytest

_ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path.insert(0, str(_ROOT / "clients" / "python"))
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))


@pytest.fixture(scope="session")
def repository() -> pathlib.Path:
    return _ROOT


@pytest.fixture
def rng():
    return np.random.default_rng(20250)
