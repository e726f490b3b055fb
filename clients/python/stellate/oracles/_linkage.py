"""Configuration spaces of linkages: joints held apart by bars."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .._rows import Array
from ..errors import InvalidArgument
from ._implicit import ImplicitManifold


class Linkage(ImplicitManifold):
    """All ways in which joints can lie, some fixed, pairs of them held at given distances.

    Args:
      bars: (joint, joint, length) each; joints have any hashable names.
      fixed: where the joints that do not move are, by name, in the plane or in space.

    The points of M are the positions of the joints that move, one after the other, in the order in
    which `bars` names them (`moving`). M has dimension (joints that move) * (2 or 3) - bars and is a
    manifold for almost all lengths: not where all bars of a loop can lie on one line.
    """

    def __init__(
        self, bars: Sequence[tuple[Any, Any, float]], fixed: Mapping[Any, Sequence[float]]
    ) -> None:
        if not isinstance(fixed, Mapping) or isinstance(bars, Mapping):
            raise InvalidArgument(
                "a linkage is of bars, (joint, joint, length) each, and then of the joints that are fixed, by "
                'name: Linkage([("a", "b", 1.0), ...], {"a": (0, 0), ...})'
            )
        if not bars or not fixed:
            raise InvalidArgument("a linkage needs bars, and one joint at least that is fixed")
        places = {name: np.array(place, dtype=np.float64) for name, place in fixed.items()}
        space = len(next(iter(places.values())))
        if space not in (2, 3) or any(place.shape != (space,) for place in places.values()):
            raise InvalidArgument("fixed joints have to lie all in the plane, or all in space")
        self.moving: list[Any] = []
        for bar in bars:
            try:
                a, b, length = bar
                length = float(length)
            except (TypeError, ValueError):
                raise InvalidArgument(f"a bar is (joint, joint, length), and is {bar!r}") from None
            if a == b or not (np.isfinite(length) and length > 0):
                raise InvalidArgument(f"a bar ({a!r}, {b!r}, {length!r}): two joints, length > 0")
            self.moving += [j for j in (a, b) if j not in places and j not in self.moving]
        for a, b, _ in bars:
            if a in places and b in places:
                raise InvalidArgument(f"the bar ({a!r}, {b!r}) joins two joints that are fixed")
        d = space * len(self.moving)
        if not 1 <= d - len(bars):
            raise InvalidArgument(
                f"{len(self.moving)} joints in R^{space} have {d} coordinates; {len(bars)} bars "
                "leave nothing to move"
            )
        self._space, self._places = space, places
        self.coordinate_names = tuple(
            f"{joint}.{axis}" for joint in self.moving for axis in "xyz"[:space]
        )
        self._bars = [(a, b, float(length)) for a, b, length in bars]
        lower, upper = self._box()
        loose = [name for name in places if not any(name in bar[:2] for bar in bars)]
        if loose:
            raise InvalidArgument(
                f"no bar has the fixed joint {loose[0]!r} at an end: the bars' joints are "
                f"{', '.join(map(repr, dict.fromkeys(j for bar in bars for j in bar[:2])))}. "
                "Is it a slip of the pen? Else leave it out"
            )
        super().__init__(
            self._excess,
            self._excess_derivative,
            ambient_dimension=d,
            dimension=d - len(bars),
            bounding_box=(lower, upper),
            thread_safe=True,
        )

    def joints(self, points: Any) -> dict[Any, Array]:
        """(n, d) -> where each joint is, (n, 2 or 3), by name; the fixed ones too."""
        array = np.asarray(points, dtype=np.float64)
        found = {
            name: np.broadcast_to(p, (len(array), self._space)) for name, p in self._places.items()
        }
        for i, name in enumerate(self.moving):
            found[name] = array[:, self._columns(i)]
        return found

    def _columns(self, i: int) -> slice:
        return slice(i * self._space, (i + 1) * self._space)

    def _excess(self, x: Array) -> Array:
        """By how much squared distances are too large, over twice the length: about lengths."""
        at = self.joints(x)
        rows = [
            (((at[a] - at[b]) ** 2).sum(axis=1) - length**2) / (2 * length)
            for a, b, length in self._bars
        ]
        return np.stack(rows, axis=1)

    def _excess_derivative(self, x: Array) -> Array:
        at = self.joints(x)
        result = np.zeros((len(x), len(self._bars), x.shape[1]))
        for row, (a, b, length) in enumerate(self._bars):
            away = (at[a] - at[b]) / length
            for name, sign in ((a, 1.0), (b, -1.0)):
                if name not in self._places:
                    result[:, row, self._columns(self.moving.index(name))] = sign * away
        return result

    def _box(self) -> tuple[Array, Array]:
        """As far as bars reach from the fixed joints, by shortest chains."""
        lower = {name: place.copy() for name, place in self._places.items()}
        upper = {name: place.copy() for name, place in self._places.items()}
        infinite = np.full(self._space, np.inf)
        for _ in range(len(self.moving) + 1):
            for a, b, length in self._bars:
                for one, other in ((a, b), (b, a)):
                    if one in lower and other not in self._places:
                        low, high = lower[one] - length, upper[one] + length
                        lower[other] = np.maximum(lower.get(other, -infinite), low)
                        upper[other] = np.minimum(upper.get(other, infinite), high)
        adrift = [name for name in self.moving if name not in lower]
        if adrift:
            raise InvalidArgument(f"no chain of bars leads from a fixed joint to {adrift[0]!r}")
        corners = [np.concatenate([side[name] for name in self.moving]) for side in (lower, upper)]
        if not (corners[0] < corners[1]).all():
            raise InvalidArgument("the bars are too short to reach each other")
        return corners[0], corners[1]
