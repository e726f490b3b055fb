"""Axes of different units: the oracle of M in the coordinates x / scale."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._rows import Array
from ..errors import InvalidArgument
from ..oracle import CheckedOracle
from ._combined import Transformed

_MOST_NAMED = 8  # units in a sentence


def in_units(oracle: Any, scale: Any) -> Any:
    """The oracle of {x / scale : x in M}; `stellate.mesh(oracle, epsilon, scale=...)` is of it.

    Its nearest points are the nearest in scaled coordinates; its mesh is handed back in x. It is made of what the oracle is made of:
    equations and distances, walls, charts. Any other oracle needs a method
    `in_units(scale (d,)) -> oracle` of its own, unless all axes have one unit.

    Args:
      oracle: in x, its box and seeds, too.
      scale: (d,) positive lengths, about how far M goes along each axis; or one for all axes.

    Raises: InvalidArgument.
    """
    checked = CheckedOracle(oracle)
    units, name = units_of(scale, checked.ambient_dimension), type(oracle).__name__
    make = getattr(oracle, "in_units", None)
    if callable(make):
        made = make(units)
    elif (units == units[0]).all() and not checked.walls:
        made = Transformed(oracle, scale=1 / float(units[0]))
    else:
        raise InvalidArgument(
            f"scale is for oracles of equations, distances, walls and charts: {name} answers with what is "
            "nearest in its own coordinates, and in scaled ones another point is. Scale what it is made "
            "of, as PointCloud(points / scale, k), and then points * scale; or give it a method "
            "in_units(scale) that returns the oracle of M / scale",
            details={"fields": {"scale": f"{name} cannot be scaled"}},
        )
    # What a server delivers is in x, and what the oracle raises is not.
    if callable(getattr(oracle, "coordinates", None)):
        made.coordinates = oracle.coordinates
    made.coordinate_scale = units * np.asarray(checked.coordinate_scale or 1.0)
    own = checked.about
    made.about = f"{about_units(units)}{'; ' if own else ''}{own}"
    return made


def units_of(scale: Any, d: int) -> Array:
    """(d,), positive. Raises: InvalidArgument."""
    try:
        given = np.asarray(scale)
    except ValueError:  # ragged lists
        given = np.asarray(None)
    whole = given.dtype.kind in "fiu" and given.shape in ((), (d,))
    units = np.broadcast_to(given.astype(np.float64), (d,)).copy() if whole else np.zeros(d)
    if not (np.isfinite(units) & (units > 0)).all():
        raise InvalidArgument(
            f"scale has to be {d} positive numbers, one for each axis, or one for all, and is {scale!r}",
            details={"fields": {"scale": f"must be {d} positive numbers, or one"}},
        )
    return units


def about_units(units: Array) -> str:
    """What verdicts say. Without parentheses, which places have."""
    named = [f"{unit:.6g}" for unit in units[:_MOST_NAMED]]
    more = ["..."] if len(units) > _MOST_NAMED else []
    return f"coordinates were divided by {', '.join(named + more)}, and lengths and angles are of these"


class Before:
    """A function of x as one of x / scale."""

    def __init__(self, f: Any, units: Array) -> None:
        self._f, self._units = f, units

    def __call__(self, points: Array) -> Any:
        return self._f(points * self._units)


class SlopeBefore(Before):
    """Its gradient or Jacobian, (n, ..., d)."""

    def __call__(self, points: Array) -> Any:
        return self._f(points * self._units) * self._units


class After:
    """A map into x as one into x / scale: (n, d), or with `slopes` its derivative, (n, d, k)."""

    def __init__(self, f: Any, units: Array, *, slopes: bool = False) -> None:
        self._f, self._units = f, units[:, None] if slopes else units

    def __call__(self, parameters: Array) -> Any:
        return self._f(parameters) / self._units
