"""The package from the source tree, and the fake server of its tests."""

import pathlib
import sys

_ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(_ROOT / "clients" / "python"))
sys.path.insert(0, str(_ROOT / "clients" / "conform"))
sys.path.insert(0, str(_ROOT / "tests" / "clients" / "python"))
