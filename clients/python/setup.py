"""Writes the gRPC stubs before the package is packed, and takes the version of the source tree.

With $STELLATE_WHEEL_SERVER, a folder that packaging/wheel has filled, the wheel carries a server and
the command `stellate`, which on Debian is a package of its own.
All else is in pyproject.toml.
"""

from __future__ import annotations

import importlib.util
import os
import pathlib
import shutil
from typing import Any

from setuptools import Distribution, setup
from setuptools.command.build_py import build_py

_PACKAGE = pathlib.Path(__file__).resolve().parent / "stellate"
_SERVER = os.environ.get("STELLATE_WHEEL_SERVER")


def _generate_stubs() -> None:
    # By path: importing the package itself would want the stubs and the dependencies.
    spec = importlib.util.spec_from_file_location("stellate_stubs", _PACKAGE / "_stubs.py")
    assert spec is not None and spec.loader is not None
    stubs = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(stubs)
    stubs.ensure()


class _WithServer(build_py):
    def run(self) -> None:
        super().run()
        assert _SERVER is not None
        shutil.copytree(
            _SERVER, pathlib.Path(self.build_lib) / "stellate" / "_bundled", dirs_exist_ok=True
        )


class _OfOnePlatform(Distribution):
    def has_ext_modules(self) -> bool:
        return True


def _with_server() -> dict[str, Any]:
    """What makes a wheel of one platform, whose name packaging/wheel knows, for any Python."""
    from wheel.bdist_wheel import bdist_wheel

    class _Tagged(bdist_wheel):
        def get_tag(self) -> tuple[str, str, str]:
            return "py3", "none", os.environ["STELLATE_WHEEL_PLATFORM"]

    return {
        "cmdclass": {"build_py": _WithServer, "bdist_wheel": _Tagged},
        "distclass": _OfOnePlatform,
        "entry_points": {"console_scripts": ["stellate = stellate._script:main"]},
    }


_generate_stubs()
setup(
    version=(_PACKAGE / "_generated" / "VERSION").read_text().strip(),
    # Without a command it has to be said that there is none, as pyproject.toml leaves that to here.
    **(_with_server() if _SERVER else {"entry_points": {}}),
)
