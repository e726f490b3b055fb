"""Standing workers: serve every mesh on a server that bears their label.

    oracle-worker --manifold torus --server HOST:7717
    oracle-worker --oracle shapes:torus --server HOST:7717          an oracle of yours
    oracle-worker --make torus --epsilon 0.05 --server HOST:7717    declare one, and wait for it

Whoever declares a mesh labels it with the manifold's name, or with MODULE:OBJECT; every worker of
that label then joins it, whenever it comes. Workers hold no state: any number may run, start and
stop at any time.
"""

from __future__ import annotations

import argparse
import os
import signal
import socket
import sys
import threading
import time
from typing import Any, Callable

import stellate
from stellate import manifolds
from stellate._command_line import add_server, credentials_of
from stellate._oracle_source import Refused, load

MANIFOLDS: dict[str, Callable[[], Any]] = {
    "torus": manifolds.Torus,
    "sphere": manifolds.Sphere,
    "clifford": manifolds.ProductOfCircles,
    "so3": manifolds.SpecialOrthogonal3,
    "ellipsoid": manifolds.ellipsoid,
    "tanglecube": manifolds.tanglecube,
}
_LOOK_SECONDS = 1.0  # between two looks for meshes
_RESOLVE_SECONDS = 10.0  # between two looks for servers


def oracle_of(name: str) -> Any:
    """A manifold of the list, or the oracle that MODULE:OBJECT names. Raises: Refused."""
    return MANIFOLDS[name]() if name in MANIFOLDS else load(name)


class StandingWorker:
    """Joins each mesh of its label once, in a thread for each."""

    def __init__(self, client: stellate.Client, label: str, oracle: Any) -> None:
        self._client, self._label, self._oracle = client, label, oracle
        self._name = f"{label}@{socket.gethostname()}"
        self._serving: dict[str, threading.Thread] = {}

    def look(self) -> None:
        """Joins what is new. Raises: stellate.Unavailable while there is no server."""
        self._serving = {name: t for name, t in self._serving.items() if t.is_alive()}
        for mesh in self._client.list():
            if mesh.label != self._label or mesh.over or mesh.name in self._serving:
                continue
            thread = threading.Thread(target=self._serve, args=(mesh.name,), daemon=True)
            self._serving[mesh.name] = thread
            thread.start()

    def _serve(self, name: str) -> None:
        try:
            print(
                f"{name}: {self._client.serve(self._oracle, name, worker=self._name)}", flush=True
            )
        except stellate.StellateError as error:
            # It ended, or the server did; the next look tells which.
            print(f"{name}: {error}", flush=True)


def serve_on(address: str, label: str, oracle: Any, credentials: stellate.Credentials) -> None:
    """Meshes of one server, until the process is asked to stop."""
    with stellate.Client(address, credentials) as client:
        worker = StandingWorker(client, label, oracle)
        while True:
            try:
                worker.look()
            except stellate.Unavailable as error:
                print(f"{address}: {error}", flush=True)
            time.sleep(_LOOK_SECONDS)


def serve_on_all(server: str, label: str, oracle: Any, credentials: stellate.Credentials) -> None:
    """Meshes of every server behind a name, those that come later too."""
    host, port = server.rsplit(":", 1)
    known: set[str] = set()
    while True:
        try:
            found = socket.getaddrinfo(host, int(port), type=socket.SOCK_STREAM)
        except OSError as error:
            print(f"{host}: {error}", flush=True)
            found = []
        for family, _, _, _, place in found:
            ip = f"[{place[0]}]" if family == socket.AF_INET6 else str(place[0])
            address = f"{ip}:{place[1]}"
            if address not in known:
                known.add(address)
                arguments = (address, label, oracle, credentials)
                threading.Thread(target=serve_on, args=arguments, daemon=True).start()
        time.sleep(_RESOLVE_SECONDS)


def make(client: stellate.Client, label: str, oracle: Any, epsilon: float) -> int:
    """Declares a mesh for the standing workers and waits for its end."""
    info = client.create(oracle, epsilon, label=label)
    mesh = stellate.download(info.name, server=client, unfinished="wait")
    print(mesh.report)
    return 0 if mesh.certified else 1


def run(arguments: argparse.Namespace) -> int:
    """What the command line asks for."""
    label = arguments.make or arguments.manifold or arguments.oracle
    oracle, credentials = oracle_of(label), credentials_of(arguments)
    if arguments.make:
        with stellate.Client(arguments.server, credentials) as client:
            return make(client, label, oracle, arguments.epsilon)
    serve = serve_on_all if arguments.all_servers else serve_on
    serve(arguments.server, label, oracle, credentials)
    return 0


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--manifold", choices=sorted(MANIFOLDS), help="serve meshes of this label")
    what.add_argument(
        "--oracle", metavar="MODULE:OBJECT", help="serve meshes of this label with this oracle"
    )
    what.add_argument(
        "--make", metavar="LABEL", help="declare a mesh of this manifold or oracle, and wait for it"
    )
    parser.add_argument("--epsilon", type=float, default=0.1)
    add_server(parser, os.environ.get("STELLATE_SERVER", "stellated:7717"))
    parser.add_argument(
        "--all-servers", action="store_true", help="serve every address that the name stands for"
    )
    arguments = parser.parse_args()
    # As the first process of a container it would otherwise not hear of it.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    try:
        return run(arguments)
    except Refused as error:
        parser.error(str(error))


if __name__ == "__main__":
    sys.exit(main())
