"""`python -m stellate doctor MODULE:OBJECT`: is an oracle what it should be?"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from typing import Any, Sequence

from ._doctor import check
from .errors import StellateError


def load(name: str) -> Any:
    """The object that "module:attribute.path" names; a class or a function is called for it."""
    module_name, colon, path = name.partition(":")
    if not colon or not path:
        raise ValueError(f"'{name}' has to be MODULE:OBJECT, such as shapes:torus")
    found: Any = importlib.import_module(module_name)
    for attribute in path.split("."):
        found = getattr(found, attribute)
    if not hasattr(found, "closest_point") or isinstance(found, type):
        found = found()
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m stellate", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    doctor = commands.add_parser("doctor", help="probe an oracle for its contract")
    doctor.add_argument("oracle", metavar="MODULE:OBJECT", help="an oracle, or what makes one")
    doctor.add_argument("-e", "--epsilon", type=float, help="that a mesh is planned with")
    doctor.add_argument("--seed", type=int, default=1, help="of the random questions")
    options = parser.parse_args(arguments)
    sys.path.insert(0, os.getcwd())
    try:
        oracle = load(options.oracle)
    except (ImportError, AttributeError, ValueError, TypeError, StellateError) as error:
        print(f"stellate: {error}", file=sys.stderr)
        return 2
    report = check(oracle, options.epsilon, seed=options.seed)
    print(report)
    return 0 if report.ok else 1


if __name__ == "__main__":
    sys.exit(main())
