"""A new sample point: the flat through a circumcentre, met with the manifold."""

from __future__ import annotations

import _curve as curve
import _drawing as drawing
import matplotlib.pyplot as plt
import numpy as np

points = curve.at(np.array([0.15, 0.85, 1.9, 2.9, 4.2, 5.3]))
p, tangent = 1, curve.tangents(points)[1]
star = curve.stars(points)[p]
q, centre = max(star.items(), key=lambda entry: np.linalg.norm(entry[1] - points[p]))
new = curve.on_flat(centre, tangent)
normal = np.array([-tangent[1], tangent[0]])

figure, axes = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
curve.draw(axes)
axes.plot(*np.stack([points[p] - 1.3 * tangent, points[p] + 1.3 * tangent]).T, "--", linewidth=0.8,
          color=drawing.INK)  # fmt: skip
axes.plot(
    *np.stack([centre - 0.8 * normal, centre + 0.55 * normal]).T, color=drawing.RED, linewidth=1.5
)
axes.plot(*points[[p, q]].T, color=drawing.BLUE, linewidth=1.8)
axes.scatter(*points.T, s=18, color=drawing.INK, zorder=4)
axes.scatter(*centre, s=22, color=drawing.RED, zorder=5)
axes.scatter(*new, s=60, marker="*", color=drawing.GREEN, zorder=6)
curve.note(axes, points[p], "p", (0.05, 0.2))
curve.note(axes, points[q], "q", (-0.05, 0.2))
curve.note(axes, centre, "c: in p's tangent line,\nas far from p as from q", (0.95, 0.6))
curve.note(axes, centre - 0.6 * normal, "the flat: straight above\nand below c", (-0.85, 0.05))
curve.note(axes, new, "where it meets M:\nthe new sample point", (0.75, -0.4))
axes.set(xlim=(-1.7, 1.9), ylim=(-0.75, 1.3))
drawing.save(figure, "flat")
