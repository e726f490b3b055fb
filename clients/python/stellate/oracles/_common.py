"""What the ready oracles share."""

from __future__ import annotations

import numpy as np

from .._rows import Array, Flags, norms
from ..errors import InvalidArgument, NotConverged
from ..oracle import CheckedOracle


def all_or_raise(points: Array, found: Flags) -> Array:
    """Raises: NotConverged, with what was found."""
    if not found.all():
        raise NotConverged(points, found)
    return points


def refuse_walls(oracle: CheckedOracle, made: str) -> None:
    """What is made of a manifold with boundary would have none. Raises: InvalidArgument."""
    if oracle.walls:
        raise InvalidArgument(
            f"{made} is made of manifolds without boundary: clip it instead, by oracles.Clipped"
        )


def about_of(*parts: CheckedOracle) -> str:
    """What the oracles that another is made of say of themselves, each thing once."""
    return "; ".join(dict.fromkeys(part.about for part in parts if part.about))


def where_of(oracle: CheckedOracle) -> tuple[Array, Array]:
    """The box that an oracle has, or one about its seeds, as large as these lie apart; else 1."""
    if oracle.bounding_box is not None:
        return oracle.bounding_box
    seeds = oracle.seeds
    if seeds is None or not len(seeds):
        seeds = np.zeros((1, oracle.ambient_dimension))
    size = (float(norms(np.ptp(seeds, axis=0))) or 1.0) / np.sqrt(oracle.ambient_dimension)
    middle = (seeds.min(axis=0) + seeds.max(axis=0)) / 2
    return middle - size / 2, middle + size / 2


class Projection:
    """An oracle by `_project` alone."""

    dimension: int
    ambient_dimension: int

    def _project(self, x: Array) -> tuple[Array, Array, Flags]:
        """The projections of (n, d) points, tangent bases there, and where there are any."""
        raise NotImplementedError

    def closest_point(self, points: Array) -> Array:
        """(n, d) -> (n, d): the nearest points of M. Raises: NotConverged, with what was found."""
        nearest, _, found = self._project(np.asarray(points, dtype=np.float64))
        return all_or_raise(nearest, found)

    def tangent_basis(self, points: Array) -> Array:
        """(n, d) -> (n, d, k), at points of M."""
        _, bases, found = self._project(np.asarray(points, dtype=np.float64))
        bases[~found] = np.eye(self.ambient_dimension, self.dimension)
        return bases


def box_around(points: Array, share: float) -> tuple[Array, Array]:
    """The points' box, wider by a share of its diagonal at each side."""
    lower, upper = points.min(axis=0), points.max(axis=0)
    margin = share * float(norms(upper - lower))
    return lower - margin, upper + margin
