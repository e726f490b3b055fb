"""Packs tests/conformance with the package, and takes the version of the source tree.

All else is in pyproject.toml.
"""

from __future__ import annotations

import pathlib
import shutil

from setuptools import setup
from setuptools.command.build_py import build_py

_ROOT = pathlib.Path(__file__).resolve().parents[2]
_FILES = _ROOT / "tests" / "conformance"
_VERSION = (_ROOT / "VERSION").read_text().strip()


class _WithFiles(build_py):
    def run(self) -> None:
        super().run()
        packed = pathlib.Path(self.build_lib) / "stellate_conform" / "conformance"
        for pattern in ("*.json", "streams/*", "meshes/*"):
            for file in _FILES.glob(pattern):
                copy = packed / file.relative_to(_FILES)
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(file, copy)


setup(
    version=_VERSION,
    install_requires=[f"stellate=={_VERSION}"],
    cmdclass={"build_py": _WithFiles},
)
