"""What is measured on a mesh: volumes, normals, curvatures.

Vertices lie on M, and the mesh is within O(epsilon^2) of it. So volumes, and integrals of smooth
functions, are as near: half of epsilon is a quarter of the error. Normals of simplices are within
O(epsilon) of M's nearby.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ._complex import Complex
from ._faces import facets_in_one
from ._files.surface import boundary
from ._wire.orientation import Orientation
from .errors import InvalidArgument
from .oracle import CheckedOracle

if TYPE_CHECKING:
    from ._mesh import Mesh

_STEP = 6e-6  # of differences, of the mesh's size: about the cube root of rounding


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
            f"R^{mesh.ambient_dimension}"
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


@dataclasses.dataclass(frozen=True, eq=False)
class Curvature:
    """How a hypersurface bends at the points of a mesh.

    Positive where it bends away from its normal: those of a sphere of radius r are 1 / r.

    Attributes:
      principal: (n, k), ascending in each row.
    """

    principal: np.ndarray

    @property
    def mean(self) -> np.ndarray:
        """(n,): the mean of the principal curvatures."""
        return np.asarray(self.principal.mean(axis=1))

    @property
    def gauss(self) -> np.ndarray:
        """(n,): their product."""
        return np.asarray(self.principal.prod(axis=1))


def curvature(mesh: Mesh, oracle: Any) -> Curvature:
    """At the points of a hypersurface f = 0, from f's derivatives; see Mesh.curvature."""
    checked = CheckedOracle(oracle)
    d = mesh.ambient_dimension
    if not checked.has_jacobian or mesh.dimension != d - 1 or checked.ambient_dimension != d:
        raise InvalidArgument(
            "curvature is of a hypersurface and the oracle of its one equation, as ImplicitManifold "
            "and SignedDistance are; of others Mesh.normals has what is known"
        )
    slopes = _gradients(checked, mesh.points)
    steep = np.linalg.norm(slopes, axis=1)
    if not (steep > 0).all():
        raise InvalidArgument(
            f"the equation's gradient is 0 at {mesh.points[int(steep.argmin())].tolist()}"
        )
    unit = slopes / steep[:, None]
    step = _STEP * float(np.linalg.norm(np.ptp(mesh.points, axis=0)))
    columns = [
        (_gradients(checked, mesh.points + v) - _gradients(checked, mesh.points - v)) / (2 * step)
        for v in step * np.eye(d)
    ]
    bend = np.stack(columns, axis=2)
    bend = (bend + bend.transpose(0, 2, 1)) / 2
    along = np.linalg.svd(unit[:, None, :])[2][:, 1:].transpose(0, 2, 1)  # (n, d, k), across `unit`
    within = along.transpose(0, 2, 1) @ bend @ along / steep[:, None, None]
    principal = np.linalg.eigvalsh(within)
    return Curvature(principal if _points_outwards(mesh, unit) else -principal[:, ::-1])


def _gradients(oracle: CheckedOracle, points: np.ndarray) -> np.ndarray:
    """(n, d)"""
    slopes = oracle.jacobians(np.ascontiguousarray(points))
    if slopes.shape[1] != 1:
        raise InvalidArgument(f"curvature is of one equation, and the oracle has {slopes.shape[1]}")
    return slopes[:, 0]


def _points_outwards(mesh: Mesh, unit: np.ndarray) -> bool:
    """Whether vectors at the points are on the side of the mesh's normals; so if it has none."""
    if mesh.oriented_simplices() is None:
        return True
    at = unit[mesh.simplices].sum(axis=1)
    return bool(((normals(mesh) * at).sum(axis=1)).sum() >= 0)


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
