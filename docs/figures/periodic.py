"""What repeats: two periods a side of a gyroid solid, in a cubic and in a hexagonal cell."""

from __future__ import annotations

from functools import partial

import _drawing as drawing
import matplotlib.pyplot as plt
import numpy as np
import stellate
from stellate import oracles

CUBIC = oracles.PeriodicCell(2 * np.pi * np.eye(3))
HEXAGONAL = oracles.PeriodicCell([[6, 0, 0], [-3, 6 * np.sqrt(0.75), 0], [0, 0, 7]])


def gyroid(cell: oracles.PeriodicCell, x: np.ndarray) -> np.ndarray:
    u = 2 * np.pi * cell.fractional(x)
    s, c = np.sin(u), np.cos(u)
    return s[:, 0] * c[:, 1] + s[:, 1] * c[:, 2] + s[:, 2] * c[:, 0]


def draw(axes: plt.Axes, cell: oracles.PeriodicCell, epsilon: float, size: float) -> None:
    """The skin of the walls in blue, and the jagged border of the periods in red."""
    mesh = stellate.mesh(cell.solid(partial(gyroid, cell)), epsilon)
    assert mesh.certified
    plain = mesh.unwrap(cell).plain(2)
    facets = np.concatenate([np.delete(plain.simplices, i, axis=1) for i in range(4)])
    behind = plain.simplices.T.reshape(-1)  # the corner that each leaves out
    skin, first, counts = np.unique(facets, axis=0, return_index=True, return_counts=True)
    skin, behind = skin[counts == 1], behind[first[counts == 1]]
    corners = plain.points[skin]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inwards = (normals * (plain.points[behind] - corners[:, 0])).sum(axis=1) > 0
    skin[inwards] = skin[inwards][:, ::-1]  # to face outwards
    walls = {tuple(row) for row in plain.boundary[0].simplices.tolist()}
    border = np.array([tuple(sorted(row)) not in walls for row in skin.tolist()])
    middle = (plain.points.min(axis=0) + plain.points.max(axis=0)) / 2
    drawing.shaded(axes, plain.points - middle, skin, elevation=25, azimuth=-60, marked=border,
                   size=size * np.abs(plain.points - middle).max(), lines=0.15)  # fmt: skip


figure, axes = plt.subplots(1, 2, figsize=(8, 4), subplot_kw={"projection": "3d"})
draw(axes[0], CUBIC, 0.45, 1.35)
draw(axes[1], HEXAGONAL, 0.3, 1.0)
figure.subplots_adjust(left=0, right=1, bottom=0, top=1, wspace=0)
drawing.save(figure, "periodic")
