"""Formulas of the distance-function world, traced and meshed: a table, with what was refused.

tests/truth/arrangements/run formulas [NAME]...
"""

from __future__ import annotations

import sys
import time

import distance_formulas
import numpy as np
import stellate
from judge import components, euler, volumes
from stellate import solids as s

_THROWN = 400_000
_OFF = 1e-8


def main() -> int:
    chosen = sys.argv[1:]
    x = np.random.default_rng(4).random((_THROWN, 3)) * 2.6 - 1.3
    bad = 0
    print(
        "formula              walls  traced s  meshed s  vertices  certified  chi    volume  off f = 0"
    )
    with stellate.Server() as server:
        for f, _, epsilon, chi in distance_formulas.FORMULAS:
            if chosen and f.__name__ not in chosen:
                continue
            began = time.monotonic()
            solid = s.traced(f, distance_formulas.BOX)
            traced = time.monotonic() - began
            mesh = stellate.mesh(solid, epsilon, server=server)
            meshed = time.monotonic() - began - traced
            size = volumes(mesh.points[mesh.simplices]).sum() / ((f(x) < 0).mean() * 2.6**3)
            skin = np.unique(np.concatenate([face.simplices for face in mesh.boundary]))
            off = float(np.abs(f(mesh.points[skin])).max())
            have = euler(mesh.simplices)
            right = mesh.certified and off < _OFF and abs(size - 1) < 0.05
            right &= chi is None or (have, components(mesh.simplices)) == (chi, 1)
            bad += not right
            print(
                f"{f.__name__:20s} {len(solid.label_table()[0]):5d} {traced:9.1f} {meshed:9.1f} "
                f"{len(mesh.points):9d}  {'yes' if right else 'NO':9s} {have:4d} {size - 1:+9.1%} {off:10.1e}",
                flush=True,
            )
            if not mesh.certified:
                print("    " + mesh.report.certificate.verdict)
    for f, _ in distance_formulas.REFUSED:
        began = time.monotonic()
        try:
            s.traced(f, distance_formulas.BOX)
            bad += 1
            print(f"{f.__name__:20s} NOT REFUSED")
        except stellate.InvalidArgument as refusal:
            took = time.monotonic() - began
            print(f"{f.__name__:20s} refused in {1000 * took:.0f} ms: {refusal}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
