"""Dense is not enough: doubtful simplices by density, and a tetrahedron with two circumcentres."""

from __future__ import annotations

import sys

import _drawing as drawing
import matplotlib.pyplot as plt
import numpy as np

sys.path.insert(0, str(drawing.HERE.parents[1] / "examples" / "dense"))
import disagreements
import obstruction

figure = plt.figure(figsize=(9.2, 3.1), layout="constrained")
many, space, along = (
    figure.add_subplot(1, 3, 1),
    figure.add_subplot(1, 3, 2, projection="3d"),
    figure.add_subplot(1, 3, 3),
)

sizes = np.array([500, 1000, 2000, 4000])
for k, colour in ((2, drawing.BLUE), (3, drawing.RED)):
    spacing = 2 * np.pi / sizes ** (1 / k)
    counts = np.array([disagreements.row(k, int(n)) for n in sizes])
    many.loglog(1 / spacing, counts, "o-", color=colour, markersize=4)
    many.annotate(
        f"k = {k}", (1 / spacing[-1], counts[-1]), xytext=(-8, 7), textcoords="offset points"
    )
    if k == 3:
        many.loglog(1 / spacing, counts[-1] * spacing[-1] / spacing, ":", color=drawing.INK)
        many.annotate(
            "1 / h", (1 / spacing[1], counts[-1] * spacing[-1] / spacing[1] / 1.8), fontsize=8
        )
many.set(
    xlabel="1 / h", title="simplices that stars disagree about", ylim=(10, 3e4), xlim=(0.9, 20)
)
many.set_xticks([1, 2, 5, 10, 20], ["1", "2", "5", "10", "20"])
many.minorticks_off()

eps = 0.2
corners, centres, _, _ = obstruction.configuration(eps)
heights = np.linspace(-0.3, 0.35, 60)
curve = np.array([obstruction.centre(corners[:3], h * eps) for h in heights])
for i in range(4):
    for j in range(i):
        space.plot(*(corners[[i, j], :3] / eps).T, color=drawing.INK, linewidth=1.2)
space.plot(*(curve[:, :3] / eps).T, color=drawing.BLUE, linewidth=1.4)
space.scatter(*(corners[:, :3] / eps).T, color=drawing.INK, s=16)
space.scatter(*(centres[:, :3] / eps).T, color=drawing.RED, s=22, depthshade=False)
space.set(xlim=(-0.8, 0.8), ylim=(-0.8, 0.8), zlim=(-0.35, 0.4))
space.set_box_aspect((1, 1, 0.75), zoom=1.2)
space.axis("off")
space.set_title("the places equidistant from three points")
space.view_init(22, -62)

nearer = [-obstruction.power(c, corners[3], corners[0]) / (2 * eps) for c in curve]
along.axhline(0, color=drawing.SAND, linewidth=0.8)
along.plot(heights, np.array(nearer) / eps**3, color=drawing.BLUE)
along.scatter([-0.2, 0.25], [0, 0], color=drawing.RED, s=22, zorder=4)
along.set(xlabel="place on that curve, in eps", title="how much nearer the fourth is, in eps^3")
drawing.save(figure, "dense")
