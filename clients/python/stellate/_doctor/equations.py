"""Whether the equations that M is given by, if it is, are of full rank on all of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Callable

import numpy as np

from .._lowest import descend
from .._shared import table
from .findings import Finding
from .probe import Probe, norms

_K: Mapping[str, Any] = table("doctor.toml")


def examine_rank(probe: Probe, add: Callable[[Finding], None]) -> None:
    """Follows the Jacobian's least singular value down along M, from where it is smallest.

    Each equation counts by how steep it is usually, so that units do not matter.
    """
    steep = norms(probe.jacobian(probe.points))
    usual = np.maximum(np.median(steep, axis=0), 1e-300)

    def scaled(p: np.ndarray) -> np.ndarray:
        return probe.jacobian(p) / usual[:, None]

    def least(p: np.ndarray) -> np.ndarray:
        values: np.ndarray = np.linalg.svd(scaled(p), compute_uv=False)[:, -1]
        if probe.walls and len(p):  # beyond them M may be whatever it is
            values = np.where((probe.clearances(p) >= 0).all(axis=1), values, np.inf)
        return values

    def tangents(p: np.ndarray) -> np.ndarray:
        across = np.linalg.svd(scaled(p), full_matrices=True)[2]
        return across[:, probe.ambient_dimension - probe.dimension :].transpose(0, 2, 1)

    sizes = least(probe.points)
    inside = np.isfinite(sizes)
    if not inside.any():
        return
    order = np.argsort(sizes, kind="stable")[: min(_K["rank_descents"], np.count_nonzero(inside))]
    starts = probe.points[order]
    places, lowest = descend(starts, least, probe.closest, tangents, probe.size)
    worst = int(np.argmin(lowest))
    usual = float(np.median(sizes[inside]))
    if lowest[worst] <= _K["least_rank_share"] * usual:
        ratio = float(lowest[worst]) / max(usual, 1e-300)
        add(Finding.of("SINGULAR", query=places[worst], ratio=ratio))
