"""Strangers at a live server, while an honest client meshes: it must come to no harm.

    campaign.py [--rounds N | --seconds S] [--seed N] [--scale N]

Starts $STELLATED. A round is every attack once, in random order, from two threads at once. All the
while honest meshes are made by the command line ($STELLATE); each has to be the same, byte for byte,
as the one made before the first attack. The server has to live, to answer, to stop when it is told,
to hold no more memory in the end than early on, within --slack-mb, and never more than --peak-mb
above what it held before the first attack, and to keep its log in order: every line an object, of
which a flood makes few.
"""

from __future__ import annotations

import argparse
import collections
import json
import os
import pathlib
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "clients" / "python"))

import grpc  # noqa: E402
import stellate  # noqa: E402
from attacks import ATTACKS  # noqa: E402
from target import Target  # noqa: E402

_PATIENCE = 120.0  # seconds for anything that has to come to an end
_LOG_LINES_A_SECOND = 12  # ten, and how many there were besides
_LOG_BURST = 100
_WARM_ROUNDS = 2  # before memory is compared: arenas and buffers fill up


class Campaign:
    """One server and what is done to it."""

    def __init__(self, folder: pathlib.Path, arguments: argparse.Namespace) -> None:
        self._folder = folder
        self._arguments = arguments
        ready = folder / "ready"
        self._log = open(folder / "log", "wb")
        self._server = subprocess.Popen(
            [os.environ["STELLATED"], "--listen", "127.0.0.1:0", "--ready-file", str(ready)]
            + ["--keep-finished-seconds", "5"]  # what is kept on purpose is no growth
            + ["--log-format", "json"],
            stdout=subprocess.DEVNULL,
            stderr=self._log,
        )
        while not ready.exists():
            if self._server.poll() is not None:
                raise SystemExit(f"stellated ended with {self._server.returncode}")
            time.sleep(0.01)
        self._address = ready.read_text().strip()
        self._over = threading.Event()
        self._problems: list[str] = []
        self._honest = 0
        self._taken = 0
        self._codes: collections.Counter = collections.Counter()

    def run(self) -> int:
        """Returns the exit status."""
        reference = self._mesh("reference")
        idle = self._status_kb("VmRSS")
        honest = threading.Thread(target=self._mesh_on, args=(reference,))
        honest.start()
        memory: list[int] = []
        begin = time.monotonic()
        rounds = 0
        try:
            while not self._problems and self._goes_on(rounds, time.monotonic() - begin):
                self._round(rounds)
                rounds += 1
                memory.append(self._status_kb("VmRSS"))
        finally:
            self._over.set()
            honest.join()
        self._check_memory(memory, self._status_kb("VmHWM") - idle)
        self._stop()
        self._check_log(time.monotonic() - begin)
        print(
            f"{rounds} rounds of {len(ATTACKS)} attacks; calls taken: {self._taken}, refused: "
            f"{', '.join(f'{code} {n}' for code, n in self._codes.most_common())}"
        )
        print(f"{self._honest} honest meshes, each the same; {reference.count(10)} lines")
        print(f"resident memory after each round, MB: {_brief(memory)}")
        for problem in self._problems:
            print(f"PROBLEM: {problem}", file=sys.stderr)
        return 1 if self._problems else 0

    def _goes_on(self, rounds: int, seconds: float) -> bool:
        if self._arguments.seconds:
            return seconds < self._arguments.seconds
        return rounds < self._arguments.rounds

    def _round(self, number: int) -> None:
        order = random.Random(f"{self._arguments.seed}/{number}")
        attacks = list(ATTACKS)
        order.shuffle(attacks)
        halves = [
            threading.Thread(target=self._attack, args=(attacks[half::2], f"{number}/{half}"))
            for half in (0, 1)
        ]
        for thread in halves:
            thread.start()
        for thread in halves:
            thread.join()
        if self._server.poll() is not None:
            self._problems.append(
                f"the server ended with {self._server.returncode}; its last "
                f"words: {self._last_words()}"
            )

    def _attack(self, attacks: list, seed: str) -> None:
        host, port = self._address.rsplit(":", 1)
        options = [("grpc.max_send_message_length", -1), ("grpc.use_local_subchannel_pool", 1)]
        with grpc.insecure_channel(self._address, options) as channel:
            rng = random.Random(f"{self._arguments.seed}/{seed}")
            target = Target(host, int(port), channel, rng, self._arguments.scale)
            for attack in attacks:
                try:
                    attack(target)
                except Exception as error:  # whatever it is, the campaign has failed
                    self._problems.append(f"{attack.__name__}, seed {seed}: {error!r}")
            self._taken += target.taken
            self._codes += target.codes

    def _mesh(self, name: str) -> bytes:
        """A torus, meshed over the network by a program of its own."""
        path = self._folder / f"{name}.txt"
        command = [os.environ["STELLATE"], "mesh", "torus", "-e", "0.1", "--quiet"]
        command += ["--server", self._address, "-o", str(path)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=_PATIENCE)
        if done.returncode != 0:
            raise SystemError(f"an honest mesh failed: {done.stderr.strip()}")
        return path.read_bytes()

    def _mesh_on(self, reference: bytes) -> None:
        while not self._over.is_set() or self._honest == 0:
            try:
                if self._mesh("honest") != reference:
                    self._problems.append("an honest mesh came out differently")
                    return
            except (SystemError, OSError, subprocess.SubprocessError) as error:
                self._problems.append(str(error))
                return
            self._honest += 1

    def _status_kb(self, field: str) -> int:
        status = pathlib.Path(f"/proc/{self._server.pid}/status")
        for line in status.read_text().splitlines() if status.exists() else []:
            if line.startswith(field + ":"):
                return int(line.split()[1])
        return 0

    def _check_memory(self, memory: list[int], above: int) -> None:
        print(f"peak of memory above an idle server's: {above / 1024:.0f} MB")
        if above / 1024 > self._arguments.peak_mb:
            self._problems.append(f"the server held {above / 1024:.0f} MB more for a moment")
        slack = self._arguments.slack_mb
        warm = memory[_WARM_ROUNDS - 1 :]
        if len(warm) < 2:
            return
        growth = (warm[-1] - warm[0]) / 1024
        if growth > slack:
            self._problems.append(f"the server grew by {growth:.0f} MB: {_brief(memory)}")

    def _check_log(self, seconds: float) -> None:
        """What libraries say of strangers goes through the server's log, and is rationed."""
        self._log.flush()
        lines = (self._folder / "log").read_text(errors="replace").splitlines()
        of_libraries = 0
        for line in lines:
            try:
                of_libraries += json.loads(line)["message"].startswith("libraries: ")
            except (ValueError, KeyError, TypeError):
                self._problems.append(f"a line of the log that is no object: {line}")
                return
        print(f"log: {len(lines)} lines, {of_libraries} of them of libraries")
        if of_libraries > _LOG_BURST + _LOG_LINES_A_SECOND * (seconds + 2):
            self._problems.append(
                f"strangers made the server log {of_libraries} lines of libraries"
            )

    def _stop(self) -> None:
        if self._server.poll() is None:
            with stellate.Client(self._address) as client:
                left = [mesh.name for mesh in client.list() if not mesh.over]
                for name in left:
                    client.delete(name)
            self._server.send_signal(signal.SIGTERM)
        try:
            status = self._server.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            self._server.kill()
            self._server.wait()
            self._problems.append("the server does not stop when it is told")
            return
        if status != 0:
            self._problems.append(f"the server left with {status}: {self._last_words()}")

    def _last_words(self) -> str:
        self._log.flush()
        return (self._folder / "log").read_text(errors="replace")[-2000:]


def _brief(memory: list[int]) -> str:
    shown = memory if len(memory) <= 12 else memory[:: len(memory) // 12] + memory[-1:]
    return " ".join(f"{kb / 1024:.0f}" for kb in shown)


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=0, help="instead of a number of rounds")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scale", type=int, default=1, help="how much of each attack")
    parser.add_argument("--slack-mb", type=float, default=64)
    parser.add_argument("--peak-mb", type=float, default=250)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="stellate-hostile-") as folder:
        return Campaign(pathlib.Path(folder), arguments).run()


if __name__ == "__main__":
    sys.exit(main())
