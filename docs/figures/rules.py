"""What the four rules are against."""

from __future__ import annotations

import _curve as curve
import _drawing as drawing
import matplotlib.pyplot as plt
import numpy as np

figure = plt.figure(figsize=(10, 2.7))
frames = [figure.add_axes((place / 4 + 0.01, 0.12, 0.23, 0.8)) for place in range(3)]


def circumcircle(corners: np.ndarray) -> tuple[np.ndarray, float]:
    edges = corners[1:] - corners[0]
    centre = np.linalg.solve(2 * edges, (edges**2).sum(axis=1))
    return corners[0] + centre, float(np.linalg.norm(centre))


def triangle(axes: plt.Axes, corners: list[tuple[float, float]], title: str) -> None:
    points = np.array(corners)
    centre, radius = circumcircle(points)
    shortest = min(np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1))
    axes.add_patch(plt.Circle(centre, radius, fill=False, color=drawing.RED, linewidth=1))
    axes.fill(*points.T, facecolor="#d5e3e9", edgecolor=drawing.BLUE, linewidth=1.5)
    axes.scatter(*points.T, s=14, color=drawing.INK, zorder=3)
    axes.scatter(*centre, s=14, color=drawing.RED, zorder=3)
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set(xlim=(-1.3, 1.3), ylim=(-1.15, 1.15))
    axes.set_title(title.format(ratio=radius / shortest), y=-0.14)


turn = 2 * np.pi / 360
triangle(frames[0], [(np.cos(a * turn), np.sin(a * turn)) for a in (80, 205, 330)],
         "R1: circumradius above epsilon")  # fmt: skip
triangle(frames[1], [(np.cos(a * turn), np.sin(a * turn)) for a in (100, 85, 290)],
         "R2: R / shortest edge = {ratio:.1f} > 2")  # fmt: skip

# A sliver: four points near a great circle, no edge short.
axes = figure.add_axes((0.5, 0.02, 0.24, 1.0), projection="3d")
frames[2].remove()
corners = np.array([[1, 0, 0.1], [0, 1, -0.1], [-1, 0, 0.1], [0, -1, -0.1]])
for i in range(4):
    for j in range(i):
        axes.plot(*corners[[i, j]].T, color=drawing.BLUE, linewidth=1.5)
axes.scatter(*corners.T, s=14, color=drawing.INK)
volume = abs(np.linalg.det(corners[1:] - corners[0])) / 6
longest = max(np.linalg.norm(a - b) for a in corners for b in corners)
axes.set(xlim=(-0.8, 0.8), ylim=(-0.8, 0.8), zlim=(-0.8, 0.8))
axes.view_init(18, -70)
axes.set_axis_off()
axes.set_title(f"R3: a sliver, volume / edge³ = {volume / longest**3:.2f}", y=-0.02)

# Two stars that disagree: an edge of p's that is not q's.
axes = figure.add_axes((0.755, 0.12, 0.24, 0.8))
points = curve.at(np.array([0.03, 1.53, 3.04, 4.09, 4.95, 5.48]))
stars = curve.stars(points)
curve.draw(axes, width=1.5)
for p, star in enumerate(stars):
    for q in star:
        agreed = p in stars[q]
        axes.plot(*points[[p, q]].T, color=drawing.BLUE if agreed else drawing.RED,
                  linewidth=1.5, linestyle="-" if agreed else "--")  # fmt: skip
axes.scatter(*points.T, s=14, color=drawing.INK, zorder=3)
axes.set_title("R4: edges (dashed) of one star alone", y=-0.14)
axes.set(ylim=(-1.15, 1.15))
drawing.save(figure, "rules")
disagree = sum(p not in stars[q] for p, star in enumerate(stars) for q in star)
assert disagree, "the figure shows what it says"
