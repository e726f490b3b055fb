"""What all clients share: clients/shared of the source tree, carried with the stubs."""

from __future__ import annotations

import functools
import importlib.resources
import sys
from collections.abc import Mapping
from typing import Any

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


def text(name: str) -> str:
    """The contents of one of the files."""
    return importlib.resources.files(f"{__package__}._generated").joinpath(name).read_text("utf-8")


@functools.cache
def table(name: str) -> Mapping[str, Any]:
    """The values of one of the .toml files."""
    return tomllib.loads(text(name))
