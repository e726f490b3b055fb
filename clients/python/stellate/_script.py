"""The command `stellate` of a wheel that carries the program of this name."""

from __future__ import annotations

import os
import sys

from ._command_line import main as in_python
from .server import BUNDLED


def main() -> int:
    """The exit status, unless the program takes this process over."""
    # `conform` is written in Python: this one can import it, another on PATH may not.
    if sys.argv[1:2] == ["conform"]:
        return in_python()
    os.execv(BUNDLED.with_name("stellate"), ["stellate", *sys.argv[1:]])
