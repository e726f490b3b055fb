"""The package from the source tree, and servers on a database of their own."""

import pathlib
import sys

import pytest

_ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(_ROOT / "clients" / "python"))
sys.path.insert(0, str(_ROOT / "tests" / "clients" / "python"))  # lossy_proxy
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

import servers  # noqa: E402


@pytest.fixture
def cluster(tmp_path):
    with servers.Cluster(tmp_path) as one:
        yield one


@pytest.fixture(scope="session")
def undisturbed():
    return servers.make_undisturbed()
