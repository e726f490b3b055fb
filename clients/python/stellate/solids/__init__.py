"""Solids composed of others, by `&`, `|`, `-`, `^` and `~`: balls, boxes, functions, formulas.

    from stellate import solids as s

    part = (s.Box([-1] * 3, [1] * 3) & s.Ball(1.3)) - s.Cylinder(0.5, axis="x")
    mesh = stellate.mesh(part, epsilon=0.2)

    phases = s.Phases(f1, f2, f3) & s.Ball(1)  # three materials, where each is the largest

Each is an object that `stellate.mesh` takes. Their edges and corners are in the mesh exactly.
"""

from ._materials import Labels
from ._phases import Phases
from ._primitives import (
    Ball,
    Box,
    Capsule,
    Cone,
    Cylinder,
    HalfSpace,
    Implicit,
    Torus,
    blend,
)
from ._solid import Solid, rotation
from ._traced import traced

__all__ = [
    "Ball",
    "Box",
    "Capsule",
    "Cone",
    "Cylinder",
    "HalfSpace",
    "Implicit",
    "Labels",
    "Phases",
    "Solid",
    "Torus",
    "blend",
    "rotation",
    "traced",
]
