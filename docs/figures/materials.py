"""Materials that meet: three grains in a ball, and four in one, drawn apart."""

from __future__ import annotations

from collections.abc import Callable

import _drawing as drawing
import matplotlib.pyplot as plt
import numpy as np
import stellate
from stellate import solids as s

COLOURS = [drawing.BLUE, drawing.SAND, drawing.RED, drawing.GREEN]


def near_to(centre: list[float]) -> Callable[[np.ndarray], np.ndarray]:
    return lambda x: -((x - np.array(centre)) ** 2).sum(axis=1)


def draw(axes: plt.Axes, centres: list[list[float]], apart: float, title: str) -> None:
    """Each grain's surface, moved away from the middle by so much."""
    mesh = stellate.mesh(s.Phases(*map(near_to, centres)) & s.Ball(1), epsilon=0.12)
    assert mesh.certified
    axes.view_init(30, -55)
    towards = drawing.eye_of(axes)
    order = sorted(range(len(centres)), key=lambda i: float(np.dot(centres[i], towards)))
    for i in order:
        grain = mesh.region(i + 1)
        skin = np.concatenate([face.simplices for face in grain.boundary])
        outwards = stellate.Mesh(grain.points, skin).oriented_simplices()
        shift = apart * np.array(centres[i]) / np.linalg.norm(centres[i])
        drawing.shaded(axes, grain.points + shift, outwards, 30, -55, COLOURS[i], size=1.1 + apart)
    axes.set_title(title, y=-0.04)


three = [[-0.29, 0.41, 0.87], [0.85, 0.29, -0.43], [-0.57, -0.7, -0.43]]  # around the eye
four = [[1, 1, 1.1], [1, -1, -1], [-1, 1, -0.9], [-1, -1.1, 1]]
figure, axes = plt.subplots(1, 2, figsize=(7, 3.4), subplot_kw={"projection": "3d"})
draw(axes[0], three, 0.0, "Phases(f, g, h) & Ball")
draw(axes[1], four, 0.35, "four phases, drawn apart")
figure.subplots_adjust(left=0, right=1, bottom=0.04, top=1, wspace=0)
drawing.save(figure, "materials")
