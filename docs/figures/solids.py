"""Solids that are composed: what is kept of a box and a ball, and what is rounded or drilled."""

from __future__ import annotations

import _drawing as drawing
import matplotlib.pyplot as plt
import numpy as np
import stellate
from stellate import solids as s


def part() -> s.Solid:
    """A cube and a ball, without three cylinders."""
    holes = s.Cylinder(0.5, axis="x") | s.Cylinder(0.5, axis="y") | s.Cylinder(0.5)
    return (s.Box([-1] * 3, [1] * 3) & s.Ball(1.3)) - holes


def flange() -> s.Solid:
    """A turned disc with a bore and six holes."""
    disc = s.Cylinder(1, 0.4) - s.Cylinder(0.35)
    for angle in np.arange(6) * np.pi / 3:
        place = 0.7 * np.cos(angle), 0.7 * np.sin(angle), 0
        disc = disc - s.Cylinder(0.12, 2, at=place)
    return disc.rotated(s.rotation("x", 0.3))


def draw(axes: plt.Axes, solid: s.Solid, epsilon: float, size: float, title: str) -> None:
    """The boundary, shaded, and the edges on it."""
    mesh = stellate.mesh(solid, epsilon)
    assert mesh.certified
    skin = np.concatenate([face.simplices for face in mesh.boundary])
    outwards = stellate.Mesh(mesh.points, skin).oriented_simplices()
    drawing.shaded(axes, mesh.points, outwards, elevation=30, azimuth=-55, size=size)
    axes.set_title(title, y=-0.04)


figure, axes = plt.subplots(1, 3, figsize=(9, 3.2), subplot_kw={"projection": "3d"})
draw(axes[0], part(), 0.12, 1.35, "(Box & Ball) - three Cylinders")
draw(axes[1], s.blend(s.Ball(0.7, at=(-0.4, 0, 0)), s.Ball(0.5, at=(0.6, 0, 0)), 0.2), 0.08, 1.1,
     "blend(Ball, Ball, radius)")  # fmt: skip
draw(axes[2], flange(), 0.08, 1.05, "Cylinder - Cylinder - six Cylinders")
figure.subplots_adjust(left=0, right=1, bottom=0.04, top=1, wspace=0)
drawing.save(figure, "solids")
