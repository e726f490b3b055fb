"""A large mesh from Python over a long path: how the time divides.

    delay.py --proxy PROGRAM [--rtt-ms 50] [--vertices 100000] [--speculative]

PROGRAM is called as `PROGRAM LISTEN_PORT HOST:PORT ONE_WAY_MS`, and has to carry connections on with
that delay each way. The sphere is meshed twice, next to the server and over the long path; what the
second takes more is the path's. Latency is what the round trips alone cost; transfer is the rest.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import pathlib
import socket
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "clients" / "python"))

import stellate  # noqa: E402
from numpy_client import Timed  # noqa: E402

_DENSITY = 0.65 * 4 * 3.141592653589793  # vertices of the unit sphere are about this / epsilon^2


@dataclasses.dataclass
class Run:
    """One mesh and what it took."""

    seconds: float
    oracle: float
    server: float  # processor time
    client: float  # processor time, the oracle's included
    rounds: int
    queries: int
    vertices: int
    certified: bool


def processor_seconds(pid: int) -> float:
    """User and system time of a process so far."""
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(") ", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def run(address: str, pid: int, epsilon: float, speculative: bool) -> Run:
    """Meshes the sphere on a server."""
    oracle = Timed(stellate.manifolds.Sphere())
    before = processor_seconds(pid)
    client_before = time.process_time()
    begin = time.perf_counter()
    mesh = stellate.mesh(oracle, epsilon, server=address, speculative=speculative)
    seconds = time.perf_counter() - begin
    counts = mesh.report.counts
    return Run(
        seconds,
        oracle.seconds,
        processor_seconds(pid) - before,
        time.process_time() - client_before,
        counts.rounds,
        counts.queries,
        len(mesh.points),
        mesh.certified,
    )


def free_port() -> int:
    """A port that was free a moment ago."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--proxy", default=os.environ.get("DELAY_PROXY", "delay-proxy"))
    parser.add_argument("--rtt-ms", type=float, default=50)
    parser.add_argument("--vertices", type=float, default=100_000)
    parser.add_argument("--speculative", action="store_true")
    arguments = parser.parse_args()
    epsilon = (_DENSITY / arguments.vertices) ** 0.5
    rtt = arguments.rtt_ms / 1000
    with tempfile.TemporaryDirectory() as folder:
        ready = pathlib.Path(folder) / "ready"
        server = subprocess.Popen(
            [os.environ["STELLATED"], "--listen", "127.0.0.1:0", "--ready-file", str(ready)]
            + ["--log-level", "warning"],
            stdout=subprocess.DEVNULL,
        )
        while not ready.exists():
            time.sleep(0.01)
        address = ready.read_text().strip()
        port = free_port()
        proxy = subprocess.Popen(
            [arguments.proxy, str(port), address, str(arguments.rtt_ms / 2)],
            stdout=subprocess.DEVNULL,
        )
        try:
            near = run(address, server.pid, epsilon, arguments.speculative)
            far = run(f"127.0.0.1:{port}", server.pid, epsilon, arguments.speculative)
        finally:
            proxy.terminate()
            server.terminate()
            proxy.wait()
            server.wait()
    same = (near.vertices, near.rounds, near.queries) == (far.vertices, far.rounds, far.queries)
    latency = far.rounds * rtt
    print(
        f"sphere, epsilon {epsilon:.5f}: {far.vertices} vertices, {far.rounds} rounds, "
        f"{far.queries} queries, speculative: {'yes' if arguments.speculative else 'no'}, "
        f"certified: {far.certified}, same counts near and far: {same}"
    )
    for where, one in (
        ("next to the server", near),
        (f"round trip {arguments.rtt_ms:.0f} ms", far),
    ):
        print(
            f"  {where:<18} {one.seconds:6.2f} s; processor time: server {one.server:.2f} s, "
            f"client {one.client:.2f} s, of which oracle {one.oracle:.2f} s"
        )
    print(f"  latency            {latency:6.2f} s, a round trip for each round")
    print(f"  transfer           {far.seconds - near.seconds - latency:6.2f} s, what the path adds")
    print(f"  computing          {near.seconds:6.2f} s, as next to the server")
    return 0 if same and far.certified else 1


if __name__ == "__main__":
    sys.exit(main())
