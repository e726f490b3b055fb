"""Points on manifolds whose topology is known, as samples of them come: even, and with noise."""

from __future__ import annotations

import numpy as np


def thinned(points: np.ndarray, spacing: float) -> np.ndarray:
    """As many of the points, in their order, as keep that distance from each other."""
    kept: list[np.ndarray] = []
    cells: dict[tuple[int, ...], list[np.ndarray]] = {}
    steps = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3, indexing="ij"), -1).reshape(-1, 3)
    for point in points:
        # Cells of the first three coordinates: who is near is near in them.
        cell = np.floor(np.resize(point[:3], 3) / spacing).astype(int)
        near = [q for step in steps for q in cells.get(tuple(cell + step), ())]
        if near and (((np.array(near) - point) ** 2).sum(axis=1) < spacing**2).any():
            continue
        kept.append(point)
        cells.setdefault(tuple(cell), []).append(point)
    return np.array(kept)


def torus(rng: np.random.Generator, spacing: float = 0.14) -> np.ndarray:
    """Of radii 1 and 0.4, in R^3."""
    n = int(60 / spacing**2)
    u, v, keep = rng.uniform(size=(3, n))
    u, v = 2 * np.pi * u, 2 * np.pi * v
    wide = 1 + 0.4 * np.cos(v)
    points = np.stack([wide * np.cos(u), wide * np.sin(u), 0.4 * np.sin(v)], axis=1)
    return thinned(points[keep < wide / 1.4], spacing)


def klein_bottle(rng: np.random.Generator, spacing: float = 0.2) -> np.ndarray:
    """In R^4, flat along one circle."""
    u, v = 2 * np.pi * rng.uniform(size=(2, int(60 / spacing**2)))
    wide = 1.5 + 0.6 * np.cos(v)
    points = np.stack(
        [
            wide * np.cos(u),
            wide * np.sin(u),
            0.6 * np.sin(v) * np.cos(u / 2),
            0.6 * np.sin(v) * np.sin(u / 2),
        ],
        axis=1,
    )
    return thinned(points, spacing)


def rotations(rng: np.random.Generator, count: int = 12_000, spacing: float = 0.42) -> np.ndarray:
    """SO(3) in R^9, a matrix a row."""
    w, x, y, z = (q := rng.normal(size=(4, count))) / np.linalg.norm(q, axis=0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return thinned(np.array(rows).reshape(9, count).T, spacing)


def random_torus(count: int) -> np.ndarray:
    """Independent points of a torus of radii 1 and 0.4, of an even density; always the same."""
    turns = np.random.default_rng(1).uniform(0, 2 * np.pi, (4 * count, 2))
    keep = np.random.default_rng(2).uniform(0, 1.4, 4 * count) < 1 + 0.4 * np.cos(turns[:, 1])
    u, v = turns[keep][:count].T
    wide = 1 + 0.4 * np.cos(v)
    return np.stack([wide * np.cos(u), wide * np.sin(u), 0.4 * np.sin(v)], axis=1)
