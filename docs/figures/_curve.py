"""A peanut in the plane, k = 1 and d = 2: what stars, flats and certificates are, small enough to draw.

What is drawn is computed as the mesher does: stars by restricted Voronoi cells, new points by flats.
"""

from __future__ import annotations

import _drawing as drawing
import numpy as np
from matplotlib.axes import Axes

T = np.linspace(0, 2 * np.pi, 8001)[:-1]


def at(t: np.ndarray | float) -> np.ndarray:
    t = np.asarray(t, dtype=float)
    return np.stack([1.5 * np.cos(t), (0.2 + 0.95 * np.cos(t) ** 2) * np.sin(t)], axis=-1)


CURVE = at(T)


def tangents(points: np.ndarray) -> np.ndarray:
    """Unit, at the curve's points nearest to these."""
    t = T[nearest(points)]
    difference = at(t + 1e-5) - at(t - 1e-5)
    return difference / np.linalg.norm(difference, axis=1, keepdims=True)


def nearest(points: np.ndarray) -> np.ndarray:
    """Which of CURVE."""
    return np.linalg.norm(points[:, None, :] - CURVE, axis=2).argmin(axis=1)


def stars(points: np.ndarray) -> list[dict[int, np.ndarray]]:
    """Of each point the neighbours in its star, and the circumcentres: the ends of its Voronoi cell
    within its tangent line."""
    found = []
    for p, tangent in zip(points, tangents(points)):
        away = points - p
        along = away @ tangent
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = (away**2).sum(axis=1) / (2 * along)
        star = {}
        for side in (1, -1):
            places = np.where(side * along > 1e-12, side * ends, np.inf)
            q = int(places.argmin())
            if np.isfinite(places[q]):
                star[q] = p + side * places[q] * tangent
        found.append(star)
    return found


def on_flat(centre: np.ndarray, tangent: np.ndarray) -> np.ndarray:
    """The point of the curve nearest to a centre on the normal line through it."""
    off = (CURVE - centre) @ tangent
    crossings = np.flatnonzero(off * np.roll(off, -1) <= 0)
    distances = np.linalg.norm(CURVE[crossings] - centre, axis=1)
    return CURVE[crossings[distances.argmin()]]


def draw(axes: Axes, colour: str = drawing.SAND, width: float = 2.5) -> None:
    axes.plot(*np.vstack([CURVE, CURVE[:1]]).T, color=colour, linewidth=width, zorder=1)
    axes.set_aspect("equal")
    axes.set_axis_off()


def note(axes: Axes, where: np.ndarray, words: str, by: tuple[float, float]) -> None:
    axes.annotate(
        words, where, where + np.asarray(by), fontsize=8, color=drawing.INK, ha="center", va="center",
        arrowprops={"arrowstyle": "-", "linewidth": 0.6, "color": drawing.INK},
    )  # fmt: skip
