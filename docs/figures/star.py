"""The star of a sample point: on a curve, and on a torus in the tangent plane of the point."""

from __future__ import annotations

import _curve as curve
import _drawing as drawing
import matplotlib.pyplot as plt
import numpy as np
import stellate
from scipy.spatial import HalfspaceIntersection
from stellate.manifolds import Torus

figure, (left, right) = plt.subplots(
    1, 2, figsize=(9, 3.1), width_ratios=(1.35, 1), layout="constrained"
)

# A curve: the tangent line at p, cut where another sample point is as near as p.
points = curve.at(np.linspace(0.3, 2 * np.pi + 0.3, 15)[:-1])
p = 1
star = curve.stars(points)[p]
tangent = curve.tangents(points)[p]
curve.draw(left)
left.scatter(*points.T, s=16, color=drawing.INK, zorder=4)
left.plot(*np.stack([points[p] - 0.9 * tangent, points[p] + 0.9 * tangent]).T, "--", linewidth=0.8,
          color=drawing.INK)  # fmt: skip
left.plot(*np.stack(list(star.values())).T, color=drawing.RED, linewidth=3, zorder=3)
for q, centre in star.items():
    left.plot(*points[[p, q]].T, color=drawing.BLUE, linewidth=1.8, zorder=3)
    left.scatter(*centre, s=16, color=drawing.RED, zorder=5)
left.scatter(*points[p], s=36, color=drawing.BLUE, zorder=6)
curve.note(left, points[p], "p", (-0.12, -0.2))
curve.note(
    left, np.mean(list(star.values()), axis=0), "its Voronoi cell in the\ntangent line", (0.75, 0.6)
)
left.set_title("k = 1: the star of p are two edges (blue)", y=-0.08)
left.set(xlim=(-1.6, 2.0), ylim=(-0.7, 1.4))

# A surface: the cell in the tangent plane is where the point is nearest of all.
torus = Torus(1, 0.4)
mesh = stellate.mesh(torus, 0.2)
p = int(np.linalg.norm(mesh.points - [1.28, 0, 0.28], axis=1).argmin())
basis = torus.tangent_basis(mesh.points[p : p + 1])[0]
away = mesh.points - mesh.points[p]
flat = away @ basis
others = np.flatnonzero((np.arange(len(away)) != p) & (np.linalg.norm(away, axis=1) < 1))
# |u|^2 <= |u - q|^2 + (height of q)^2, which is linear in u.
half_planes = np.hstack([flat[others], -(away[others] ** 2).sum(axis=1, keepdims=True) / 2])
corners = HalfspaceIntersection(half_planes, np.zeros(2)).intersections
corners = corners[np.isfinite(corners).all(axis=1)]
corners = corners[np.argsort(np.arctan2(corners[:, 1], corners[:, 0]))]
near = others[np.linalg.norm(away[others], axis=1) < 0.4]
right.fill(*corners.T, color=drawing.RED, alpha=0.3)
right.scatter(*corners.T, s=14, color=drawing.RED, zorder=4)
for triangle in mesh.simplices[(mesh.simplices == p).any(axis=1)]:
    right.fill(*flat[triangle].T, fill=False, edgecolor=drawing.BLUE, linewidth=1.4)
right.scatter(*flat[near].T, s=14, color=drawing.INK, zorder=3)
right.scatter(0, 0, s=36, color=drawing.BLUE, zorder=5)
right.set_title("k = 2: a triangle for each corner of the cell", y=-0.08)
right.set_aspect("equal")
right.set_axis_off()
drawing.save(figure, "star")
