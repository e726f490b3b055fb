"""Nastran bulk data: points, and rods, triangles or tetrahedra."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .._complex import Complex, in_space
from ..errors import SaveError
from .groups import groups

# meshio's writer refuses some numbers, as -0.1735534956, which take more than 16 columns as it puts them.
_CARDS = {1: "CROD", 2: "CTRIA3", 3: "CTETRA"}
_WIDTH = 16  # of a number, in a card with wide fields
_MOST = 10**8 - 1  # a field of eight columns


def contents(mesh: Complex, cells: np.ndarray) -> bytes:
    """The file of a mesh with these oriented cells, 1 <= k <= 3; regions are its properties."""
    if max(len(mesh.points), len(cells)) > _MOST:
        raise SaveError("Nastran numbers points and elements by eight digits: save it as .vtu")
    return "".join(_cards(mesh, cells)).encode()


def _cards(mesh: Complex, cells: np.ndarray) -> Iterator[str]:
    yield "BEGIN BULK\n"
    for number, (x, y, z) in enumerate(in_space(mesh.points).tolist(), 1):
        yield (f"GRID*   {number:>16}{'':16}{real(x):>16}{real(y):>16}*\n*       {real(z):>16}\n")
    card, number = _CARDS[mesh.dimension], 0
    for group in groups(mesh, cells):
        if group.dimension < mesh.dimension:
            continue
        for row in (group.simplices.astype(np.int64) + 1).tolist():
            number += 1
            yield f"{card:8}{number:8}{group.tag:8}" + "".join(f"{i:8}" for i in row) + "\n"
    yield "ENDDATA\n"


def real(value: float) -> str:
    """With a point, as Nastran has it, and as many digits as fit."""
    text = repr(value)
    if len(text) <= _WIDTH and "e" not in text:
        return text
    for digits in range(15, 0, -1):
        mantissa, exponent = f"{value:.{digits}E}".split("E")
        text = f"{mantissa}E{int(exponent):+d}"
        if len(text) <= _WIDTH:
            break
    return text
