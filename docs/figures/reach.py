"""The medial axis of a curve, and its reach: the smallest ball that touches twice, or osculates."""

from __future__ import annotations

import _curve as curve
import _drawing as drawing
import matplotlib.pyplot as plt
import numpy as np
from scipy.spatial import Voronoi

sample = curve.CURVE[::10]
vertices = Voronoi(sample).vertices
distance = np.linalg.norm(vertices[:, None, :] - sample, axis=2)
order = np.argsort(distance, axis=1)
radius = np.take_along_axis(distance, order[:, :1], axis=1)[:, 0]
# A Voronoi vertex of a dense sample is near the medial axis where the points that it is nearest to are
# far from each other; the others are noise of the sampling.
spread = np.linalg.norm(sample[order[:, 0]] - sample[order[:, 2]], axis=1)
medial = spread > 0.25 * radius
medial &= np.abs(vertices).max(axis=1) < 2.2
reach = radius[medial].min()
first, second = (
    np.gradient(curve.CURVE, axis=0),
    np.gradient(np.gradient(curve.CURVE, axis=0), axis=0),
)
turn = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
bend = (np.linalg.norm(first, axis=1) ** 3 / turn)[3:-3].min()
assert reach < bend, "a curve that bends more sharply has a smaller reach than its neck says"
touch = vertices[medial][radius[medial].argmin()]

figure, axes = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
curve.draw(axes, drawing.BLUE)
axes.scatter(*vertices[medial].T, s=3, color=drawing.SAND, zorder=0)
for centre, size in ((touch, reach), (np.array([0.9, 0.0]), None)):
    size = size or np.linalg.norm(sample - centre, axis=1).min()
    axes.add_patch(plt.Circle(centre, size, fill=False, color=drawing.RED, linewidth=1.2))
    axes.scatter(*centre, s=14, color=drawing.RED, zorder=3)
curve.note(axes, touch, f"reach {reach:.2f}:\nthe smallest of these balls", (-0.15, -0.95))
curve.note(
    axes,
    np.array([0.9, 0.0]),
    "where there is more room,\nthe local feature size is larger",
    (0.35, 0.98),
)
curve.note(axes, np.array([-0.55, 0.0]), "medial axis: more than\none nearest point", (-0.5, 0.98))
axes.set(xlim=(-1.7, 1.9), ylim=(-1.15, 1.2))
drawing.save(figure, "reach")
print(f"reach {reach:.3f}, smallest radius of curvature {bend:.3f}")
