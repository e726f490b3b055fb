"""Oracles through the pipe beside the Python client: the same torus, meshed in turn.

    tests/bench/run pipe [LANGUAGE]... [--epsilon 0.02] [--rounds 9]

Both processes stay, and so does the oracle's; all talk to one server. A round meshes with Python and
then through the pipe. The first round is shown apart. The ratio is the median of those of the pairs.
Both oracles give closest points and tangents and intersect no flats.
"""

from __future__ import annotations

import pathlib
import subprocess
import sys

import languages
import stellate

ROOT = pathlib.Path(__file__).resolve().parents[2]
ORACLES = ROOT / "clients" / "pipe"
BUILT = ROOT / "build" / "bench"
TIMING = ROOT / "build" / "release" / "bin" / "pipe_timing"

PYTHON = """
import sys, time, numpy as np, stellate
from stellate.manifolds import Torus
class AsThroughAPipe:
    dimension, ambient_dimension = 2, 3
    bounding_box = np.array([-1.5, -1.5, -0.5]), np.array([1.5, 1.5, 0.5])
    torus = Torus()
    closest_point, tangent_basis = torus.closest_point, torus.tangent_basis
with stellate.Client(sys.argv[1]) as client:
    for line in sys.stdin:
        begin = time.perf_counter()
        mesh = stellate.mesh(AsThroughAPipe(), float(line), client)
        print(time.perf_counter() - begin, len(mesh.points), len(mesh.simplices), flush=True)
"""

COMMANDS = {
    "octave": f"octave-cli -q {ORACLES}/torus.m",
    "r": f"Rscript {ORACLES}/torus.R",
    "fortran": f"{BUILT}/torus-fortran",
    "rust": f"{BUILT}/torus-rust",
    "perl": f"perl {ORACLES}/torus.pl",
    "awk": f"mawk -W interactive -f {ORACLES}/torus.awk",
}
BUILDS = {
    "fortran": f"gfortran -O2 {ORACLES}/torus.f90 -o {BUILT}/torus-fortran",
    "rust": f"rustc -O --edition 2021 {ORACLES}/torus.rs -o {BUILT}/torus-rust",
}


def main() -> int:
    arguments = languages.parse(__doc__, COMMANDS)
    BUILT.mkdir(parents=True, exist_ok=True)
    languages.print_header()
    with stellate.Server() as server:
        python = languages.Timed(
            [sys.executable, "-B", "-c", PYTHON], server.address, arguments.epsilon
        )
        python.mesh()
        for name in arguments.languages:
            subprocess.run(BUILDS.get(name, "true"), shell=True, check=True)
            other = languages.Timed([TIMING, COMMANDS[name]], server.address, arguments.epsilon)
            languages.compare(name, python, other, arguments.rounds)
        python.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
