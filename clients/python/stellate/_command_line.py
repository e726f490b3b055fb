"""python -m stellate: meshes the manifold of an oracle of yours, from the shell.

An oracle is named MODULE:OBJECT, such as shapes:torus for the object, the class or the function
`torus` of ./shapes.py; a class or a function is called for the oracle. Or it is a program in any
language: --oracle-command.

Exit status: 0 certified, or all is well; 1 not certified, or the doctor found errors; 2 usage or
refused; 3 the server or the oracle failed.
"""

from __future__ import annotations

import argparse
import concurrent.futures as futures
import contextlib
import multiprocessing
import os
import pathlib
import re
import sys
import traceback
from collections.abc import Sequence
from typing import Any

from . import _shared
from . import options as _options
from ._api import download, mesh
from ._command_oracle import CommandOracle
from ._complex import Complex
from ._credentials import Credentials
from ._download import Unfinished
from ._epsilon import what_epsilon_is
from ._oracle_source import Refused, add_oracle, name_of, oracle_of, scaled_oracle_of
from ._reconnect import WAITS
from ._saved import SavedMesh
from ._version import __version__
from .client import Client
from .errors import Interrupted, StellateError, exit_status
from .executors import workers_on
from .options import MeshOptions
from .progress import progress_bar
from .report import Progress

_STATUS = _shared.table("errors.toml")
_WELL, _NOT_CERTIFIED = _STATUS["exit_well"], _STATUS["exit_not_certified"]
_REFUSED, _FAILED = _STATUS["exit_refused"], _STATUS["exit_failed"]
_LABEL_BYTES = 128

# The flags of the program `stellate`, and those that only one's own oracle needs, with the options
# that they set. Two options have none: the oracle has seeds, and label is for `declare`.
_RUN = {
    "--seed": "random_seed",
    "--max-vertices": "max_vertices",
    "--max-rounds": "max_rounds",
    "--max-batch-queries": "max_batch_queries",
    "--box-seeds": "box_seeds",
    "--worker-wait": "worker_wait_seconds",
    "--answer": "answer_seconds",
    "--busy": "busy_seconds",
    "--components": "components",
    "--reach": "reach",
    "--boundary-only": "boundary_only",
    "--cover-box": "cover_box",
    "--audit": "audit",
}
_SERVING = {"--max-chunk": "max_chunk", "--workers": "workers"}
_CRITERIA = {
    "--radius-edge": "radius_edge_bound",
    "--sliver": "sliver_bound",
    "--shape": "shape",
    "--picking-radius": "picking_radius",
    "--small-sliver-radius": "small_sliver_radius",
    "--candidates": "candidates",
    "--advance-step": "advance_step",
    "--flat-alternations": "flat_alternations",
    "--speculative": "speculative",
    "--size-rate": "size_rate",
    "--max-deviation": "max_deviation",
    "--protection": "protection",
    "--common-centre": "common_centre",
}
FLAGS = {**_RUN, **_SERVING, **_CRITERIA}


def add_server(to: argparse.ArgumentParser, default: str | None) -> None:
    """--server and what goes with it."""
    to.add_argument(
        "--server",
        default=default,
        help="host:port or unix:/path; default: "
        + (default or "a private one, which is started and stopped"),
    )
    safety = to.add_argument_group("safety")
    safety.add_argument("--tls", action="store_true", help="trusting the system's authorities")
    safety.add_argument("--tls-ca", metavar="FILE", help="PEM: TLS, trusting these instead")
    safety.add_argument("--tls-cert", metavar="FILE", help="PEM: a client certificate")
    safety.add_argument("--tls-key", metavar="FILE", help="PEM: its key")
    safety.add_argument(
        "--token-file",
        metavar="FILE",
        help="that holds the token alone; default: $STELLATE_TOKEN, if set",
    )


def credentials_of(options: argparse.Namespace) -> Credentials | None:
    """What --tls and its kin say. Raises: Refused."""
    token = os.environ.get("STELLATE_TOKEN")
    if options.token_file is not None:
        words = pathlib.Path(options.token_file).read_text().split()
        if len(words) != 1:
            raise Refused(f"{options.token_file} must hold one token and nothing else")
        token = words[0]
    if options.server is None:
        return None
    return Credentials(token, options.tls_ca, options.tls_cert, options.tls_key, options.tls)


def _settings(options: argparse.Namespace) -> dict[str, Any]:
    given = {name: getattr(options, name, None) for name in FLAGS.values()}
    return {name: value for name, value in given.items() if value is not None}


def _connected(options: argparse.Namespace) -> Client:
    return Client(options.server, credentials_of(options), reconnect_seconds=options.reconnect)


def _bar(options: argparse.Namespace) -> Any:
    return _say_nothing if options.quiet else progress_bar()


def _say_nothing(progress: Progress) -> None:
    """An `on_progress`: with none at all, a mesh that takes long says so."""


def _deliver(finished: Complex | SavedMesh, options: argparse.Namespace) -> int:
    """What is printed of a mesh; the exit status that stands for it."""
    report = finished.report
    if options.report is not None and report is not None:
        pathlib.Path(options.report).write_text(report.to_json() + "\n")
    if options.json and report is not None:
        print(report.to_json())
    elif not options.quiet:
        print(report if report is not None else finished)
    return _WELL if finished.certified else _NOT_CERTIFIED


def _insist_on_epsilon(options: argparse.Namespace) -> None:
    """argparse would say only that it is required. Raises: Refused."""
    if options.epsilon is None:
        raise Refused(f"--epsilon is required: {what_epsilon_is('--epsilon auto')}")


def _mesh(options: argparse.Namespace) -> int:
    finished: Complex | SavedMesh
    _insist_on_epsilon(options)
    oracle, settings = oracle_of(options), _settings(options)
    if isinstance(oracle, CommandOracle):
        settings["workers"] = max(settings.get("workers", 1), oracle.processes)
    label = _short(f"stellate {name_of(options)}")
    try:
        with contextlib.ExitStack() as stack:
            finished = made = mesh(
                oracle, options.epsilon,
                None if options.server is None else stack.enter_context(_connected(options)),
                _bar(options), to=options.output, label=label, checkpoint=options.checkpoint,
                keep_on_server=options.keep, scale=options.scale, **settings,
            )  # fmt: skip
        if options.keep:
            print(f"stellate: it stays on {options.server} as {made.name}", file=sys.stderr)
    except Interrupted as stopped:
        if stopped.mesh is None:
            raise
        print(f"stellate: {stopped}", file=sys.stderr)
        for path in options.output:
            stopped.mesh.save(path)
        finished = stopped.mesh
    return _deliver(finished, options)


def _short(label: str) -> str:
    return label.encode()[:_LABEL_BYTES].decode(errors="ignore")


def _declare(options: argparse.Namespace) -> int:
    _insist_on_epsilon(options)
    oracle, settings = scaled_oracle_of(options), _settings(options)
    label = options.label or _short(name_of(options))
    with _connected(options) as client:
        print(client.create(oracle, options.epsilon, label=label, **settings).name)
    return _WELL


def _serve(options: argparse.Namespace) -> int:
    oracle = scaled_oracle_of(options)
    more = {"worker": options.worker, "max_chunk": options.max_chunk}
    with _connected(options) as client:
        if isinstance(oracle, CommandOracle):
            # As many workers as there are processes to ask, each over a stream of its own.
            count = oracle.processes
            with futures.ThreadPoolExecutor(count) as threads:
                ends = [
                    threads.submit(client.serve, oracle, options.mesh, **more) for _ in range(count)
                ]
            state = max(end.result() for end in ends)
        elif options.processes is None:
            state = client.serve(oracle, options.mesh, **more)
        else:
            count = options.processes
            spawn = multiprocessing.get_context("spawn")  # gRPC's threads do not outlive a fork
            with (
                futures.ProcessPoolExecutor(count, spawn) as pool,
                workers_on(pool, oracle, options.mesh, count, server=client, **more) as workers,
            ):
                state = max(workers.wait())
    print(state)
    return _FAILED if state == "FAILED" else _WELL


def _download(options: argparse.Namespace) -> int:
    unfinished: Unfinished
    unfinished = "wait" if options.wait else "take" if options.unfinished else "refuse"
    with _connected(options) as client:
        finished = download(
            options.mesh, to=options.output, server=client, unfinished=unfinished,
            revision=options.revision, on_progress=_bar(options),
        )  # fmt: skip
    return _deliver(finished, options)


def _doctor(options: argparse.Namespace) -> int:
    oracle = scaled_oracle_of(options)
    with _connected(options) as client:
        report = client.check(oracle, options.epsilon, seed=options.seed)
    print(report)
    return _WELL if report.ok else _NOT_CERTIFIED


def _epsilon(text: str) -> float | str:
    try:
        return text if text == "auto" else float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"has to be a length or auto, and is '{text}'") from None


def _revision(text: str) -> int:
    number = int(text) if text.isascii() and text.isdigit() else 0
    if number < 1:
        raise argparse.ArgumentTypeError(f"has to be a whole number from 1 on, and is '{text}'")
    return number


def _add_settings(command: argparse.ArgumentParser, serves: bool) -> None:
    command.add_argument(
        "-e", "--epsilon", type=_epsilon,
        help="largest circumradius of a simplex, a length; or auto: a quarter of the reach that "
        "the doctor finds",
    )  # fmt: skip
    criteria = command.add_argument_group("criteria", "absent: the server's defaults")
    kinds, words = _options.types(MeshOptions), _options.meanings(MeshOptions)
    run = {**_RUN, **_SERVING} if serves else _RUN
    for to, flags in ((command, run), (criteria, _CRITERIA)):
        for flag, name in flags.items():
            kind, help = _options.plain_type(kinds[name]), words[name].replace("%", "%%")
            choices = _options.choices(kinds[name])
            if kind is bool:
                both = argparse.BooleanOptionalAction
                to.add_argument(flag, dest=name, action=both, help=help)
            elif choices:
                to.add_argument(flag, dest=name, choices=choices, help=help)
            else:
                to.add_argument(flag, dest=name, type=kind, metavar="N", help=help)


def _add_results(command: argparse.ArgumentParser, required: bool) -> None:
    command.add_argument(
        "-o", "--output", action="append", default=None if required else [], required=required,
        metavar="FILE", help="to write the mesh to, .txt .vtu .stl .msh ...; may be given again",
    )  # fmt: skip
    command.add_argument("--report", metavar="FILE", help="for the report as JSON")
    command.add_argument("--json", action="store_true", help="print the report as JSON")
    command.add_argument("-q", "--quiet", action="store_true", help="no progress, no report")


def _add_connection(command: argparse.ArgumentParser, default: str | None) -> None:
    add_server(command, default)
    command.add_argument(
        "--reconnect", type=float, default=WAITS["give_up"], metavar="SECONDS",
        help=f"that a server which went away is waited for; default: {WAITS['give_up']:g}",
    )  # fmt: skip


def _parser(by_command: bool) -> argparse.ArgumentParser:
    about, *more = __doc__.split("\n\n", 1)
    parser = argparse.ArgumentParser(
        "python -m stellate", description=about, epilog="\n".join(more),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument("--version", action="version", version=f"stellate {__version__}")
    commands = parser.add_subparsers(dest="command", required=True)

    def add(name: str, run: Any, words: str) -> argparse.ArgumentParser:
        command = commands.add_parser(name, help=words, description=words)
        command.set_defaults(run=run)
        return command

    one = add("mesh", _mesh, "mesh the manifold of an oracle")
    add_oracle(one)
    _add_settings(one, serves=True)
    one.add_argument(
        "--checkpoint", metavar="FOLDER",
        help="in which the mesh outlives this program: the same command goes on with it",
    )  # fmt: skip
    one.add_argument(
        "--keep", action="store_true",
        help="the finished mesh stays on --server, for `download` and viewers; its name is said",
    )  # fmt: skip
    _add_results(one, required=False)
    _add_connection(one, None)

    one = add("declare", _declare, "declare a mesh, for others to serve, and print its name")
    add_oracle(one)
    _add_settings(one, serves=False)
    one.add_argument("--label", help="that lists show; default: MODULE:OBJECT")
    _add_connection(one, "127.0.0.1:7717")

    one = add(
        "serve", _serve, "answer a mesh's questions until it is over, together with other workers"
    )
    add_oracle(one, named=not by_command)
    one.add_argument("mesh", help="its whole name: meshes/ and 32 digits")
    one.add_argument("--processes", type=int, metavar="N", help="of this machine, that answer")
    one.add_argument("--worker", default="", help="what the server's log calls this one")
    one.add_argument("--max-chunk", type=int, metavar="N", help="most points in one call")
    _add_connection(one, "127.0.0.1:7717")

    one = add("download", _download, "fetch a mesh that is on a server")
    one.add_argument("mesh", help="its whole name: meshes/ and 32 digits")
    _add_results(one, required=True)
    how = one.add_mutually_exclusive_group()
    how.add_argument("--wait", action="store_true", help="for the end of a mesh that is not over")
    how.add_argument("--unfinished", action="store_true", help="as it is, over or failed or not")
    how.add_argument(
        "--revision", type=_revision, metavar="N",
        help="which of those that the mesh has had, counted from 1; default: the newest",
    )  # fmt: skip
    _add_connection(one, "127.0.0.1:7717")

    one = add("doctor", _doctor, "probe an oracle for its contract")
    add_oracle(one)
    one.add_argument("-e", "--epsilon", type=float, help="that a mesh is planned with")
    one.add_argument("--seed", type=int, default=1, help="of the random queries")
    _add_connection(one, None)
    return parser


def _in_flags(message: str) -> str:
    """A message with the flags in place of the options' names. Words of English name options only where
    a message begins with them."""
    flags = {name: flag for flag, name in FLAGS.items()} | {"declared_reach": "--reach"}

    def flag_of(match: re.Match[str]) -> str:
        group, name = match.groups()
        named = group or "_" in name or match.start() == 0
        return flags.get(name, match[0]) if named else match[0]

    return re.sub(r"\b(criteria\.|limits\.)?([a-z_]+)\b", flag_of, message)


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; its exit status."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    by_command = any(word.partition("=")[0] == "--oracle-command" for word in given)
    options = _parser(by_command).parse_args(given)
    try:
        return options.run(options)
    except KeyboardInterrupt as stopped:
        print(f"stellate: {stopped or 'stopped'}", file=sys.stderr)
        return _NOT_CERTIFIED
    except Refused as error:
        print(f"stellate: {error}", file=sys.stderr)
        return _REFUSED
    except StellateError as error:
        print(f"stellate: {error.reason}: {_in_flags(str(error))}", file=sys.stderr)
        return exit_status(error)
    except OSError as error:
        print(f"stellate: {error}", file=sys.stderr)
        return _REFUSED
    except Exception:
        traceback.print_exc()  # of the oracle: where it went wrong is what its author needs
        return _FAILED
