"""How a mesh bends: its second fundamental form, in any codimension.

There are three sources; the best one is taken. An oracle with a `jacobian` has equations f = 0, and
the form is -J^+ D^2 f, along M. Any other oracle has closest points: the second derivative of
t -> closest_point(x + t u) at 0, across M, is the form's value II(u, u). Without an oracle a polynomial
of degree three is fitted to the points near by (F. Cazals and M. Pouget, "Estimating differential
quantities using polynomial fitting of osculating jets", 2005), whose second derivatives are right to
O(epsilon^2).
"""

from __future__ import annotations

import dataclasses
import itertools
from typing import TYPE_CHECKING, Any

import numpy as np

from ._measures import normals
from .errors import InvalidArgument
from .oracle import CheckedOracle

if TYPE_CHECKING:
    from ._mesh import Mesh

_STEP = 6e-6  # of differences of a Jacobian, of the mesh's size: about the cube root of rounding
_SHARE = 0.02  # of an edge: the steps between closest points, whose second differences are taken
_AT_A_TIME = 1 << 12  # points, which bounds memory


@dataclasses.dataclass(frozen=True, eq=False)
class Curvature:
    """How a manifold bends at the points of a mesh. Points in no simplex have NaN if a fit is made.

    Attributes:
      tangents: (n, d, k): orthonormal columns that span the tangent space at each point.
      second: (n, k, k, d): the second fundamental form in that basis. II(u, v) is the part across M of
        how v turns along u: a vector normal to M, towards the side that M bends to.
      normals: (n, d), of hypersurfaces whose sides are known: outwards where closed; else None.
    """

    tangents: np.ndarray
    second: np.ndarray
    normals: np.ndarray | None

    @property
    def principal(self) -> np.ndarray:
        """(n, k), ascending in each row: of a hypersurface, against its normals.

        Positive where it bends away from its normal: those of a sphere of radius r are 1 / r.
        Raises: InvalidArgument in other codimensions, and where sides are not known.
        """
        if self.normals is None:
            raise InvalidArgument(
                "principal curvatures are of hypersurfaces that have two sides; of others `second`, "
                "`mean_vector` and `scalar` say how they bend"
            )
        return np.asarray(_eigenvalues(-np.einsum("nijd,nd->nij", self.second, self.normals)))

    @property
    def mean_vector(self) -> np.ndarray:
        """(n, d): the mean of II(u, u) over the unit tangents u, in any codimension.

        Volume shrinks fastest where M moves along it: of a sphere of radius r it is -normal / r.
        """
        return np.asarray(np.einsum("niid->nd", self.second) / self.second.shape[1])

    @property
    def mean(self) -> np.ndarray:
        """(n,): of a hypersurface the mean of the principal curvatures; else the length of `mean_vector`."""
        if self.normals is None:
            return np.asarray(np.linalg.norm(self.mean_vector, axis=1))
        return np.asarray(-(self.mean_vector * self.normals).sum(axis=1))

    @property
    def scalar(self) -> np.ndarray:
        """(n,): the scalar curvature, of M's own metric, by Gauss's equation: of a k-sphere k (k - 1) / r^2."""
        trace = np.einsum("niid->nd", self.second)
        return np.asarray((trace**2).sum(axis=1) - (self.second**2).sum(axis=(1, 2, 3)))

    @property
    def gauss(self) -> np.ndarray:
        """(n,): of a surface in any R^d Gauss's curvature; of a hypersurface the principal ones' product.

        Raises: InvalidArgument for others, which have `scalar`.
        """
        if self.second.shape[1] == 2:
            return self.scalar / 2
        return np.asarray(self.principal.prod(axis=1))


def curvature(mesh: Mesh, oracle: Any = None) -> Curvature:
    """See Mesh.curvature."""
    k, d = mesh.dimension, mesh.ambient_dimension
    if not 1 <= k < d:
        raise InvalidArgument(
            f"curvature is of curves, surfaces and their likes below R^{d}'s own dimension, and the mesh "
            f"has dimension {k}: of a solid's surface boundary_mesh().curvature() says it"
        )
    if not len(mesh.simplices):
        raise InvalidArgument("the mesh has no simplices, and does not bend")
    if oracle is None:
        tangents, second = _fitted(mesh)
        return Curvature(tangents, second, _sides(mesh, tangents, None))
    checked = CheckedOracle(oracle)
    if checked.ambient_dimension != d or checked.dimension != k:
        raise InvalidArgument(
            f"the oracle is of dimension {checked.dimension} in R^{checked.ambient_dimension}, and the "
            f"mesh of dimension {k} in R^{d}; without an oracle curvature() goes by the points alone"
        )
    slopes = None
    if checked.has_jacobian:
        tangents, second, slopes = _of_equations(mesh, checked)
    else:
        tangents, second = _of_closest_points(mesh, checked)
    return Curvature(tangents, second, _sides(mesh, tangents, slopes))


def _of_equations(mesh: Mesh, oracle: CheckedOracle) -> tuple[np.ndarray, np.ndarray, Any]:
    """Tangents, form, and of one equation its unit gradients."""
    points, k, d = mesh.points, mesh.dimension, mesh.ambient_dimension
    slopes = oracle.jacobians(np.ascontiguousarray(points))
    if slopes.shape[1] < d - k:
        raise InvalidArgument(f"{d - k} equations are needed, and the oracle has {slopes.shape[1]}")
    left, steep, across = np.linalg.svd(slopes, full_matrices=True)
    least = steep[:, d - k - 1]
    if not (least > 0).all():
        where = points[int(least.argmin())].tolist()
        what = (
            "gradient is 0" if d - k == slopes.shape[1] == 1 else "gradients depend on each other"
        )
        raise InvalidArgument(f"the equation's {what} at {where}")
    tangents = across[:, d - k :].transpose(0, 2, 1)
    step = _STEP * float(np.linalg.norm(np.ptp(points, axis=0)))
    # Rank d - k exactly on M: what is beyond it, of equations that depend on each other, is rounding.
    onto = across[:, : d - k].transpose(0, 2, 1) / steep[:, None, : d - k]
    onto = onto @ left[:, :, : d - k].transpose(0, 2, 1)
    second = np.empty((len(points), k, k, d))
    for i in range(k):
        way = step * tangents[:, :, i]
        change = (oracle.jacobians(points + way) - oracle.jacobians(points - way)) / (2 * step)
        second[:, i] = -(onto @ change @ tangents).transpose(0, 2, 1)
    second = (second + second.transpose(0, 2, 1, 3)) / 2
    unit = slopes[:, 0] / np.linalg.norm(slopes[:, 0], axis=1)[:, None] if d - k == 1 else None
    return tangents, second, unit


def _of_closest_points(mesh: Mesh, oracle: CheckedOracle) -> tuple[np.ndarray, np.ndarray]:
    points, k, d = np.ascontiguousarray(mesh.points), mesh.dimension, mesh.ambient_dimension
    edges = points[mesh.simplices[:, 0]] - points[mesh.simplices[:, 1]]
    step = _SHARE * float(np.median(np.linalg.norm(edges, axis=1)))

    def nearest(queries: np.ndarray) -> np.ndarray:
        answers, found = oracle.closest_points(np.ascontiguousarray(queries))
        if not found.all():
            raise InvalidArgument(
                f"the oracle has no closest point for {queries[int((~found).argmax())].tolist()}"
            )
        return answers

    # The derivative of the closest point is the projection onto the tangent space.
    columns = [(nearest(points + v) - nearest(points - v)) / (2 * step) for v in step * np.eye(d)]
    flat = np.stack(columns, axis=2)
    tangents = np.linalg.eigh((flat + flat.transpose(0, 2, 1)) / 2)[1][:, :, d - k :]
    middle = nearest(points)

    def along(ways: np.ndarray) -> np.ndarray:
        bend = (
            nearest(points + step * ways) + nearest(points - step * ways) - 2 * middle
        ) / step**2
        return _across(bend, tangents)

    second = np.empty((len(points), k, k, d))
    for i in range(k):
        second[:, i, i] = along(tangents[:, :, i])
    for i, j in itertools.combinations(range(k), 2):
        both = along((tangents[:, :, i] + tangents[:, :, j]) / 2**0.5)
        second[:, i, j] = second[:, j, i] = both - (second[:, i, i] + second[:, j, j]) / 2
    return tangents, second


def _across(vectors: np.ndarray, tangents: np.ndarray) -> np.ndarray:
    """(n, d): the parts normal to the tangents."""
    inner = np.einsum("ndk,nd->nk", tangents, vectors)
    return np.asarray(vectors - np.einsum("ndk,nk->nd", tangents, inner))


def _fitted(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """From the points within two edges of each, or more where these are too few."""
    n, k, d = len(mesh.points), mesh.dimension, mesh.ambient_dimension
    tangents, second = np.full((n, d, k), np.nan), np.full((n, k, k, d), np.nan)
    powers = _powers(k)
    around = _neighbours(mesh, len(powers))
    counts = np.diff(around.indptr)
    if len(used := np.flatnonzero(counts)) and counts[used].min() < len(powers):
        where = int(used[counts[used].argmin()])
        raise InvalidArgument(
            f"vertex {where} hangs together with {counts[where]} others, and a fit takes {len(powers)}: "
            "give the oracle, or mesh finer"
        )
    order = used[np.argsort(counts[used], kind="stable")]
    for some in (order[i : i + _AT_A_TIME] for i in range(0, len(order), _AT_A_TIME)):
        most = int(counts[some].max())
        slots = around.indptr[some][:, None] + np.arange(most)
        there = np.arange(most) < counts[some][:, None]
        near = around.indices[np.where(there, slots, 0)]
        offsets = np.where(there[:, :, None], mesh.points[near] - mesh.points[some][:, None], 0)
        tangents[some], second[some] = _fit(offsets, powers, k)
    return tangents, second


def _powers(k: int) -> list[tuple[int, ...]]:
    """Of the monomials of degree one to three in k variables, the variables of each."""
    return [
        chosen
        for degree in (1, 2, 3)
        for chosen in itertools.combinations_with_replacement(range(k), degree)
    ]


def _neighbours(mesh: Mesh, unknowns: int) -> Any:
    """A sparse matrix whose rows have the neighbours of each point: within two edges, or within as many
    as it takes for half as many again as there are unknowns."""
    try:
        from scipy import sparse
    except ImportError:
        raise InvalidArgument(
            "a fit takes scipy, and there is none: apt-get install python3-scipy, pip install scipy, or "
            "give the oracle"
        ) from None
    n, k = len(mesh.points), mesh.dimension
    pairs = np.concatenate([mesh.simplices[:, c] for c in itertools.combinations(range(k + 1), 2)])
    ones = np.ones(len(pairs), dtype=np.int8)
    one = sparse.coo_matrix((ones, (pairs[:, 0], pairs[:, 1])), shape=(n, n)).tocsr()
    one = ((one + one.T + sparse.eye(n, dtype=np.int8)) > 0).astype(np.int32).tocsr()
    ring = ((one @ one) > 0).astype(np.int32).tocsr()
    used = np.zeros(n, dtype=bool)
    used[mesh.simplices] = True
    while True:
        counts = np.diff(ring.indptr) - 1
        few = used & (2 * counts < 3 * unknowns)
        if not few.any():
            break
        rows = sparse.diags(few.astype(np.int32)).tocsr()
        grown = ((ring + rows @ ring @ one) > 0).astype(np.int32).tocsr()
        if grown.nnz == ring.nnz:  # components too small
            break
        ring = grown
    ring = ring - sparse.eye(n, dtype=np.int32)
    ring = sparse.diags(used.astype(np.int32)) @ ring
    ring.eliminate_zeros()
    return ring.tocsr()


def _fit(
    offsets: np.ndarray, powers: list[tuple[int, ...]], k: int
) -> tuple[np.ndarray, np.ndarray]:
    """Tangents and form at the origin of a graph through it, least squares to the offsets (n, q, d)."""
    d = offsets.shape[2]
    size = np.sqrt((offsets**2).sum(axis=2)).max(axis=1)[:, None, None]
    scaled = offsets / size
    frame = np.linalg.svd(scaled.transpose(0, 2, 1), full_matrices=True)[0]  # (n, d, d)
    flat, high = scaled @ frame[:, :, :k], scaled @ frame[:, :, k:]
    terms = np.stack([flat[:, :, list(chosen)].prod(axis=2) for chosen in powers], axis=2)
    # What the polynomial leaves grows with the fourth power: far points must not outweigh near ones.
    far = np.sqrt((scaled**2).sum(axis=2))[:, :, None]
    weights = np.where(far > 0, 1 / np.where(far > 0, far, 1) ** 3, 0)
    found = np.linalg.pinv(weights * terms) @ (weights * high)  # (n, terms, d - k)
    slope = found[:, :k]  # (n, k, d - k)
    bend = np.empty((len(offsets), k, k, d - k))
    for row, chosen in enumerate(powers):
        if len(chosen) == 2:
            i, j = chosen
            bend[:, i, j] = bend[:, j, i] = found[:, row] * (2 if i == j else 1)
    # The graph's own tangents, e_i + slope_i; orthonormal, and the form in them.
    graph = np.concatenate([np.broadcast_to(np.eye(k), (len(offsets), k, k)), slope], axis=2)
    basis, upper = np.linalg.qr(graph.transpose(0, 2, 1))
    inverse = np.linalg.inv(upper)
    lifted = np.zeros((len(offsets), k, k, d))
    lifted[..., k:] = bend / size[..., None]
    inner = np.einsum("ndk,nijd->nijk", basis, lifted)
    normal = lifted - np.einsum("ndk,nijk->nijd", basis, inner)
    second = np.einsum("nia,njb,nijd->nabd", inverse, inverse, normal)
    return frame @ basis, np.einsum("ned,nijd->nije", frame, second)


def _sides(mesh: Mesh, tangents: np.ndarray, slopes: np.ndarray | None) -> np.ndarray | None:
    """(n, d): unit normals of a hypersurface, on the mesh's side, or the equation's if it has none."""
    if mesh.dimension != mesh.ambient_dimension - 1:
        return None
    if mesh.oriented_simplices() is None:
        return slopes
    if slopes is not None:
        at = slopes[mesh.simplices].sum(axis=1)
        return slopes if float((normals(mesh) * at).sum()) >= 0 else -slopes
    towards = np.zeros_like(mesh.points)
    flat = normals(mesh)
    for corner in mesh.simplices.T:
        np.add.at(towards, corner, flat)
    unit = np.linalg.svd(np.nan_to_num(tangents), full_matrices=True)[0][:, :, -1]
    return np.asarray(unit * np.where((unit * towards).sum(axis=1) >= 0, 1, -1)[:, None])


def _eigenvalues(matrices: np.ndarray) -> np.ndarray:
    """Of symmetric ones, ascending; NaN where they are."""
    values = np.linalg.eigvalsh(np.nan_to_num(matrices))
    values[np.isnan(matrices).any(axis=(1, 2))] = np.nan
    return np.asarray(values)
