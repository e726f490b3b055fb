"""Whether the equations that M is given by are of full rank on all of it.

The server never sees equations, so that clients have this each: C++'s is clients/cpp/run/rank.cc. Both take
their constants from clients/shared/equations.toml, and their tests' cases from singular.json there.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ._findings import Finding, shown
from ._lowest import descend
from ._rows import norms
from ._shared import table
from .oracle import CheckedOracle

_K: Mapping[str, Any] = table("equations.toml")
_STARTS = 400


def find_singular(oracle: CheckedOracle, seed: int) -> Finding | None:
    """Follows the Jacobian's least singular value down along M, from where it is smallest.

    Each equation counts by how steep it is usually, so that units do not matter. Raises what the
    oracle does.
    """
    points = _points(oracle, np.random.default_rng(seed))
    size = float(norms(np.ptp(points, axis=0))) if len(points) else 0.0
    if not oracle.has_jacobian or not size > 0:
        return None
    steep = norms(oracle.jacobians(points))
    usual = np.maximum(np.median(steep, axis=0), 1e-300)

    def scaled(p: np.ndarray) -> np.ndarray:
        return oracle.jacobians(p) / usual[:, None]

    def least(p: np.ndarray) -> np.ndarray:
        values: np.ndarray = np.linalg.svd(scaled(p), compute_uv=False)[:, -1]
        if oracle.walls and len(p):  # beyond them M may be whatever it is
            inside = (oracle.clearances(p, np.ones(len(p), dtype=bool)) >= 0).all(axis=1)
            values = np.where(inside, values, np.inf)
        return values

    def tangents(p: np.ndarray) -> np.ndarray:
        across = np.linalg.svd(scaled(p), full_matrices=True)[2]
        return across[:, oracle.ambient_dimension - oracle.dimension :].transpose(0, 2, 1)

    sizes = least(points)
    inside = np.isfinite(sizes)
    if not inside.any():
        return None
    order = np.argsort(sizes, kind="stable")[: min(_K["rank_descents"], np.count_nonzero(inside))]
    places, lowest = descend(points[order], least, oracle.closest_points, tangents, size)
    worst = int(np.argmin(lowest))
    typical = float(np.median(sizes[inside]))
    if lowest[worst] > _K["least_rank_share"] * typical:
        return None
    ratio = float(lowest[worst]) / max(typical, 1e-300)
    message, advice = _K["singular"]
    query = places[worst]
    return Finding(
        "error", "SINGULAR", message.format(query=shown(query), ratio=f"{ratio:.4g}"), advice, query
    )


def _points(oracle: CheckedOracle, random: np.random.Generator) -> np.ndarray:
    """Points of M, (n, d)."""
    d, box, seeds = oracle.ambient_dimension, oracle.bounding_box, oracle.seeds
    if box is not None:
        starts = box[0] + (box[1] - box[0]) * random.random((_STARTS, d))
    else:
        assert seeds is not None, "the server has found M"
        starts = seeds[np.arange(_STARTS) % len(seeds)]
        spread = float(norms(np.ptp(seeds, axis=0))) or float(norms(seeds[0])) or 1.0
        starts = starts + _K["seed_spread"] * spread * random.standard_normal(starts.shape) / d**0.5
    answers, found = oracle.closest_points(np.ascontiguousarray(starts))
    return np.ascontiguousarray(answers[found])
