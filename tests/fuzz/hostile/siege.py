"""Strangers of one kind against a live server, while honest calls are timed.

    siege.py KIND [--connections N] [--seconds S] [--mbit R] [--token] [-- FLAG...]

Starts $STELLATED, with FLAGs. N strangers, from processes of their own, do what KIND says for S
seconds, each at R megabits a second (0: as fast as it goes), and come again when they are hung up
on; with --token the server asks for tokens, which the strangers have not. Says how long honest
calls took and how many failed, and the server's memory before, at most and after.
"""

from __future__ import annotations

import argparse
import collections
import multiprocessing
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "clients" / "python"))

import grpc  # noqa: E402
from stellate._generated import stellate_pb2, stellate_pb2_grpc  # noqa: E402
from strangers import STRANGERS  # noqa: E402

_TOKEN = "honest-0123456789abcdef"
_PATIENCE = 60.0  # seconds for an honest call
_PAUSE = 0.05  # between two of them
_PROCESSES = 2  # of strangers
_LARGE = 3 << 20  # bytes of the largest honest request
_SETTLE = 12.0  # seconds after the strangers have gone, for memory to be given back


class Honest:
    """Calls on one connection, on new ones, and large ones, one after the other."""

    def __init__(self, address: str, token: bool) -> None:
        self._address = address
        self._metadata = (("authorization", f"Bearer {_TOKEN}"),) if token else ()
        self._over = threading.Event()
        self.times: dict[str, list[float]] = {"calls": [], "new connections": [], "large": []}
        self.failures: collections.Counter = collections.Counter()
        self._threads = [threading.Thread(target=self._call, args=(kind,)) for kind in self.times]

    def start(self) -> None:
        """Begins; stop() ends it."""
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """Waits for the last calls."""
        self._over.set()
        for thread in self._threads:
            thread.join()

    def _call(self, kind: str) -> None:
        channel = self._channel()
        while not self._over.wait(_PAUSE):
            begin = time.monotonic()
            if kind == "new connections":
                channel.close()
                channel = self._channel()
            # A name is short; one of three megabytes is refused, once it was read.
            request = stellate_pb2.GetMeshRequest(name="x" * (_LARGE if kind == "large" else 1))
            try:
                stellate_pb2_grpc.StellateStub(channel).GetMesh(
                    request, timeout=_PATIENCE, metadata=self._metadata
                )
            except grpc.RpcError as error:
                if error.code() != grpc.StatusCode.INVALID_ARGUMENT:
                    self.failures[f"{kind}: {error.code().name} {error.details()}"] += 1
                    continue
            self.times[kind].append(time.monotonic() - begin)
        channel.close()

    def _channel(self) -> grpc.Channel:
        return grpc.insecure_channel(self._address, [("grpc.use_local_subchannel_pool", 1)])


def _besiege(kind: str, host: str, port: int, count: int, end: float, mbit: float) -> None:
    threads = [
        threading.Thread(target=STRANGERS[kind], args=(host, port, end, mbit), daemon=True)
        for _ in range(count)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    os._exit(0)  # whatever is open is hung up


def _memory_mb(process: subprocess.Popen, field: str) -> float:
    for line in pathlib.Path(f"/proc/{process.pid}/status").read_text().splitlines():
        if line.startswith(field + ":"):
            return int(line.split()[1]) / 1024
    raise SystemExit(f"stellated ended with {process.poll()}")


def _percentile(times: list[float], share: float) -> float:
    return sorted(times)[min(len(times) - 1, int(share * len(times)))]


def siege(folder: pathlib.Path, arguments: argparse.Namespace) -> int:
    """Returns the exit status: whether a call failed."""
    ready, tokens = folder / "ready", folder / "tokens"
    command = [os.environ["STELLATED"], "--listen", "127.0.0.1:0", "--ready-file", str(ready)]
    command += ["--log-level", "error", *arguments.flags]
    if arguments.token:
        tokens.write_text(f"honest {_TOKEN}\n")
        tokens.chmod(0o600)
        command += ["--token-file", str(tokens)]
    server = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    while not ready.exists():
        if server.poll() is not None:
            raise SystemExit(f"stellated ended with {server.returncode}")
        time.sleep(0.01)
    address = ready.read_text().strip()
    host, port = address.rsplit(":", 1)
    honest = Honest(address, arguments.token)
    honest.start()
    time.sleep(2.0)
    before = _memory_mb(server, "VmRSS")
    end = time.time() + arguments.seconds
    share = max(1, arguments.connections // _PROCESSES)
    strangers = [
        multiprocessing.Process(
            target=_besiege, args=(arguments.kind, host, int(port), share, end, arguments.mbit)
        )
        for _ in range(min(_PROCESSES, arguments.connections))
    ]
    for stranger in strangers:
        stranger.start()
    for stranger in strangers:
        stranger.join()
    peak = _memory_mb(server, "VmHWM")
    time.sleep(_SETTLE)
    honest.stop()
    after = _memory_mb(server, "VmRSS")
    server.send_signal(signal.SIGTERM)
    server.wait(_PATIENCE)
    print(
        f"{arguments.kind}, {arguments.connections} strangers, {arguments.seconds:.0f} s: memory "
        f"before, at most, after: {before:.0f}, {peak:.0f}, {after:.0f} MB"
    )
    for kind, times in honest.times.items():
        if times:
            print(
                f"  {kind}: {len(times)}, median {_percentile(times, 0.5):.3f} s, "
                f"p99 {_percentile(times, 0.99):.3f} s, worst {max(times):.3f} s"
            )
    for failure, count in honest.failures.most_common():
        print(f"  FAILED {count} times: {failure}")
    return 1 if honest.failures else 0


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("kind", choices=sorted(STRANGERS))
    parser.add_argument("--connections", type=int, default=8)
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--mbit", type=float, default=0)
    parser.add_argument("--token", action="store_true")
    parser.add_argument("flags", nargs="*", help="of stellated, after --")
    with tempfile.TemporaryDirectory(prefix="stellate-siege-") as folder:
        return siege(pathlib.Path(folder), parser.parse_args())


if __name__ == "__main__":
    multiprocessing.set_start_method("spawn")
    sys.exit(main())
