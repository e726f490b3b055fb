"""Meshes in the coordinates x / scale, handed back in x."""

from __future__ import annotations

import dataclasses
from typing import Any, TypeVar

import numpy as np

from ._mesh import Mesh
from .oracle import points_of
from .oracles._units import in_units, units_of

M = TypeVar("M", bound=Mesh)


class Scale:
    """The units of an oracle's axes, (d,)."""

    def __init__(self, scale: Any, d: int) -> None:
        """Raises: InvalidArgument."""
        self._units = units_of(scale, d)

    @property
    def units(self) -> np.ndarray:
        """(d,), by which scaled points are multiplied."""
        return self._units

    def oracle(self, oracle: Any) -> Any:
        """It in scaled coordinates; it knows the own ones, in which places are named."""
        return in_units(oracle, self._units)

    def options(self, options: dict[str, Any]) -> dict[str, Any]:
        """Those of a mesh of that oracle: seeds are points, and what else is a length is one there."""
        seeds = options.get("seeds")
        if seeds is None:
            return options
        return {**options, "seeds": points_of(seeds, len(self._units)) / self._units}

    def mesh(self, mesh: M) -> M:
        """Its points in the oracle's own coordinates."""
        return dataclasses.replace(mesh, points=mesh.points * self._units)
