"""What epsilon costs and brings: vertices and distance of tori, from a tenth to 0.75 of the reach."""

from __future__ import annotations

import _drawing as drawing
import matplotlib.pyplot as plt
import numpy as np
import stellate
from stellate.manifolds import Torus

REACH = 0.4
shares = np.array([0.1, 0.15, 0.2, 0.3, 0.4, 0.6, 0.75])
meshes = [stellate.mesh(Torus(1, REACH), share * REACH) for share in shares]
vertices = np.array([len(mesh.points) for mesh in meshes])
distances = np.array([mesh.report.certificate.max_barycentre_distance for mesh in meshes])
angles = np.array([mesh.report.certificate.max_tangent_angle_degrees for mesh in meshes])
assert all(mesh.certified for share, mesh in zip(shares, meshes) if share <= 0.4)

figure, panels = plt.subplots(1, 3, figsize=(9.5, 2.7), layout="constrained")
for axes, values, title, slope, ticks in (
    (panels[0], vertices, "vertices ~ epsilon$^{-2}$", -2, [200, 500, 1000, 2000, 5000]),
    (panels[1], distances / REACH, "distance from M / reach ~ epsilon$^2$", 2, [0.005, 0.02, 0.1]),
    (panels[2], angles, "largest angle to M, degrees ~ epsilon", 1, [10, 20, 40]),
):
    middle = len(shares) // 2
    axes.axvspan(0.4, 0.8, color="#f3ead9", linewidth=0)
    axes.loglog(shares, values[middle] * (shares / shares[middle]) ** slope, "--", linewidth=0.8,
                color=drawing.SAND)  # fmt: skip
    axes.loglog(shares, values, "o-", color=drawing.BLUE, markersize=4, linewidth=1.2)
    axes.set_title(title)
    axes.set_xlabel("epsilon / reach")
    axes.set_xticks([0.1, 0.2, 0.4, 0.8], ["0.1", "0.2", "0.4", "0.8"])
    axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    axes.spines[["top", "right"]].set_visible(False)
drawing.save(figure, "epsilon")
