"""Phases: several materials, at each point that one of which the function is the largest."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np

from .._derivatives import Library
from .._rows import Array
from ..errors import InvalidArgument
from ..oracles import Solid as WalledSolid
from ..oracles._walls import derived
from ._label_volume import splines_of_labels
from ._primitives import Implicit
from ._signs import MOST_IN_TABLES, Labels, needed
from ._solid import ByWalls, Solid
from ._walls import Function, Wall


class Phases(ByWalls):
    """Materials that fill space: label i + 1 where function i is the largest. Cut by a solid it is an
    oracle, which stellate.mesh takes.

        phases = Phases(f1, f2, f3) & Ball(1)
        mesh = stellate.mesh(phases, epsilon=0.2)
        mesh.labels  # 1, 2 or 3 of each simplex

    Three materials meet along edges, four in points, at whatever angles. The walls between two of them
    have to cross at an angle there, and their functions must not be equal anywhere else than on a
    smooth surface. Wall by wall these are f0 - f1, f0 - f2, ..., f1 - f2, ...; then the solid's.

    Args:
      functions: two to six, (n, d) -> (n,), smooth near where they are the largest two.
      gradients: of the functions, (n, d) -> (n, d) each; or "autograd", "jax" or "torch", if they are
        written for one of these; or None: differences.
      names: of the materials, for `mesh.region(name)` and the groups of files; one for each, or none.

    `phases & solid` and `solid & phases` cut, as often as you like: there may be 16 walls at most.
    """

    def __init__(
        self,
        *functions: Function,
        gradients: Sequence[Function | None] | Library | None = None,
        names: Sequence[str] = (),
    ) -> None:
        if not 2 <= len(functions) <= 6 or not all(map(callable, functions)):
            raise InvalidArgument(
                f"phases are of two to six functions, and these are {len(functions)}"
                if all(map(callable, functions))
                else "phases are of functions (n, d) -> (n,)"
            )
        if isinstance(gradients, str):
            both = [derived(function, gradients) for function in functions]
            functions, gradients = tuple(f for f, _ in both), [slope for _, slope in both]
        slopes = gradients or [getattr(function, "gradient", None) for function in functions]
        if len(slopes) != len(functions):
            raise InvalidArgument("gradients are one for each function, or None")
        if names and len(names) != len(functions):
            raise InvalidArgument(f"there are {len(names)} names for {len(functions)} phases")
        self.region_names = tuple(names)
        self._functions, self._slopes = functions, tuple(slopes)
        self._region: Solid | None = None

    @classmethod
    def of_labels(
        cls,
        labels: Any,
        *,
        spacing: Any = 1.0,
        origin: Any = 0.0,
        smooth: float,
        names: Sequence[str] = (),
    ) -> Phases:
        """The materials of a segmentation: a volume of voxels with a whole number each, 0 outside.

        Args:
          labels: (n_1, ..., n_d), with two to six numbers beside 0. In their order they are labels 1, 2,
            ... of the mesh. Around them there has to be a layer of 0: np.pad(labels, 3).
          spacing, origin: of voxels, as in oracles.SignedDistance.of_volume.
          smooth: a length, some 1.5 of the largest spacing: each label's mask is smoothed by it, and the
            largest wins. What is thinner than twice that is lost, and what is round gets smaller.
          names: of the materials; by default "label_3" of the number 3, and so on.

        Raises: InvalidArgument, without scipy, too.
        """
        functions, numbers, body = splines_of_labels(labels, spacing, origin, smooth)
        given = names or [f"label_{number}" for number in numbers]
        value, gradient, box = body
        return cls(*functions, names=given) & Implicit(value, gradient, bounding_box=box)

    def __and__(self, other: Solid) -> Phases:
        if not isinstance(other, Solid):
            return NotImplemented
        cut = Phases(*self._functions, gradients=self._slopes, names=self.region_names)
        cut._region = other if self._region is None else self._region & other
        return cut

    __rand__ = __and__

    def label_at(self, points: Any) -> Labels:
        """(n, d) -> (n,): the label of each point, 0 outside of what the phases are cut by."""
        x = np.atleast_2d(np.array(points, dtype=np.float64))
        labels = np.argmax(self._values(x), axis=1) + 1
        if self._region is not None:
            labels = np.where(self._region.contains(x), labels, 0)
        return labels.astype(np.int8)

    def _values(self, points: Array) -> Array:
        """(n, d) -> (n, phases)"""
        return np.stack(
            [np.asarray(f(points)).reshape(len(points)) for f in self._functions], axis=1
        )

    @property
    def _cut(self) -> Solid:
        if self._region is None:
            raise InvalidArgument(
                "phases go on without end: cut them by a solid, as Phases(f, g) & Ball(1)"
            )
        return self._region

    @property
    def ambient_dimension(self) -> int:
        return self._cut.dimension

    dimension = ambient_dimension

    @property
    def bounding_box(self) -> tuple[Array, Array]:
        return self._cut.bounding_box

    @functools.cached_property
    def _oracle(self) -> WalledSolid:
        cut, inside = needed(*self._cut.label_table())
        pairs = list(itertools.combinations(range(len(self._functions)), 2))
        count = len(pairs) + len(cut)
        if count > MOST_IN_TABLES:
            raise InvalidArgument(
                f"{len(self._functions)} phases have {len(pairs)} walls, and what they are cut by has "
                f"{len(cut)}; there may be {MOST_IN_TABLES} together"
            )
        codes = np.arange(1 << count)
        labels = _of_orders(len(self._functions), codes)
        region = np.maximum(inside, 0)[codes >> len(pairs)] > 0
        labels[(labels > 0) & ~region] = 0
        walls: list[Wall] = [_Difference(self._one(i), self._one(j)) for i, j in pairs]
        return WalledSolid(
            [*walls, *cut],
            self.bounding_box,
            labels=labels,
            closures=_triples(pairs),
        )

    def _one(self, i: int) -> tuple[Function, Function | None]:
        return self._functions[i], self._slopes[i]

    def __repr__(self) -> str:
        cut = "" if self._region is None else f" in {self._region!r}"
        return f"<stellate.solids.Phases: {len(self._functions)} phases{cut}>"


class _Difference(Wall):
    """Where one function is larger than another; of each its gradient, or None."""

    def __init__(
        self, one: tuple[Function, Function | None], other: tuple[Function, Function | None]
    ) -> None:
        self._one, self._other = one, other

    def __call__(self, points: Array) -> Array:
        first, second = (np.asarray(f(points)).reshape(len(points)) for f in self._both(0))
        return np.asarray(first - second)

    @property
    def gradient(self) -> Function | None:
        return self._steepness if all(self._both(1)) else None

    def _steepness(self, points: Array) -> Array:
        first, second = (np.asarray(f(points)).reshape(points.shape) for f in self._both(1))
        return np.asarray(first - second)

    def _both(self, which: int) -> tuple[Any, Any]:
        return self._one[which], self._other[which]

    def __repr__(self) -> str:
        return f"where {self._one[0]!r} is larger than {self._other[0]!r}"


def _of_orders(count: int, codes: Any) -> Labels:
    """The number, from 1, of the phase that is the largest, by the signs of the differences of each two;
    -1 where these are of no order."""
    beats = np.zeros((count, len(codes)), dtype=np.int8)
    for bit, (i, j) in enumerate(itertools.combinations(range(count), 2)):
        larger = (codes >> bit & 1).astype(bool)
        beats[i] += larger
        beats[j] += ~larger
    # In an order each beats another number of the rest.
    is_order = (np.sort(beats, axis=0) == np.arange(count)[:, None]).all(axis=0)
    return np.where(is_order, beats.argmax(axis=0) + 1, -1).astype(np.int8)


def _triples(pairs: list[tuple[int, int]]) -> list[tuple[int, ...]]:
    """The walls between each three phases, of which each is zero where the other two are."""
    at = {pair: wall for wall, pair in enumerate(pairs)}
    phases = range(max(j for _, j in pairs) + 1)
    return [
        tuple(at[pair] for pair in itertools.combinations(three, 2))
        for three in itertools.combinations(phases, 3)
    ]
