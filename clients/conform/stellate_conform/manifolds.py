"""The manifolds that the kit asks about, and the right answers."""

from __future__ import annotations

from typing import Any, Optional

import numpy as np
from stellate import manifolds

# Rounding of a handful of operations on numbers of about 1, with a thousandfold to spare: languages
# differ in hypot and in fused multiplications.
_TOLERANCE = 1e-12

Found = Optional[np.ndarray]


class Circle:
    """The unit circle of the first two coordinates of R^d."""

    dimension = 1

    def __init__(self, ambient_dimension: int) -> None:
        self.ambient_dimension = ambient_dimension

    def closest_point(self, x: np.ndarray) -> np.ndarray:
        p = np.zeros_like(x)
        p[:, :2] = x[:, :2] / np.linalg.norm(x[:, :2], axis=1, keepdims=True)
        return p

    def tangent_basis(self, p: np.ndarray) -> np.ndarray:
        bases = np.zeros((*p.shape, 1))
        bases[:, 0, 0], bases[:, 1, 0] = -p[:, 1], p[:, 0]
        return bases


class Half(manifolds.Torus):
    """A torus whose closest point is not found from where the first coordinate is negative."""

    def found(self, x: np.ndarray) -> Found:
        return x[:, 0] >= 0


class Sphere:
    """The unit sphere of R^3, which meets lines, and has the size 1 + z / 2 at (x, y, z)."""

    dimension, ambient_dimension = 2, 3

    def closest_point(self, x: np.ndarray) -> np.ndarray:
        return x / np.linalg.norm(x, axis=1, keepdims=True)

    def tangent_basis(self, p: np.ndarray) -> np.ndarray:
        return np.linalg.svd(p[:, None, :])[2][:, 1:, :].transpose(0, 2, 1)

    def local_size(self, p: np.ndarray) -> np.ndarray:
        return 1 + p[:, 2] / 2

    def intersect_flat(
        self, c: np.ndarray, bases: np.ndarray, radii: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        along = np.cross(bases[:, :, 0], bases[:, :, 1])
        middle = (c * along).sum(axis=1)
        root = middle * middle - (c * c).sum(axis=1) + 1
        step = np.sqrt(np.maximum(root, 0))
        near = np.where(np.abs(step - middle) < np.abs(step + middle), step, -step) - middle
        return c + near[:, None] * along, (root >= 0) & (np.abs(near) <= radii)


class Lune(Sphere):
    """The quarter of the unit sphere of R^3 where z and y are not negative: its two walls."""

    walls = 2
    _AXES = (2, 1)  # a wall's value is this coordinate

    def face_point(self, x: np.ndarray, face: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
        """The points, and where there is a nearest one."""
        flat = x.copy()
        flat[:, [self._AXES[wall] for wall in face]] = 0
        length = np.linalg.norm(flat, axis=1)
        return flat / np.where(length > 0, length, 1)[:, None], length > 0

    def clearances(self, p: np.ndarray) -> np.ndarray:
        return p[:, self._AXES]

    def conormals(self, p: np.ndarray, face: tuple[int, ...]) -> np.ndarray:
        outwards = -np.eye(3)[[self._AXES[wall] for wall in face]]
        return np.broadcast_to(outwards, (len(p), *outwards.shape))


def make(name: str) -> Any:
    """The manifold that a line `serve MESH NAME` is about."""
    if name.startswith("circle:"):
        return Circle(int(name.removeprefix("circle:")))
    if name == "clifford":
        return manifolds.ProductOfCircles()
    kinds = {"half": Half, "sphere": Sphere, "lune": Lune, "so3": manifolds.SpecialOrthogonal3}
    return kinds.get(name, manifolds.Torus)()


def wrong_points(right: np.ndarray, found: Found, said: np.ndarray, said_found: Found) -> str:
    """What is wrong with the points of an answer, "" if nothing is."""
    ours = np.ones(len(right), bool) if found is None else found
    theirs = np.ones(len(right), bool) if said_found is None else said_found
    if (ours != theirs).any():
        row = int(np.flatnonzero(ours != theirs)[0])
        return f"row {row} is{'' if theirs[row] else ' not'} found"
    off = np.abs(said - right).max(axis=1, initial=0)
    bad = np.flatnonzero(ours & ~(off <= _TOLERANCE))
    if len(bad):
        return f"row {bad[0]} is {said[bad[0]][:4]}, not {right[bad[0]][:4]}"
    return ""


def wrong_tangents(right: np.ndarray, found: Found, said: np.ndarray) -> str:
    """The same of tangent bases, [n, d, k], which may be any orthonormal ones."""
    for row in range(len(right)):
        if found is not None and not found[row]:
            continue
        k = right.shape[2]
        gram = said[row].T @ said[row]
        if not (np.abs(gram - np.eye(k)) <= _TOLERANCE).all():
            return f"row {row} is not orthonormal: {np.array2string(gram, precision=3)}"
        off = said[row] - right[row] @ (right[row].T @ said[row])
        if not (np.abs(off) <= _TOLERANCE).all():
            return f"row {row} spans another space, or is laid out otherwise than [n, d, k]"
    return ""


def wrong_values(right: np.ndarray, found: Found, said: np.ndarray) -> str:
    """The same of sizes, [n], of clearances, [n, walls], and of conormals, [n, walls, d]."""
    ours = np.ones(len(right), bool) if found is None else found
    near = (np.abs(said - right) <= _TOLERANCE).reshape(len(right), -1).all(axis=1)
    bad = np.flatnonzero(ours & ~near)
    if not len(bad):
        return ""
    theirs, wanted = (array[bad[0]].tolist() for array in (said, right))
    return f"row {bad[0]} is {theirs}, not {wanted}"
