"""Where points of space are on a mesh, and its Laplacian."""

from __future__ import annotations

import dataclasses
import itertools
from typing import TYPE_CHECKING, Any

import numpy as np

from ._point_sets import as_points, tree_of
from .errors import InvalidArgument

if TYPE_CHECKING:
    from ._complex import Complex

_AT_A_TIME = 1 << 18  # pairs of a point and a simplex, which bounds memory


@dataclasses.dataclass(frozen=True, eq=False)
class Located:
    """The nearest points of a mesh to q given ones.

    Attributes:
      simplices: (q,) int64: the row of the simplex that each is on, the first if there are several.
      weights: (q, k+1): its barycentric coordinates, one for each vertex of that row; none is
        negative, and they add up to 1.
      points: (q, d): itself.
      distances: (q,): how far it is from the given one.
    """

    simplices: np.ndarray
    weights: np.ndarray
    points: np.ndarray
    distances: np.ndarray


def locate(mesh: Complex, points: Any) -> Located:
    """See Mesh.locate."""
    given = as_points(points, "points")
    if given.shape[1] != mesh.ambient_dimension:
        raise InvalidArgument(
            f"points have {given.shape[1]} coordinates, and those of the mesh {mesh.ambient_dimension}"
        )
    if not len(mesh.simplices):
        raise InvalidArgument("the mesh has no simplices to find points on")
    corners = mesh.points[mesh.simplices]
    middles = corners.mean(axis=1)
    # A simplex lies in the ball around its barycentre through its farthest vertex, so none is nearer than
    # its barycentre less that radius.
    radius = float(np.linalg.norm(corners - middles[:, None], axis=2).max())
    tree = tree_of(middles)
    _, first = tree.query(given)
    bound = _nearest(given, corners[first])[1] + radius
    found = Located(
        np.empty(len(given), dtype=np.int64),
        np.empty((len(given), corners.shape[1])),
        np.empty(given.shape),
        np.empty(len(given)),
    )
    # A tree rounds its sums: a few units in the last place must not lose the nearest simplex.
    counts = tree.query_ball_point(given, bound * (1 + 1e-12), return_length=True)
    for rows in _pieces(counts):
        near = tree.query_ball_point(given[rows], bound[rows] * (1 + 1e-12), return_sorted=True)
        _settle(found, rows, given, corners, near)
    return found


def _pieces(counts: np.ndarray) -> list[slice]:
    """Runs of rows, of some _AT_A_TIME candidates each."""
    ends = np.cumsum(counts) // _AT_A_TIME
    starts = np.flatnonzero(np.diff(ends, prepend=-1))
    return [slice(a, b) for a, b in zip(starts, [*starts[1:], len(counts)])]


def _settle(
    found: Located, rows: slice, given: np.ndarray, corners: np.ndarray, near: np.ndarray
) -> None:
    lengths = np.fromiter(map(len, near), dtype=np.int64, count=len(near))
    candidates = np.concatenate([np.asarray(ids, dtype=np.int64) for ids in near])
    which = np.repeat(np.arange(len(near)), lengths)
    weights, distances = _nearest(given[rows][which], corners[candidates])
    order = np.lexsort((candidates, distances, which))
    best = order[np.searchsorted(which[order], np.arange(len(near)))]
    found.simplices[rows] = candidates[best]
    found.weights[rows] = weights[best]
    found.points[rows] = np.einsum("qc,qcd->qd", weights[best], corners[candidates[best]])
    found.distances[rows] = distances[best]


def _nearest(points: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of (q, d) points and (q, k+1, d) simplices: barycentric coordinates of the nearest, the distances.

    The nearest point of a simplex is that of the hull of one of its faces, and lies in that face.
    """
    q, count, _ = corners.shape
    weights = np.zeros((q, count))
    distances = np.full(q, np.inf)
    for size in range(1, count + 1):
        for some in itertools.combinations(range(count), size):
            chosen = np.array(some)
            shares = _shares(points, corners[:, chosen])
            foot = (shares[:, :, None] * corners[:, chosen]).sum(axis=1)
            far = np.linalg.norm(points - foot, axis=1)
            better = (shares >= 0).all(axis=1) & (far < distances)
            weights[better] = 0
            weights[np.ix_(better, chosen)] = shares[better]
            distances[better] = far[better]
    return weights, distances


def _shares(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(q, c): barycentric coordinates of the feet of perpendiculars on the hulls of the corners."""
    sides = corners[:, 1:] - corners[:, :1]
    if not sides.shape[1]:
        return np.ones((len(points), 1))
    # Summed row by row, not by BLAS: on a shared face neighbours have to get the same bits.
    gram = (sides[:, :, None] * sides[:, None]).sum(axis=3)
    right = (sides * (points - corners[:, 0])[:, None]).sum(axis=2)
    flat = np.linalg.matrix_rank(gram) < gram.shape[1]  # its hull is that of a face of it
    gram[flat] = np.eye(gram.shape[1])
    inner = np.linalg.solve(gram, right[:, :, None])[:, :, 0]
    inner[flat] = -1
    return np.column_stack([1 - inner.sum(axis=1), inner])


def laplacian(mesh: Complex) -> tuple[Any, Any]:
    """See Mesh.laplacian."""
    try:
        from scipy import sparse
    except ImportError:
        raise InvalidArgument(
            "matrices are scipy's, and there is no scipy: apt-get install python3-scipy, or "
            "pip install scipy"
        ) from None
    from ._measures import point_volumes, volumes

    corners = mesh.points[mesh.simplices]
    sides = corners[:, 1:] - corners[:, :1]
    gram = sides @ sides.transpose(0, 2, 1)
    flat = np.linalg.matrix_rank(gram, hermitian=True) < gram.shape[1]
    if flat.any():
        raise InvalidArgument(f"simplex {int(flat.argmax())} is flat, and has no gradients")
    inverse = np.linalg.inv(gram)  # of gradients of the barycentric coordinates 1 to k
    spread = np.concatenate([-np.ones((1, gram.shape[1])), np.eye(gram.shape[1])])
    local = spread @ inverse @ spread.T * volumes(mesh.points, mesh.simplices)[:, None, None]
    count, size = len(mesh.points), corners.shape[1]
    rows = np.repeat(mesh.simplices, size, axis=1).ravel()
    columns = np.tile(mesh.simplices, (1, size)).ravel()
    stiffness = sparse.coo_matrix((local.ravel(), (rows, columns)), shape=(count, count)).tocsr()
    return stiffness, sparse.diags(point_volumes(mesh.points, mesh.simplices)).tocsr()
