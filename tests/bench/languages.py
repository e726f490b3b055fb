"""Clients in other languages beside the Python client: the same torus, meshed in turn.

    tests/bench/run languages [LANGUAGE]... [--epsilon 0.02] [--rounds 9]

Each client is a process that stays, and connects once; all talk to one server. A round has every
client mesh the torus, Python before each of the others. The first round, with cold libraries and
compilers, is shown apart. The ratio is the median of those of the pairs. Processor time is the client's own,
the server's not counted: on a busy machine it says more than the time on the wall.
"""

from __future__ import annotations

import argparse
import os
import pathlib
import statistics
import subprocess
import sys
from collections.abc import Collection

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "clients" / "python"))

import stellate  # noqa: E402

PYTHON = """
import sys, time, stellate
from stellate.manifolds import Torus
with stellate.Client(sys.argv[1]) as client:
    for line in sys.stdin:
        begin = time.perf_counter()
        mesh = stellate.mesh(Torus(), float(line), client)
        print(time.perf_counter() - begin, len(mesh.points), len(mesh.simplices), flush=True)
"""

CLIENTS = ROOT / "clients"
COMMANDS = {
    "node": ["node", CLIENTS / "node/dist/examples/timing.js"],
    "go": [ROOT / "build/bench/timing-go"],
    "ruby": ["ruby", CLIENTS / "ruby/timing.rb"],
    "java": [
        "java",
        "-cp",
        f"{CLIENTS}/java/target/stellate.jar:{CLIENTS}/java/target/lib/*",
        "stellate.examples.Timing",
    ],
    "rust": [CLIENTS / "rust/target/release/examples/timing"],
}
BUILDS = {  # in the client's directory, in a shell
    "ruby": "./generate",
    "java": "mvn --quiet --batch-mode package -DskipTests",
    "rust": "cargo build --quiet --locked --release --examples",
    "node": "npm ci --ignore-scripts --silent && npm run --silent build",
    "go": 'eval "$(../../tests/languages/go_toolchain)" && go generate ./... && '
    "go build -o ../../build/bench/timing-go ./cmd/timing",
}


class Timed:
    """A process that meshes when it is told to."""

    def __init__(self, command: list[object], address: str, epsilon: float) -> None:
        self._epsilon = epsilon
        self._process = subprocess.Popen(
            [*map(str, command), address],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": str(ROOT / "clients" / "python")},
        )

    def mesh(self) -> tuple[float, tuple[int, int]]:
        """Seconds, and how many vertices and simplices there are."""
        self._process.stdin.write(f"{self._epsilon}\n")
        self._process.stdin.flush()
        words = self._process.stdout.readline().split()
        return float(words[0]), (int(words[1]), int(words[2]))

    def processor_seconds(self) -> float:
        """What the process has used since it began."""
        fields = (
            pathlib.Path(f"/proc/{self._process.pid}/stat").read_text().rpartition(")")[2].split()
        )
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def close(self) -> None:
        self._process.stdin.close()
        self._process.wait()


def parse(description: str | None, known: Collection[str]) -> argparse.Namespace:
    """The command line; without a language on it all that are known."""
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("languages", nargs="*", metavar="LANGUAGE", help=", ".join(known))
    parser.add_argument("--epsilon", type=float, default=0.02)
    parser.add_argument("--rounds", type=int, default=9)
    arguments = parser.parse_args()
    arguments.languages = arguments.languages or list(known)
    for name in arguments.languages:
        if name not in known:
            parser.error(f"no {name} here; there are {', '.join(known)}")
    return arguments


def main() -> int:
    arguments = parse(__doc__, COMMANDS)
    print_header()
    with stellate.Server() as server:
        python = Timed([sys.executable, "-B", "-c", PYTHON], server.address, arguments.epsilon)
        python.mesh()
        for name in arguments.languages:
            subprocess.run(BUILDS[name], shell=True, check=True, cwd=CLIENTS / name)
            other = Timed(COMMANDS[name], server.address, arguments.epsilon)
            compare(name, python, other, arguments.rounds)
        python.close()
    return 0


def print_header() -> None:
    wall = f"{'first, s':>10}{'median, s':>11}{'Python, s':>11}{'ratio':>8}   ratios from..to"
    print(f"{'':8}{wall:60}processor, s   Python's")


def compare(name: str, python: Timed, other: Timed, rounds: int) -> None:
    """Prints a line, and ends the other."""
    first = other.mesh()[0]
    theirs, ours = [], []
    before = other.processor_seconds(), python.processor_seconds()
    for _ in range(rounds):
        seconds, expected = python.mesh()
        ours.append(seconds)
        seconds, counts = other.mesh()
        theirs.append(seconds)
        if counts != expected:
            raise SystemExit(f"{name} has {counts} vertices and simplices, and Python {expected}")
    used = [
        (client.processor_seconds() - start) / rounds
        for client, start in zip((other, python), before)
    ]
    other.close()
    ratios = [a / b for a, b in zip(theirs, ours)]
    print(
        f"{name:8}{first:10.2f}{statistics.median(theirs):11.2f}{statistics.median(ours):11.2f}"
        f"{statistics.median(ratios):8.2f}   {f'{min(ratios):.2f}..{max(ratios):.2f}':17}"
        f"{used[0]:12.3f}{used[1]:11.3f}",
        flush=True,
    )


if __name__ == "__main__":
    sys.exit(main())
