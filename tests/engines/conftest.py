"""The package and this folder, for the tests and for the processes that engines start."""

import os
import pathlib
import sys

HERE = pathlib.Path(__file__).resolve().parent
_FOLDERS = [str(HERE), str(HERE.parents[1] / "clients" / "python")]
sys.path[:0] = _FOLDERS
os.environ["PYTHONPATH"] = os.pathsep.join([*_FOLDERS, os.environ.get("PYTHONPATH", "")])
