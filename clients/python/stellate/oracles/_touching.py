"""Walls that touch without crossing, found where solvers do not find what they have in common."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np

from .._rows import Array, Flags, apply, norms
from ..errors import OracleError

_BATCHES, _POINTS = 4, 16  # that are looked at, with points that are not found, and points of each
_STEPS = 40  # each halves the way to a point where walls touch, and what they differ by there is its square
_ZERO = 1e-9  # of the box: walls that come so near each other touch
_PARALLEL = 1e-3  # the sine between their normals there
# Of the largest values, how near walls come that are looked at; and again when so many times nearer.
_NEAR, _NEARER = 0.02, 0.25
_BESIDE = 1e-3  # of the box, how far around such a point it is looked at what lies between them
_WAYS = 8  # along the walls

Values = Callable[[tuple[int, ...], Array], Array]


class Touching:
    """Insists that two walls that matter cross where they meet.

    Args:
      values, slopes: of walls of a domain of space, by their numbers: (n, len(face)), (n, len(face), d).
      inside: sign vectors (n, walls), True where a wall is positive -> labels (n,).
      box: (lower (d,), upper (d,)) around the domain, which alone is looked at.
    """

    def __init__(
        self,
        values: Values,
        slopes: Values,
        inside: Callable[[Flags], Any],
        box: tuple[Array, Array],
    ) -> None:
        self._values, self._slopes, self._box = values, slopes, box
        self._size = float(norms(box[1] - box[0]))
        self._inside, self._batches = inside, _BATCHES
        self._cross: set[tuple[int, ...]] = set()  # pairs of walls that were seen to
        self._nearest: dict[tuple[int, ...], float] = {}  # pairs, and how near they were looked at
        self._usual: Array = np.zeros(1)  # the largest values so far

    def note_crossing(self, face: tuple[int, ...]) -> None:
        """Points were found where these walls are zero."""
        self._cross.update(itertools.combinations(sorted(face), 2))

    def insist_they_cross(self, x: Array, face: tuple[int, ...], walls: int) -> None:
        """For points x (n, d) from which no point is found where both walls of the face are zero.

        Raises: OracleError where they touch, and both bound what is meshed there.
        """
        if len(face) == 2 and len(x) and self._batches > 0:
            self._batches -= 1
            self._judge(x[:_POINTS], face, walls)

    def look(self, x: Array, values: Array) -> None:
        """At all walls' values (n, walls) at points (n, d): where two come near each other that were not
        seen to cross, and nearer than before.

        Raises: OracleError, as insist_they_cross.
        """
        within = ((self._box[0] <= x) & (x <= self._box[1])).all(axis=1)
        x, values = x[within], values[within]
        with np.errstate(invalid="ignore", divide="ignore"):
            sizes = np.abs(values)
            self._usual = np.fmax(self._usual, sizes.max(axis=0, initial=0.0))
            shares = sizes / self._usual
            rows = np.flatnonzero((shares < _NEAR).sum(axis=1) > 1)
        for row in rows:
            for pair in itertools.combinations(np.flatnonzero(shares[row] < _NEAR).tolist(), 2):
                near = float(shares[row, pair].max())
                if pair not in self._cross and near < _NEARER * self._nearest.get(pair, 1.0):
                    self._nearest[pair] = max(near, 1e-300)
                    self._judge(x[row : row + 1], pair, values.shape[1])

    def _judge(self, x: Array, face: tuple[int, ...], walls: int) -> None:
        y = self._least(x, face)
        slopes, values = self._slopes(face, y), self._values(face, y)
        with np.errstate(invalid="ignore", divide="ignore"):
            steep = norms(slopes)
            normals = slopes / steep[:, :, None]
            zero = (np.abs(values) <= _ZERO * self._size * steep).all(axis=1)
            cosine = (normals[:, 0] * normals[:, 1]).sum(axis=1)
            parallel = 1 - cosine * cosine <= _PARALLEL**2
        for row in np.flatnonzero(zero & parallel):
            if self._both_matter(y[row], normals[row, 0], face, walls):
                raise OracleError(
                    f"walls {face[0]} and {face[1]} touch, near {y[row].tolist()}: both end there what is meshed, "
                    "which is thinner than any simplex beside that point. Move one of them, so that they cross at "
                    "an angle or stay apart by more than a fiftieth of epsilon",
                    "ORACLE_BAD_CONORMAL",
                )

    def _least(self, x: Array, face: tuple[int, ...]) -> Array:
        """By Newton's method to where both walls are zero, whatever their angle."""
        y = np.array(x)
        for _ in range(_STEPS):
            back = np.linalg.pinv(np.nan_to_num(self._slopes(face, y)), rcond=1e-14)
            step = -apply(back, np.nan_to_num(self._values(face, y)))
            longest = 0.1 * self._size / np.maximum(norms(step), 1e-300)
            y = y + step * np.minimum(1.0, longest)[:, None]
        return y

    def _both_matter(self, at: Array, normal: Array, face: tuple[int, ...], walls: int) -> bool:
        """Whether what lies on either side of each wall, and between them, has different labels."""
        d = len(at)
        ways = np.random.default_rng(1).standard_normal((_WAYS, d))
        ways -= (ways @ normal)[:, None] * normal
        size = norms(ways)[:, None]
        beside = at + _BESIDE * self._size * np.divide(
            ways, size, out=np.zeros_like(ways), where=size > 0
        )
        slopes = (self._slopes(face, beside) * normal).sum(axis=2)
        with np.errstate(invalid="ignore", divide="ignore"):
            zeros = np.sort(-self._values(face, beside) / slopes, axis=1)
        far = _BESIDE * self._size + zeros[:, 1] - zeros[:, 0]
        levels = np.stack([zeros[:, 0] - far, zeros.mean(axis=1), zeros[:, 1] + far])
        looked = (beside + levels[:, :, None] * normal).reshape(-1, d)
        looked = looked[np.isfinite(looked).all(axis=1)]
        if not len(looked):
            return False
        signs = self._values(tuple(range(walls)), looked) > 0
        labels = {tuple(row[list(face)]): self._inside(row[None])[0] for row in signs}
        return all(
            any(labels.get(_flipped(one, i), label) != label for one, label in labels.items())
            for i in (0, 1)
        )


def _flipped(signs: tuple[bool, ...], i: int) -> tuple[bool, ...]:
    return tuple(sign != (i == j) for j, sign in enumerate(signs))
