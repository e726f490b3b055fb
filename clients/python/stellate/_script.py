"""The command `stellate` of a wheel that carries the program of this name."""

from __future__ import annotations

import os
import sys

from .server import BUNDLED


def main() -> None:
    """Hands this process over to the program."""
    os.execv(BUNDLED.with_name("stellate"), ["stellate", *sys.argv[1:]])
