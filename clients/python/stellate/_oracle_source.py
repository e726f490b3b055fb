"""Whose manifold a command line is about: an object's of a module, or a program's."""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from typing import Any

from ._command_oracle import CommandOracle
from ._pipe.greeting import parse_box, parse_points
from .errors import StellateError
from .oracles import in_units

_OF_COMMANDS = ("oracle_processes", "dimension", "ambient_dimension", "box", "seeds",
                "oracle_start", "oracle_silence")  # fmt: skip


class Refused(Exception):
    """Something on the command line makes no sense."""


def load(name: str) -> Any:
    """The oracle that "module:attribute.path" names, the current folder's modules included.

    A class or a function is called for it. Raises: Refused.
    """
    module_name, colon, path = name.partition(":")
    if not colon or not path:
        raise Refused(f"'{name}' has to be MODULE:OBJECT, such as shapes:torus")
    if module_name.endswith(".py"):
        named = module_name[:-3].replace(os.sep, ".")
        raise Refused(f"'{name}' names a file: a module goes without .py, as {named}:{path}")
    if os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())
    try:
        found: Any = importlib.import_module(module_name)
        for attribute in path.split("."):
            found = getattr(found, attribute)
        if not hasattr(found, "closest_point") or isinstance(found, type):
            found = found()
    except (ImportError, AttributeError, ValueError, TypeError, StellateError) as error:
        raise Refused(f"{name}: {error}") from error
    return found


def add_oracle(to: argparse.ArgumentParser, named: bool | None = None) -> None:
    """MODULE:OBJECT, or --oracle-command and what goes with it.

    Which of the two, `named` says where other arguments without a flag follow, since argparse would
    take one for the other.
    """
    if named is not False:
        how: dict[str, Any] = {} if named else {"nargs": "?"}
        to.add_argument(
            "oracle", metavar="MODULE:OBJECT", **how,
            help="an oracle, or what makes one; or, instead of it, a command",
        )  # fmt: skip
    to.set_defaults(oracle=None)
    to.add_argument(
        "--scale", metavar="S1,S2,...", type=_scale,
        help="where axes have different units: how far the manifold goes along each; --epsilon and all "
        "other lengths are then of coordinates divided by these, points and places are not",
    )  # fmt: skip
    group = to.add_argument_group(
        "oracle command", "a program in any language that answers batches of queries"
    )
    group.add_argument(
        "--oracle-command", metavar="COMMAND", help='for the shell, e.g. "octave-cli -q torus.m"'
    )
    group.add_argument(
        "--oracle-processes", type=int, metavar="N",
        help="that answer, each a chunk at a time; default: 1",
    )  # fmt: skip
    group.add_argument(
        "-k", "--dimension", type=int, help="of the manifold, unless the command says it"
    )
    group.add_argument(
        "-d", "--ambient-dimension", type=int, help="of space, unless the command says it"
    )
    group.add_argument(
        "--box", metavar="LOWER:UPPER",
        help="where the manifold is: two corners, as --box=-1,-1,-1:1,1,1",
    )  # fmt: skip
    group.add_argument(
        "--seeds", metavar="X,Y,...", action="append",
        help="or points near it, one at least on each component, as --seeds=1,0,0",
    )  # fmt: skip
    group.add_argument(
        "--oracle-start", type=float, metavar="SECONDS",
        help="that the command has for its first line; default: 60",
    )  # fmt: skip
    group.add_argument(
        "--oracle-silence", type=float, metavar="SECONDS",
        help="that it may neither read nor write while it answers a batch; default: 600",
    )  # fmt: skip


def _scale(text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"has to be lengths, one for each axis, as .01,500,1, and is '{text}'"
        ) from None


def scaled_oracle_of(options: argparse.Namespace) -> Any:
    """The oracle in the coordinates that --scale says. Raises: Refused; StellateError."""
    oracle = oracle_of(options)
    return oracle if options.scale is None else in_units(oracle, options.scale)


def name_of(options: argparse.Namespace) -> str:
    """For labels and messages."""
    return str(options.oracle or options.oracle_command)


def oracle_of(options: argparse.Namespace) -> Any:
    """The oracle, its processes started. Raises: Refused; StellateError."""
    if options.oracle_command is None:
        without = [name for name in _OF_COMMANDS if getattr(options, name) is not None]
        if without:
            flag = without[0].replace("_", "-")
            raise Refused(f"--{flag} goes with --oracle-command")
        if options.oracle is None:
            raise Refused("name an oracle, MODULE:OBJECT, or give --oracle-command")
        return load(options.oracle)
    if options.oracle is not None:
        raise Refused(f"either {options.oracle} or --oracle-command")
    given = {
        "processes": options.oracle_processes,
        "start_seconds": options.oracle_start,
        "silence_seconds": options.oracle_silence,
    }
    return CommandOracle(
        options.oracle_command,
        dimension=options.dimension,
        ambient_dimension=options.ambient_dimension,
        bounding_box=None if options.box is None else parse_box(options.box),
        seeds=None if options.seeds is None else parse_points(";".join(options.seeds)),
        on_waiting=(lambda what: None) if getattr(options, "quiet", False) else None,
        **{name: value for name, value in given.items() if value is not None},
    )
