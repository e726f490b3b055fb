"""The command `stellate-conform`: see HELP."""

from __future__ import annotations

import argparse
import pathlib
import sys
import tempfile
from collections.abc import Iterator, Sequence
from typing import Any

from . import troubles
from .creator import creator_scenarios
from .driver import Person, Program, Speechless
from .proxy import Proxy
from .recorder import Recorder
from .results import FAIL, PASS, UNTRIED, Result, Results
from .scenario import Scenario, run
from .server import Service, start
from .uploader import point_scenarios
from .watcher import file_scenarios, watcher_scenarios

_ROLES = ("worker", "watcher", "creator", "points", "files")
_GONE_SECONDS = 1.0

HELP = """\
Drives a client in any language through the rules of the protocol: a server that meshes nothing.

COMMAND is run once, with the server's address behind its arguments. It obeys the lines of its
standard input, one after the other, each with one line of its standard output:

  serve MESH MANIFOLD    serves the mesh until it is over: "over STATE"
  watch MESH PATH K D    watches the mesh, of dimension K in R^D, to its end and saves it to PATH, also if
                         it was cancelled: "mesh REVISION TERMINATION LEVEL". Of a manifold with
                         boundary also PATH.walls: of each vertex a line, its walls as bits. PATH
                         ends in .txt, or in .obj: oriented as the server says
  create LABEL           declares the torus with that label and epsilon 0.5: "created MESH";
  create LABEL seeds     with a seed in place of the box; LABEL token=TOKEN: with that token
  create LABEL walls     declares the lune
  reconstruct PATH K D   reads the numbers of PATH, a point a line, and has them reconstructed, as a
                         manifold of dimension K in R^D: the mesh's "mesh - TERMINATION LEVEL". The
                         kit looks at what is sent, and then cancels the mesh
  save MESH PATH         reads the .txt file MESH, and saves it to PATH: "saved"

or with "error CLASS REASON WORDS" where that came of it, or with "unsupported". "-" stands for what the
client does not tell. CLASS is one of clients/shared/errors.toml, in any case and with or without
underscores, or whose fault it is: request, oracle, server, file. Without COMMAND the lines are printed,
for somebody who starts the client by hand and types what came of it.

MANIFOLD is one of
  torus          of radii 1 and 0.4 in R^3, with tangent bases, as have all here
  clifford       the product of two unit circles in R^4
  circle:D       the unit circle of the first two coordinates of R^D
  so3            rotations, as 3 x 3 matrices, row after row
  sphere         the unit sphere of R^3, with intersections with lines, and sizes 1 + z / 2
  lune           the quarter of the unit sphere between two walls, z >= 0 and y >= 0, in this order. From
                 where all the points of a face are equally far, none is found
  half           the torus, whose closest point is not found from where x < 0
  raises         the torus, whose closest point fails with the words "on purpose"
  slow           the torus, which takes two seconds over every batch
"""


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="stellate-conform",
        usage="%(prog)s [ROLE ...] [OPTION ...] -- COMMAND [ARGUMENT ...]",
        description=HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "roles", nargs="*", metavar="ROLE", default=[],
        help=f"of {', '.join(_ROLES)}; default: all",
    )  # fmt: skip
    parser.add_argument("--listen", default="127.0.0.1:0", metavar="HOST:PORT",
                        help="where the server is; default: a free port of the loopback")  # fmt: skip
    parser.add_argument("--only", default="", metavar="TEXT",
                        help="try what has a rule with this in its name")  # fmt: skip
    parser.add_argument(
        "--record", metavar="FILE", help="write all that comes and goes: session.proto"
    )
    parser.add_argument("--json", action="store_true", help="print the verdicts as JSON")
    parser.add_argument("-q", "--quiet", action="store_true", help="print failures alone")
    parser.add_argument("--patience", type=float, default=60.0, metavar="SECONDS",
                        help="for one line to be obeyed; default: 60")  # fmt: skip
    return parser


def _scenarios(
    roles: list[str], folder: pathlib.Path, proxy: Proxy, *arguments: Any
) -> Iterator[Scenario]:
    if "creator" in roles:
        yield from creator_scenarios(*arguments)
    if "watcher" in roles:
        yield from watcher_scenarios(folder, *arguments)
    if "points" in roles:
        yield from point_scenarios(folder, *arguments)
    if "files" in roles:
        yield from file_scenarios(folder, *arguments)
    if "worker" in roles:
        for kind in troubles.SCENARIOS:
            scenario = kind(*arguments)
            if isinstance(scenario, troubles.Gone):
                scenario.lose = proxy.cut_for(_GONE_SECONDS)
            elif isinstance(scenario, troubles.Frozen):
                scenario.lose = proxy.freeze
            yield scenario


def main(arguments: Sequence[str] | None = None) -> int:
    """The exit status: 0, 1 where a rule is broken or none was tried, 2 where nothing could be."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    at = given.index("--") if "--" in given else len(given)
    options = _parser().parse_args(given[:at])
    try:
        return _run(options, given[at + 1 :])
    except KeyboardInterrupt:
        print("stellate-conform: stopped", file=sys.stderr)
        return 1
    except (OSError, ValueError) as error:
        print(f"stellate-conform: {error}", file=sys.stderr)
        return 2


def _run(options: argparse.Namespace, command: list[str]) -> int:
    strange = [role for role in options.roles if role not in _ROLES]
    if strange:
        raise ValueError(f"'{strange[0]}' has to be one of {', '.join(_ROLES)}")
    if not command and not sys.stdin.isatty():
        raise ValueError("no COMMAND is given, and nobody is at a terminal to take its place")
    results = Results(lambda result: _print(result, options))
    recorder = Recorder(options.record)
    service = Service(recorder)
    server, port = start(service)
    try:
        proxy = Proxy(options.listen, port)
        try:
            _drive(options, command, proxy, service, results)
        finally:
            proxy.close()
    finally:
        server.stop(None)
        recorder.close()
    if options.json:
        print(results.to_json())
    else:
        print(f"{results.count(PASS)} passed, {results.count(FAIL)} failed, "
              f"{results.count(UNTRIED)} untried")  # fmt: skip
    return 1 if results.count(FAIL) or not results.count(PASS) else 0


def _drive(
    options: argparse.Namespace,
    command: list[str],
    proxy: Proxy,
    service: Service,
    results: Results,
) -> None:
    print(f"server {proxy.address}", file=sys.stderr)
    client: Program | Person
    client = Program(command, proxy.address) if command else Person(proxy.address)
    try:
        with tempfile.TemporaryDirectory(prefix="stellate-conform-") as folder:
            roles = options.roles or list(_ROLES)
            why = ""
            for scenario in _scenarios(
                roles, pathlib.Path(folder), proxy, results, options.patience
            ):
                if not any(options.only in f"{scenario.name}.{rule}" for rule in scenario.rules):
                    continue
                service.scenario = scenario
                if why:
                    scenario.end(FAIL, why)
                    continue
                try:
                    run(scenario, client.tell)
                except Speechless:
                    why = "the client answers no more"
            service.scenario = None
    finally:
        client.close()


def _print(result: Result, options: argparse.Namespace) -> None:
    if not options.json and not (options.quiet and result.verdict == PASS):
        print(result, flush=True)
