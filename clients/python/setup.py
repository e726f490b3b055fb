"""Writes the gRPC stubs before the package is packed; all else is in pyproject.toml."""

import importlib.util
import pathlib

from setuptools import setup


def _generate_stubs() -> None:
    # By path: importing the package itself would want the stubs and the dependencies.
    path = pathlib.Path(__file__).resolve().parent / "stellate" / "_stubs.py"
    spec = importlib.util.spec_from_file_location("stellate_stubs", path)
    assert spec is not None and spec.loader is not None
    stubs = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(stubs)
    stubs.ensure()


_generate_stubs()
setup()
