"""A few manifolds with oracles in closed form, and some given by equations.

Answers never depend on the rest of the batch: sums run over the last axis, one point at a time.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .errors import InvalidArgument, NotConverged
from .oracles import ImplicitManifold

__all__ = [
    "ProductOfCircles",
    "SpecialOrthogonal3",
    "Sphere",
    "Torus",
    "ellipsoid",
    "tanglecube",
]


def __dir__() -> list[str]:
    """What is offered here, without what it is made of."""
    return __all__


def _unit(vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Each row over its length, and where that can be done."""
    lengths = np.sqrt((vectors * vectors).sum(axis=-1, keepdims=True))
    usable = lengths[..., 0] > 1e-12
    return np.divide(vectors, lengths, where=usable[..., None], out=np.zeros_like(vectors)), usable


def _all_or_raise(points: np.ndarray, found: np.ndarray) -> np.ndarray:
    if not found.all():
        raise NotConverged(points, found)
    return points


class Torus:
    """The torus of tube radius `minor` around a circle of radius `major`: k = 2, d = 3."""

    dimension, ambient_dimension = 2, 3
    thread_safe = True

    def __init__(self, major: float = 1.0, minor: float = 0.4) -> None:
        if not 0 < minor < major:
            raise InvalidArgument(f"a torus needs 0 < minor < major, not {minor} and {major}")
        self.major, self.minor = float(major), float(minor)
        corner = np.array([major + minor, major + minor, minor]) * 1.1
        self.bounding_box = -corner, corner

    def closest_point(self, points: np.ndarray) -> np.ndarray:
        ring, on_ring = _unit(points * [1.0, 1.0, 0.0])
        tube, on_tube = _unit(points - self.major * ring)
        return _all_or_raise(self.major * ring + self.minor * tube, on_ring & on_tube)

    def tangent_basis(self, points: np.ndarray) -> np.ndarray:
        ring, _ = _unit(points * [1.0, 1.0, 0.0])
        normal, _ = _unit(points - self.major * ring)
        along = np.stack([-ring[:, 1], ring[:, 0], np.zeros(len(points))], axis=1)
        return np.stack([along, np.cross(normal, along)], axis=2)

    def local_size(self, points: np.ndarray) -> np.ndarray:
        """To the medial axis: the circle inside the tube, and the axis of revolution."""
        return np.minimum(self.minor, np.hypot(points[:, 0], points[:, 1]))


class Sphere:
    """The round k-sphere in the first k+1 coordinates of R^d; the circle for k = 1."""

    thread_safe = True

    def __init__(
        self, dimension: int = 2, ambient_dimension: int | None = None, radius: float = 1.0
    ) -> None:
        self.dimension = dimension
        self.ambient_dimension = dimension + 1 if ambient_dimension is None else ambient_dimension
        if self.ambient_dimension <= dimension or radius <= 0:
            raise InvalidArgument("a sphere needs dimension < ambient_dimension and radius > 0")
        self.radius = float(radius)
        corner = np.full(self.ambient_dimension, 1.1 * radius)
        self.bounding_box = -corner, corner

    def closest_point(self, points: np.ndarray) -> np.ndarray:
        inside = np.zeros_like(points)
        inside[:, : self.dimension + 1] = points[:, : self.dimension + 1]
        directions, found = _unit(inside)
        return _all_or_raise(self.radius * directions, found)

    def tangent_basis(self, points: np.ndarray) -> np.ndarray:
        k, d = self.dimension, self.ambient_dimension
        normal, _ = _unit(points[:, : k + 1])
        # Householder's reflection takes the last axis to +-normal, so the others to its complement.
        mirror = normal.copy()
        mirror[:, k] += np.where(normal[:, k] >= 0, 1.0, -1.0)
        mirror, _ = _unit(mirror)
        bases = np.zeros((len(points), d, k))
        bases[:, : k + 1] = np.eye(k + 1, k) - 2 * mirror[:, :, None] * mirror[:, None, :k]
        return bases

    def local_size(self, points: np.ndarray) -> np.ndarray:
        return np.full(len(points), self.radius)


class ProductOfCircles:
    """T^k as a product of circles in R^2k: for k = 2 the Clifford torus. It is flat."""

    thread_safe = True

    def __init__(self, radii: Sequence[float] = (1.0, 1.0)) -> None:
        self.radii = np.asarray(radii, dtype=float)
        if self.radii.ndim != 1 or not len(self.radii) or not (self.radii > 0).all():
            raise InvalidArgument(f"a product of circles needs positive radii, not {radii!r}")
        self.dimension = len(self.radii)
        self.ambient_dimension = 2 * self.dimension
        corner = 1.1 * np.repeat(self.radii, 2)
        self.bounding_box = -corner, corner

    def closest_point(self, points: np.ndarray) -> np.ndarray:
        directions, found = _unit(points.reshape(len(points), self.dimension, 2))
        return _all_or_raise(
            (self.radii[:, None] * directions).reshape(points.shape), found.all(axis=1)
        )

    def tangent_basis(self, points: np.ndarray) -> np.ndarray:
        directions, _ = _unit(points.reshape(len(points), self.dimension, 2))
        bases = np.zeros((len(points), self.ambient_dimension, self.dimension))
        for a in range(self.dimension):
            bases[:, 2 * a, a] = -directions[:, a, 1]
            bases[:, 2 * a + 1, a] = directions[:, a, 0]
        return bases

    def local_size(self, points: np.ndarray) -> np.ndarray:
        return np.full(len(points), self.radii.min())


class SpecialOrthogonal3:
    """SO(3), the rotations of space, as 3 x 3 matrices, row after row: k = 3, d = 9."""

    dimension, ambient_dimension = 3, 9
    thread_safe = True
    bounding_box = np.full(9, -1.0), np.full(9, 1.0)

    _GENERATORS = np.array(
        [
            [[0, 0, 0], [0, 0, -1], [0, 1, 0]],
            [[0, 0, 1], [0, 0, 0], [-1, 0, 0]],
            [[0, -1, 0], [1, 0, 0], [0, 0, 0]],
        ]
    ) / np.sqrt(2.0)

    def closest_point(self, points: np.ndarray) -> np.ndarray:
        """The nearest rotation: the polar factor, its last singular direction turned if need be."""
        u, s, vt = np.linalg.svd(points.reshape(-1, 3, 3))
        turn = np.linalg.det(u @ vt)
        u[:, :, 2] *= np.where(turn < 0, -1.0, 1.0)[:, None]
        unique = s[:, 1] + np.where(turn < 0, -1.0, 1.0) * s[:, 2] > 1e-12
        return _all_or_raise((u @ vt).reshape(-1, 9), unique)

    def tangent_basis(self, points: np.ndarray) -> np.ndarray:
        rotations = points.reshape(-1, 1, 3, 3)
        return (rotations @ self._GENERATORS).reshape(-1, 3, 9).transpose(0, 2, 1)

    def local_size(self, points: np.ndarray) -> np.ndarray:
        return np.full(len(points), np.sqrt(2.0))


class _Ellipsoid:
    """Its equation."""

    def __init__(self, squares: np.ndarray) -> None:
        self._squares = squares
        self._inner = (squares - squares.min()) / np.sqrt(squares)

    def f(self, x: np.ndarray) -> np.ndarray:
        return (x * x / self._squares).sum(axis=1, keepdims=True) - 1.0

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        return (2.0 * x / self._squares)[:, None, :]

    def local_size(self, y: np.ndarray) -> np.ndarray:
        """To the medial axis: the solid ellipsoid of semi-axes `inner`, flat in the shortest axes.

        Its nearest point to y outside is inner^2 y / (inner^2 + t), with t by Newton's method,
        which climbs to its root from zero.
        """
        inner, t = self._inner, np.zeros((len(y), 1))
        for _ in range(60):
            below = np.maximum(inner**2 + t, 1e-300)
            terms = (inner * y / below) ** 2
            excess = terms.sum(axis=1, keepdims=True) - 1.0
            slope = 2.0 * (terms / below).sum(axis=1, keepdims=True)
            t += np.where(excess > 0.0, excess / np.where(excess > 0.0, slope, 1.0), 0.0)
        off = np.where(inner > 0.0, t / np.maximum(inner**2 + t, 1e-300), 1.0)
        return np.sqrt(((off * y) ** 2).sum(axis=1))


def ellipsoid(axes: Sequence[float] = (1.0, 0.8, 0.6)) -> ImplicitManifold:
    """The ellipsoid of the given semi-axes in R^d, k = d - 1, by its equation."""
    squares = np.asarray(axes, dtype=float) ** 2
    d, by = len(squares), _Ellipsoid(squares)
    corner = 1.1 * np.sqrt(squares)
    return ImplicitManifold(
        by.f,
        by.jacobian,
        ambient_dimension=d,
        dimension=d - 1,
        bounding_box=(-corner, corner),
        local_size=by.local_size,
        thread_safe=True,
    )


def _tanglecube(x: np.ndarray) -> np.ndarray:
    return (x**4 - 5.0 * x**2).sum(axis=1, keepdims=True) + 11.8


def _tanglecube_slopes(x: np.ndarray) -> np.ndarray:
    return (4.0 * x**3 - 10.0 * x)[:, None, :]


def tanglecube() -> ImplicitManifold:
    """x^4 - 5x^2 + y^4 - 5y^2 + z^4 - 5z^2 + 11.8 = 0, a surface of genus 5."""
    corner = np.full(3, 2.5)
    return ImplicitManifold(
        _tanglecube,
        _tanglecube_slopes,
        ambient_dimension=3,
        dimension=2,
        bounding_box=(-corner, corner),
        thread_safe=True,
    )
