"""A shell around a triangle's circle: not empty, and an edge flips; empty, and it does not."""

from __future__ import annotations

import _drawing as drawing
import matplotlib.pyplot as plt
import numpy as np
from scipy.spatial import Delaunay

TRIANGLE = np.array([[-0.95, -0.3], [0.6, -0.8], [0.25, 0.95]])
SHAKE = np.array([[0.03, -0.04], [-0.04, 0.04], [0.04, 0.04], [-0.06, -0.03]])
SHELL = 0.22


def circle(points: np.ndarray) -> tuple[np.ndarray, float]:
    centre = np.linalg.solve(
        2 * (points[1:] - points[0]), (points[1:] ** 2).sum(1) - (points[0] ** 2).sum()
    )
    return centre, float(np.linalg.norm(points[0] - centre))


def draw(axes: plt.Axes, fourth: tuple[float, float], title: str) -> bool:
    points = np.vstack([TRIANGLE, fourth])
    centre, radius = circle(TRIANGLE)
    axes.add_patch(plt.Circle(centre, radius + SHELL, color=drawing.SAND, alpha=0.45, linewidth=0))
    axes.add_patch(plt.Circle(centre, radius, facecolor="white", edgecolor=drawing.BLUE))
    before, after = Delaunay(points), Delaunay(points + SHAKE)
    axes.triplot(*points.T, before.simplices, color=drawing.INK, linewidth=1.4)
    axes.triplot(*(points + SHAKE).T, after.simplices, "--", color=drawing.RED, linewidth=0.9)
    axes.scatter(*points.T, s=22, color=drawing.INK, zorder=4)
    axes.scatter(*(points + SHAKE).T, s=16, color=drawing.RED, zorder=4)
    axes.scatter(*centre, s=14, color=drawing.BLUE, zorder=4)
    axes.annotate("c", centre, xytext=(4, 4), textcoords="offset points", color=drawing.BLUE)
    axes.set(xlim=(-1.45, 1.75), ylim=(-1.35, 1.4), aspect="equal", title=title)
    axes.axis("off")
    return {tuple(sorted(t)) for t in before.simplices} == {
        tuple(sorted(t)) for t in after.simplices
    }


figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 3.3), layout="constrained")
assert not draw(left, (1.0, 0.23), "in the shell: a small move flips the edge")
assert draw(right, (1.5, 0.45), "the shell is empty: the same move does not")
drawing.save(figure, "protection")
