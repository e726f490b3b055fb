"""Before a mesh begins: whether it has an end, and epsilon the size that its manifold asks for."""

from __future__ import annotations

import itertools
import math
import os
import sys
import warnings
from typing import Callable

import numpy as np

from .errors import OracleError
from .oracle import CheckedOracle

_POINTS = 64  # that are looked for, where a box alone says that there are too many vertices
_MANY = 100_000  # vertices: no server is asked for its limit below
_FEWEST = 8  # of them, to judge by
_CORNERS = 16  # of a box that are looked beyond, at most
# How far out, in half boxes. What goes on for a box's diagonal beyond it, the server stops, too.
_STATIONS = (1.02, 1.5, 2.0, 3.0)
_FAR = 1e50  # so large is no box; its powers have no end
_UNITS = 100.0  # times as long a side of the box is a hint that axes have different units
_SHARE = 1.5  # of epsilon^k, which a vertex has of M: 1.3 to 1.8 on spheres and tori
_DOUBT = 10.0  # the estimate may be off by a few; tubes far thinner than points lie apart, by more


def insist_on_an_end(oracle: CheckedOracle) -> None:
    """Raises: OracleError, of a domain of space that goes on and on beyond its bounding box.

    Asks for clearances at 2 d + 16 points at most, where none of them is inside.
    """
    is_domain = oracle.walls and oracle.dimension == oracle.ambient_dimension
    if not is_domain or not oracle.bounding_box or oracle.closures:
        return  # closures may be wrong, which the server finds
    lower, upper = oracle.bounding_box
    if lower.shape != (oracle.ambient_dimension,) or not np.isfinite(upper - lower).all():
        return  # the server says what is wrong with it
    middle, half = (lower + upper) / 2, (upper - lower) / 2
    d = len(middle)
    corners = itertools.islice(itertools.product((1.0, -1.0), repeat=d), _CORNERS)
    ways = np.concatenate([np.eye(d), -np.eye(d), np.array(list(corners))])
    for station in _STATIONS:
        ways = ways[_inside(oracle, middle + station * half * ways)]
        if not len(ways):
            return
    there = middle + _STATIONS[-1] * half * ways[0]
    within = _within(lower, upper)
    if _inside(oracle, within).all():
        why = (
            f"It holds all of {_POINTS} points of its box, too: the function has no zero there that it passes "
            "through with a change of sign, as a square has none, or the box is far too small."
        )
    else:
        why = "Inside is where functions are positive: is a sign the wrong way round?"
    raise OracleError(
        f"the solid goes on outside of its bounding box, as at {there.round(6).tolist()}. {why} To cut "
        "what has no end, take solids.Implicit(g) & solids.Box(lower, upper), where Implicit has no box",
        "ORACLE_UNBOUNDED",
    )


def warn_of_count(
    oracle: CheckedOracle, epsilon: float, is_graded: bool, most: Callable[[], int]
) -> None:
    """A UserWarning where epsilon is larger than the bounding box, or asks for far more than `most` vertices.

    Asks for 64 closest points if the box has place for so many, and else nothing. `is_graded`:
    sizes are smaller than epsilon where M bends.
    """
    if not oracle.bounding_box or not 0 < epsilon < math.inf:
        return
    lower, upper = oracle.bounding_box
    with np.errstate(over="ignore", invalid="ignore"):
        across = float(np.linalg.norm(upper - lower))
    if not 0 < across < _FAR or lower.shape != (oracle.ambient_dimension,):
        return  # the server says what is wrong with it
    if epsilon > across and not is_graded:
        _warn(
            f"epsilon = {epsilon:g} is larger than the bounding box, whose corners are {across:.3g} apart: what "
            "lies in it is meshed by an epsilon well below its bends. Is that in another unit?"
        )
    at_most = _count(across**oracle.dimension, oracle, epsilon)
    if at_most < _MANY or at_most < _DOUBT * most():
        return
    size = _size(oracle)
    count = _count(size, oracle, epsilon)
    if count < _DOUBT * most():
        return
    units = ""
    sides = upper - lower
    if sides.max() > _UNITS * sides.min():
        units = f". If axes have different units, scale={[float(f'{side:.2g}') for side in sides]} divides by them"
    would = (size / (_SHARE * most() / 2)) ** (1 / oracle.dimension)
    _warn(
        f"epsilon = {epsilon:g} asks for about {count:.0e} vertices, to judge by how far points of the "
        f"manifold lie apart, and the mesh will end uncertified at the {most():,} that there may be "
        f"(max_vertices). An epsilon of {would:.2g} takes about half of that{units}"
    )


def _count(size: float, oracle: CheckedOracle, epsilon: float) -> float:
    """Of vertices, on a manifold of so many units^k."""
    return size / _SHARE / epsilon**oracle.dimension if epsilon > 1e-60 else math.inf


def _size(oracle: CheckedOracle) -> float:
    """About how many units^k the manifold has; 0 where hardly a point of it was found."""
    assert oracle.bounding_box is not None
    lower, upper = oracle.bounding_box
    points = _within(lower, upper)
    try:
        found, there = oracle.closest_points(points)
    except Exception:  # the mesh asks, too, and says what is wrong
        return 0.0
    found = found[there]
    found = found[_inside(oracle, found)]
    k, n = oracle.dimension, len(found)
    if n < _FEWEST:
        return 0.0
    if k == oracle.ambient_dimension:
        return float(np.prod(upper - lower)) * n / _POINTS
    apart = np.linalg.norm(found[:, None] - found[None, :], axis=2)
    np.fill_diagonal(apart, math.inf)
    ball = math.pi ** (k / 2) / math.gamma(k / 2 + 1)
    return float((n - 1) * ball * (apart.min(axis=1) ** k).mean())  # however unevenly they lie


def _within(lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Points of a box, (64, d)."""
    shares = np.random.default_rng(1).random((_POINTS, len(lower)))
    return np.asarray(lower + shares * (upper - lower))


def _inside(oracle: CheckedOracle, points: np.ndarray) -> np.ndarray:
    """Which rows no wall leaves out; none where the oracle refuses to say."""
    if not oracle.walls or not len(points):
        return np.ones(len(points), dtype=bool)
    try:
        positive = oracle.clearances(points, np.ones(len(points), dtype=bool)) > 0
    except Exception:  # far from the manifold it need not answer
        return np.zeros(len(points), dtype=bool)
    if not oracle.labels:
        return np.asarray(positive.all(axis=1))
    labels = np.frombuffer(oracle.labels, dtype=np.int8)
    return np.asarray(labels[positive @ (1 << np.arange(oracle.walls))] > 0)


def _warn(text: str) -> None:
    """Shown at the line of the first caller outside of this package."""
    package = os.path.dirname(__file__) + os.sep
    level, frame = 1, sys._getframe(0)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(package):
        level, frame = level + 1, frame.f_back
    warnings.warn(text, UserWarning, stacklevel=level)
