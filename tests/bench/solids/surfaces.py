"""How a surface of triangles compares with the solid that it bounds: rows of marching.py and dual_contouring.py.

middles   the farthest that a triangle's middle is from f = 0, as a share of epsilon
edges     the farthest that a point of a true edge is from the mesh, as a share of epsilon
angle     the least of a triangle, degrees
chi       Euler characteristic
"""

from collections.abc import Callable

import numpy as np
import stellate

HEADER = f"{'solid':24s} {'mesher':15s} triangles seconds   middles   edges   angle   chi"


def points_of_edges(mesh: stellate.Mesh) -> np.ndarray:
    """(m, 3) points on the creases of a boundary's mesh; none where it has no creases.

    Of curved edges the middles of chords are not on them; their ends are.
    """
    edges = [mesh.points[edge.simplices] for edge in mesh.edges]
    middles = np.concatenate([e.mean(axis=1) for e in edges]) if edges else np.empty((0, 3))
    return np.concatenate([middles, *(e.reshape(-1, 3) for e in edges)])


def area(corners: np.ndarray) -> float:
    sides = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return float(np.linalg.norm(np.cross(*sides), axis=1).sum() / 2)


def angle(corners: np.ndarray) -> float:
    least = 180.0
    for i in range(3):
        a, b = corners[:, i - 1] - corners[:, i], corners[:, i - 2] - corners[:, i]
        lengths = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
        cosines = (a * b).sum(axis=1) / np.maximum(lengths, 1e-300)
        least = min(least, float(np.degrees(np.arccos(np.clip(cosines.max(), -1, 1)))))
    return least


def euler(corners: np.ndarray) -> int:
    points, ids = np.unique(np.round(corners.reshape(-1, 3), 9), axis=0, return_inverse=True)
    rows = np.sort(ids.reshape(-1, 3), axis=1)
    rows = rows[(np.diff(rows, axis=1) > 0).all(axis=1)]
    edges = np.unique(np.concatenate([rows[:, [0, 1]], rows[:, [0, 2]], rows[:, [1, 2]]]), axis=0)
    return len(points) - len(edges) + len(rows)


def farthest(points: np.ndarray, corners: np.ndarray) -> float:
    """How far the farthest of `points` (m, 3) is from the triangles."""
    origin, sides = corners[:, 0], corners[:, 1:] - corners[:, :1]
    gram = sides @ sides.transpose(0, 2, 1)
    determinant = np.maximum(np.linalg.det(gram), 1e-300)
    most = 0.0
    for point in points:
        to = point - origin
        along = np.einsum("nij,nj->ni", sides, to)
        u = (gram[:, 1, 1] * along[:, 0] - gram[:, 0, 1] * along[:, 1]) / determinant
        v = (gram[:, 0, 0] * along[:, 1] - gram[:, 0, 1] * along[:, 0]) / determinant
        inside = (u >= 0) & (v >= 0) & (u + v <= 1)
        foot = u[:, None] * sides[:, 0] + v[:, None] * sides[:, 1]
        least = np.linalg.norm(to - foot, axis=1)[inside].min(initial=np.inf)
        for i in range(3):
            a, side = corners[:, i], corners[:, (i + 1) % 3] - corners[:, i]
            share = np.einsum("nj,nj->n", side, point - a) / np.maximum((side**2).sum(1), 1e-300)
            foot = a + np.clip(share, 0, 1)[:, None] * side
            least = min(least, np.linalg.norm(point - foot, axis=1).min())
        most = max(most, float(least))
    return most


def line(
    name: str,
    mesher: str,
    f: Callable[[np.ndarray], np.ndarray],
    corners: np.ndarray,
    edges: np.ndarray,
    seconds: float,
    epsilon: float,
    note: str = "",
) -> None:
    """Prints a row: `corners` (n, 3, 3) the triangles, `edges` (m, 3) points of the true creases."""
    middles = np.abs(f(corners.mean(axis=1))).max() / epsilon
    off = farthest(edges, corners) / epsilon
    print(
        f"{name:24s} {mesher:15s} {len(corners):9d} {seconds:7.2f} {middles:9.4f} {off:7.3f} "
        f"{angle(corners):7.2f} {euler(corners):5d}  {note}",
        flush=True,
    )
