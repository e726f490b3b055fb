"""What the certificate looks at: normal flats that meet the mesh once, and balls that show the reach."""

from __future__ import annotations

import _curve as curve
import _drawing as drawing
import matplotlib.pyplot as plt
import numpy as np


def crossings(
    loops: list[np.ndarray], x: np.ndarray, normal: np.ndarray, half: float
) -> np.ndarray:
    """Where the normal segment at x meets closed polygons."""
    found = []
    for points in loops:
        for a, b in zip(points, np.roll(points, -1, axis=0)):
            matrix = np.stack([normal, a - b], axis=1)
            if abs(np.linalg.det(matrix)) > 1e-12:
                s, t = np.linalg.solve(matrix, a - x)
                if abs(s) <= half and 0 <= t < 1:
                    found.append(x + s * normal)
    return np.array(found).reshape(-1, 2)


figure, both = plt.subplots(1, 2, figsize=(9.5, 3.2), layout="constrained")
fine = curve.at(np.linspace(0, 2 * np.pi, 27)[:-1])
away = fine[np.abs(fine[:, 0]) > 0.3]
pieces = [away[away[:, 0] > 0], away[away[:, 0] < 0]]
pieces[0] = pieces[0][np.argsort(np.arctan2(pieces[0][:, 1], pieces[0][:, 0] - 0.8))]
for axes, loops, title in (
    (both[0], [fine], "each normal flat meets the mesh once"),
    (both[1], pieces, "closed as well, and refused: some flats meet nothing"),
):
    curve.draw(axes)
    for points in loops:
        axes.plot(*np.vstack([points, points[:1]]).T, color=drawing.BLUE, linewidth=1.5)
        axes.scatter(*points.T, s=14, color=drawing.INK, zorder=3)
    probes = curve.at(np.linspace(0.13, 2 * np.pi + 0.13, 25)[:-1])
    half = 0.18
    for x, tangent in zip(probes, curve.tangents(probes)):
        normal = np.array([-tangent[1], tangent[0]])
        hits = crossings(loops, x, normal, half)
        colour = drawing.GREEN if len(hits) == 1 else drawing.RED
        axes.plot(*np.stack([x - half * normal, x + half * normal]).T, color=colour, linewidth=1.2)
        axes.scatter(*hits.T, s=9, color=colour, zorder=4)
    axes.set_title(title, y=-0.06)
    axes.set(xlim=(-1.75, 1.75), ylim=(-0.8, 0.8))
drawing.save(figure, "certificate")
