"""Reconstruction: points with noise, and the mesh at their smoothed positions."""

from __future__ import annotations

import pathlib
import sys

import _drawing as drawing
import matplotlib.pyplot as plt
import numpy as np
import stellate

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tests/clients/python"))
import samples  # noqa: E402

rng = np.random.default_rng(4)
exact = samples.torus(rng, 0.1)
noisy = exact + rng.normal(scale=0.02, size=exact.shape)
mesh = stellate.reconstruct(noisy, 2)
assert mesh.certified and mesh.smoothed is not None, mesh.report

figure, (left, right) = plt.subplots(1, 2, figsize=(7, 2.9), subplot_kw={"projection": "3d"})
left.scatter(*noisy.T, s=4, color=drawing.INK, linewidths=0, depthshade=False)
left.set_title(f"{len(noisy):,} points, noise 0.02", y=-0.04)
drawing.shaded(right, mesh.smoothed, mesh.oriented_simplices(), elevation=38, azimuth=-60, size=1.5)
right.set_title("their mesh, certified", y=-0.04)
left.view_init(38, -60)
left.set(xlim=right.get_xlim(), ylim=right.get_ylim(), zlim=right.get_zlim())
left.set_box_aspect((1, 1, 1), zoom=1.5)
left.set_axis_off()
figure.subplots_adjust(left=0, right=1, bottom=0.04, top=1, wspace=0)
drawing.save(figure, "reconstruct")
