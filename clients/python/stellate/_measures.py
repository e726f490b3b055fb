"""What is measured on a mesh: volumes, normals, Minkowski functionals.

Vertices lie on M, and the mesh is within O(epsilon^2) of it. So volumes, and integrals of smooth
functions, are as near: half of epsilon is a quarter of the error. Normals of simplices are within
O(epsilon) of M's nearby.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import TYPE_CHECKING

import numpy as np

from ._complex import Complex
from ._faces import facets_in_one
from ._files.surface import boundary
from ._wire.orientation import Orientation
from .errors import InvalidArgument

if TYPE_CHECKING:
    from ._mesh import Mesh


def volumes(points: np.ndarray, simplices: np.ndarray) -> np.ndarray:
    """(m,): the k-volume of each simplex, its length where k = 1, its area where k = 2."""
    sides = _sides(points, simplices)
    gram = sides @ sides.transpose(0, 2, 1)
    return np.sqrt(np.maximum(np.linalg.det(gram), 0)) / math.factorial(sides.shape[1])


def point_volumes(points: np.ndarray, simplices: np.ndarray) -> np.ndarray:
    """(n,): of each point a (k+1)-th part of the volume of the simplices around it."""
    shares = np.repeat(volumes(points, simplices) / simplices.shape[1], simplices.shape[1])
    return np.bincount(simplices.ravel(), weights=shares, minlength=len(points))


def euler(simplices: np.ndarray) -> int:
    """The Euler characteristic: of the numbers of faces of each dimension, with signs."""
    k = simplices.shape[1] - 1
    total = 0
    for size in range(1, k + 2):
        columns = itertools.combinations(range(k + 1), size)
        every = np.concatenate([simplices[:, list(chosen)] for chosen in columns])
        total += (-1) ** (size - 1) * len(np.unique(every, axis=0))
    return total


def normals(mesh: Complex) -> np.ndarray:
    """(m, d), unit vectors across the simplices of a hypersurface; see Mesh.normals."""
    if mesh.dimension != mesh.ambient_dimension - 1:
        raise InvalidArgument(
            f"normals are of hypersurfaces: this mesh of dimension {mesh.dimension} in "
            f"R^{mesh.ambient_dimension} has a {mesh.ambient_dimension - mesh.dimension}-dimensional "
            "space of them at each point"
            + ("; its boundary_mesh() has some" if mesh.dimension == mesh.ambient_dimension else "")
        )
    sides = _sides(mesh.points, _oriented(mesh))
    across = [(-1) ** i * np.linalg.det(np.delete(sides, i, axis=2)) for i in range(sides.shape[2])]
    vectors = np.stack(across, axis=1)
    lengths = np.linalg.norm(vectors, axis=1)
    return np.asarray(vectors / np.where(lengths > 0, lengths, 1)[:, None])


def enclosed_volume(mesh: Complex) -> float:
    """Of a closed hypersurface; see Mesh.enclosed_volume."""
    if mesh.dimension != mesh.ambient_dimension - 1:
        raise InvalidArgument(
            f"hypersurfaces enclose volumes: this mesh has dimension {mesh.dimension} in "
            f"R^{mesh.ambient_dimension}, and a `volume` of its own"
        )
    if len(facets_in_one(mesh.simplices)):
        raise InvalidArgument("the mesh has a boundary, and encloses no volume")
    middle = mesh.points.mean(axis=0)  # from near, so that less is rounded
    cones = np.linalg.det(mesh.points[_oriented(mesh)] - middle)
    return float(cones.sum()) / math.factorial(mesh.ambient_dimension)


def boundary_of(mesh: Complex) -> tuple[np.ndarray, Orientation | None]:
    """The facets in one simplex alone, in order, and how the mesh orients them, if it can be."""
    oriented = mesh.oriented_simplices()
    if oriented is None or mesh.dimension < 2:
        return facets_in_one(mesh.simplices), None
    facets = boundary(oriented)
    ascending = np.sort(facets, axis=1)
    order = np.lexsort(ascending.T[::-1])
    return ascending[order], Orientation.of(_is_odd(facets[order]))


@dataclasses.dataclass(frozen=True)
class Minkowski:
    """The Minkowski functionals of a solid of space.

    Attributes:
      volume: of the solid.
      area: of its boundary.
      mean_curvature: the integral of the mean curvature (k1 + k2) / 2 over the boundary, edges included:
        half of the lengths times the angles that the normal turns by. Of a ball of radius r 4 pi r, of a
        convex solid 2 pi times its mean width.
      euler: the Euler characteristic of the solid.
    """

    volume: float
    area: float
    mean_curvature: float
    euler: int

    @property
    def quermassintegrals(self) -> tuple[float, float, float, float]:
        """W0 to W3, the coefficients of Steiner's formula: V(r) = W0 + 3 W1 r + 3 W2 r^2 + W3 r^3."""
        return (
            self.volume, self.area / 3, self.mean_curvature / 3, 4 * math.pi * self.euler / 3,
        )  # fmt: skip


def minkowski(mesh: Mesh) -> Minkowski:
    """See Mesh.minkowski."""
    if mesh.ambient_dimension != 3 or mesh.dimension not in (2, 3):
        raise InvalidArgument(
            "Minkowski functionals are of solids of space, and of closed surfaces there: this mesh has "
            f"dimension {mesh.dimension} in R^{mesh.ambient_dimension}"
        )
    surface = mesh.boundary_mesh() if mesh.dimension == 3 else mesh
    # A closed surface is of twice the characteristic of what it bounds.
    of_solid = euler(mesh.simplices) if mesh.dimension == 3 else euler(mesh.simplices) // 2
    return Minkowski(enclosed_volume(surface), surface.volume, _turning(surface) / 2, of_solid)


def _turning(surface: Complex) -> float:
    """The sum of the lengths of edges times the angles between the normals beside them."""
    rows, across = _oriented(surface), normals(surface)
    ends = np.concatenate([rows[:, [0, 1]], rows[:, [1, 2]], rows[:, [2, 0]]])
    owner = np.tile(np.arange(len(rows)), 3)
    ascending = np.sort(ends, axis=1)
    order = np.lexsort(ascending.T[::-1])
    pairs = ascending[order].reshape(-1, 2, 2) if len(order) % 2 == 0 else np.empty((1, 2, 2))
    same = (pairs[:, 0] == pairs[:, 1]).all(axis=1)
    if not same.all() or (pairs[1:, 0] == pairs[:-1, 0]).all(axis=1).any():
        raise InvalidArgument(
            "an edge of the surface is not between two triangles alone: the surface ends there, or "
            "parts meet along it, and its turning is not known"
        )
    first, second = owner[order].reshape(-1, 2).T
    # The edge as its first triangle runs along it: around it the normal turns by the angle, positive
    # where the surface is convex.
    way = surface.points[ends[order][::2, 1]] - surface.points[ends[order][::2, 0]]
    lengths = np.linalg.norm(way, axis=1)
    sine = (np.cross(across[first], across[second]) * way).sum(axis=1) / np.where(
        lengths > 0, lengths, 1
    )
    cosine = (across[first] * across[second]).sum(axis=1)
    return float((lengths * np.arctan2(sine, cosine)).sum())


def _sides(points: np.ndarray, simplices: np.ndarray) -> np.ndarray:
    """(m, k, d): from the first corner of each simplex to the others."""
    corners = points[simplices]
    return np.asarray(corners[:, 1:] - corners[:, :1])


def _oriented(mesh: Complex) -> np.ndarray:
    oriented = mesh.oriented_simplices()
    if oriented is None:
        raise InvalidArgument("the mesh is not orientable: it has no normals that agree")
    return oriented


def _is_odd(rows: np.ndarray) -> np.ndarray:
    """Whether it takes an odd number of exchanges to sort each row."""
    pairs = itertools.combinations(range(rows.shape[1]), 2)
    return np.asarray(sum((rows[:, i] > rows[:, j]).astype(int) for i, j in pairs) % 2 == 1)
