"""Where on a manifold a function that is not negative comes down to zero."""

from __future__ import annotations

from typing import Callable

import numpy as np

from ._rows import Array, Flags, apply, norms
from ._shared import table

_K = table("equations.toml")
_WAYS = 2  # that are tried at a time, each forth and back


def descend(
    starts: Array,
    measure: Callable[[Array], Array],
    closest: Callable[[Array], tuple[Array, Flags]],
    tangents: Callable[[Array], Array],
    size: float,
) -> tuple[Array, Array]:
    """From points (n, d) of M downhill along it, by shorter and shorter steps in random ways.

    Args:
      measure: (n, d) -> (n,), at points of M.
      closest: (n, d) -> (n, d), and where there are any.
      tangents: (n, d) -> (n, d, k).

    Returns: where that leads (n, d), and the measure there (n,): far below what it is at the starts where
      it has a zero near by, for the last steps are that short.
    """
    random = np.random.default_rng(1)
    p, least = starts.copy(), measure(starts)
    steps = np.full(len(p), _K["rank_first_step"] * size)
    for _ in range(_K["rank_rounds"]):
        rows = np.flatnonzero(steps > _K["rank_last_step"] * size)
        if not rows.size:
            break
        bases = tangents(p[rows])
        came = np.zeros(len(rows), dtype=bool)
        for _ in range(_WAYS):
            way = random.standard_normal((len(rows), bases.shape[2]))
            way *= (steps[rows] / norms(way))[:, None]
            step = apply(bases, way)
            for side in (step, -step):
                there, found = closest(np.ascontiguousarray(p[rows] + side))
                lower = np.full(len(rows), np.inf)
                lower[found] = measure(np.ascontiguousarray(there[found]))
                better = lower < least[rows]
                p[rows[better]], least[rows[better]] = there[better], lower[better]
                came |= better
        steps[rows[~came]] /= 2
    return p, least
