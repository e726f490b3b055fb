"""A stellated behind a proxy that loses every second reply.

Prints the proxy's address; ends with its input.
"""

import pathlib
import sys

_ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(_ROOT / "clients" / "python"), str(_ROOT / "tests" / "clients" / "python")]

import stellate  # noqa: E402
from lossy_proxy import LossyProxy  # noqa: E402

with stellate.Server(listen="127.0.0.1:0") as server, LossyProxy(server.address, 2) as way:
    print(way.address, flush=True)
    sys.stdin.read()
