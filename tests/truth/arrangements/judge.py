"""What a mesh with labels is, counted from its simplices, and compared with what is known of M.

Nothing here is shared with the mesher, nor taken from its report: faces, links and components are
counted anew, labels are asked at barycentres, volumes are compared with those of points thrown.
"""

from __future__ import annotations

import dataclasses
import itertools
from typing import Any, Callable

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

norm = np.linalg.norm
_ON = 1e-8  # of M's size: so near a wall a point is on it
_ASIDE = 1e-6
_MIX = np.uint64(0x9E3779B97F4A7C15)


@dataclasses.dataclass(frozen=True)
class Truth:
    """What is known of M, in coordinates of its own; about as large as 1.

    Attributes:
      walls: (n, d) -> (n, w), distances to the walls, positive on one side.
      label: (n, d) -> (n,), 0 outside.
      bend: the least radius of curvature of walls and M; infinite where all is flat.
      topology: of each label the number of components and the Euler characteristic, or None where
        these are not known.
      volumes: of each label its k-volume and by how much that may be wrong.
      pinched: whether a region touches itself in an edge or a point.
    """

    walls: Callable[[np.ndarray], np.ndarray]
    label: Callable[[np.ndarray], np.ndarray]
    bend: float
    topology: dict[int, tuple[int, int] | None]
    volumes: dict[int, tuple[float, float]]
    pinched: bool = False


@dataclasses.dataclass
class Finding:
    """What is wrong with a mesh, in words, and what was measured."""

    wrong: list[str]
    euler: dict[int, int]
    components: dict[int, int]
    least_angle: float  # degrees, of facets of one simplex
    off_walls: float  # the farthest that a vertex of the boundary is from its wall
    volume_error: float  # the largest, as a share of what is allowed


def judge(points: np.ndarray, simplices: np.ndarray, labels: np.ndarray, truth: Truth, epsilon: float) -> Finding:  # fmt: skip
    """Of regions with labels (m,). epsilon: in the truth's coordinates."""
    found = Finding([], {}, {}, _least_angle(points[simplices]), 0.0, 0.0)
    say = found.wrong.append
    _complex(simplices, say)
    k, sagitta = simplices.shape[1] - 1, epsilon**2 / (2 * truth.bend)
    if set(np.unique(labels)) != set(truth.topology):
        say(f"labels are {np.unique(labels).tolist()}, and have to be {list(truth.topology)}")
    facets, sides = _facets(simplices, labels, say)
    bounding = sides[:, 0] != sides[:, 1]
    on = np.abs(truth.walls(points)) <= _ON
    common = on[facets[bounding]].all(axis=1)
    if not common.any(axis=1).all():
        say(f"{int((~common.any(axis=1)).sum())} facets where a label ends lie on no wall")
    used = np.unique(facets[bounding])
    found.off_walls = float(np.abs(truth.walls(points[used])).min(axis=1).max(initial=0))
    _barycentres(points, simplices, labels, truth, sagitta, say)
    _across(points, facets[bounding], sides[bounding], common, truth, sagitta, say)
    for label, expected in truth.topology.items():
        region = simplices[labels == label]
        rim = facets[(sides == label).any(axis=1) & bounding]
        _closed(rim, f"the boundary of region {label}", say)
        pinched = _links(region, label, say)
        if pinched and not truth.pinched:
            say(f"region {label} touches itself at {pinched} vertices")
        found.euler[label], found.components[label] = euler(region), components(region)
        have = found.components[label], found.euler[label]
        if expected is not None and have != expected:
            say(f"region {label} has components and chi {have}, and has to have {expected}")
        area = volumes(points[rim]).sum() if k > 1 else len(rim)
        volume = volumes(points[region]).sum()
        _volume(volume, area, label, truth, epsilon, len(points[0]) > k, found)
    return found


def judge_surface(points: np.ndarray, simplices: np.ndarray, sides: np.ndarray, truth: Truth, epsilon: float) -> Finding:  # fmt: skip
    """Of a boundary alone, with the labels (m, 2) that normals point away from and into; k = d."""
    found = Finding([], {}, {}, _least_angle(points[simplices]), 0.0, 0.0)
    say, d = found.wrong.append, points.shape[1]
    _complex(simplices, say)
    if set(np.unique(sides)) - {0} != set(truth.topology) or (sides[:, 0] == sides[:, 1]).any():
        say(f"labels are {np.unique(sides, axis=0).tolist()}")
    values = truth.walls(points)
    common = (np.abs(values) <= _ON)[simplices].all(axis=1)
    found.off_walls = float(np.abs(values[np.unique(simplices)]).min(axis=1).max(initial=0))
    if not common.any(axis=1).all():
        say(f"{int((~common.any(axis=1)).sum())} simplices lie on no wall")
    sagitta = epsilon**2 / (2 * truth.bend)
    _across(points, simplices, sides, common, truth, sagitta, say)
    for label, expected in truth.topology.items():
        rows = (sides == label).any(axis=1)
        skin = simplices[rows]
        _closed(skin, f"the surface of region {label}", say)
        found.euler[label], found.components[label] = euler(skin), components(skin)
        # The boundary of a solid of R^3 has twice its Euler characteristic, that of the plane 0.
        if expected is not None and not truth.pinched:
            want = 2 * expected[1] if d == 3 else 0
            if found.euler[label] != want:
                say(f"the surface of region {label} has chi {found.euler[label]}, not {want}")
        outwards = np.where(sides[rows, 0] == label, 1, -1)
        volume = float(
            (outwards * np.linalg.det(points[skin])).sum() / np.prod(np.arange(1, d + 1))
        )
        _volume(volume, volumes(points[skin]).sum(), label, truth, epsilon, False, found)
    return found


# Of complexes.


def _keys(rows: np.ndarray) -> np.ndarray:
    """A number of 64 bits for each row, whatever the order in it: equal for equal sets."""
    x = rows.astype(np.uint64) + np.uint64(1)
    with np.errstate(over="ignore"):
        for shift in (30, 27, 31):
            x = (x ^ (x >> np.uint64(shift))) * _MIX
            x ^= x >> np.uint64(29)
        return np.asarray(x.sum(axis=1, dtype=np.uint64))


def _faces(simplices: np.ndarray, size: int) -> np.ndarray:
    """All faces of so many corners, again for each simplex that has them."""
    corners = itertools.combinations(range(simplices.shape[1]), size)
    return np.concatenate([simplices[:, list(c)] for c in corners])


def euler(simplices: np.ndarray) -> int:
    width = simplices.shape[1]
    counts = [len(np.unique(_keys(_faces(simplices, j)))) for j in range(1, width + 1)]
    return sum((-1) ** j * count for j, count in enumerate(counts))


def components(simplices: np.ndarray) -> int:
    """That hang together by vertices."""
    used, ids = np.unique(simplices, return_inverse=True)
    ids = ids.reshape(simplices.shape)
    a, b = np.repeat(ids[:, 0], ids.shape[1] - 1), ids[:, 1:].ravel()
    graph = coo_matrix((np.ones(len(a)), (a, b)), shape=(len(used), len(used)))
    return int(connected_components(graph, directed=False)[0])


def volumes(corners: np.ndarray) -> np.ndarray:
    edges = corners[:, 1:] - corners[:, :1]
    k = edges.shape[1]
    gram = edges @ np.swapaxes(edges, 1, 2)
    return np.sqrt(np.maximum(np.linalg.det(gram), 0)) / np.prod(np.arange(1, k + 1))


def _least_angle(corners: np.ndarray) -> float:
    """Between two facets of a simplex, in degrees, from the gradients of barycentric coordinates."""
    if corners.shape[1] < 3:
        return 180.0
    slopes = np.swapaxes(np.linalg.pinv(np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)), 1, 2)
    slopes = np.concatenate([-slopes.sum(axis=2, keepdims=True), slopes], axis=2)
    units = slopes / norm(slopes, axis=1, keepdims=True)
    cosines = -np.swapaxes(units, 1, 2) @ units
    np.einsum("mii->mi", cosines)[:] = -1
    return float(np.degrees(np.arccos(np.clip(cosines.max(), -1, 1))))


def _complex(simplices: np.ndarray, say: Callable[[str], Any]) -> None:
    if (np.diff(np.sort(simplices, axis=1), axis=1) == 0).any():
        say("a simplex has a vertex twice")
    if len(np.unique(_keys(simplices))) < len(simplices):
        say("a simplex is there twice")


def _facets(simplices: np.ndarray, labels: np.ndarray, say: Any) -> tuple[np.ndarray, np.ndarray]:
    """Each facet once, and the labels on its two sides, ascending; 0 where it is in one simplex."""
    width = simplices.shape[1]
    rows = np.concatenate([np.delete(simplices, i, axis=1) for i in range(width)])
    of = np.tile(labels, width).astype(np.int64)
    _, first, which, counts = np.unique(
        _keys(rows), return_index=True, return_inverse=True, return_counts=True
    )
    if counts.max() > 2:
        say(f"{int((counts > 2).sum())} facets are in more than two simplices")
    low, high = np.full(len(first), 1 << 30), np.full(len(first), -1)
    np.minimum.at(low, which, of)
    np.maximum.at(high, which, of)
    return rows[first], np.stack([np.where(counts == 1, 0, low), high], axis=1)


def _closed(rim: np.ndarray, what: str, say: Callable[[str], Any]) -> None:
    """Every facet of it in an even number of its simplices."""
    if rim.shape[1] < 2:
        return
    _, counts = np.unique(_keys(_faces(rim, rim.shape[1] - 1)), return_counts=True)
    if (counts % 2).any():
        say(f"{what} is not closed at {int((counts % 2).sum())} places")


def _links(simplices: np.ndarray, label: int, say: Callable[[str], Any]) -> int:
    """Says which vertices' links are neither spheres nor balls, part by part; counts touching ones.

    A part hangs together by facets. For k <= 3 its Euler characteristic decides what it is.
    """
    m, width = simplices.shape
    k, rows = width - 1, np.sort(simplices, axis=1)
    at = np.arange(m * width).reshape(m, width)  # a node for each corner of each simplex
    facets = np.concatenate([np.delete(rows, i, axis=1) for i in range(width)])
    nodes = np.concatenate([np.delete(at, i, axis=1) for i in range(width)])
    keys = _keys(facets)
    order = np.argsort(keys, kind="stable")
    same = keys[order][1:] == keys[order][:-1]
    a, b = nodes[order[:-1][same]].ravel(), nodes[order[1:][same]].ravel()
    graph = coo_matrix((np.ones(len(a)), (a, b)), shape=(m * width, m * width))
    count, part = connected_components(graph, directed=False)
    chi, ends = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=bool)
    apart = part[at] + (1 << 40)  # no number of a vertex
    for size in range(1, width):
        faces = np.concatenate(
            [
                np.column_stack([apart[:, c], rows[:, list(others)]])
                for c in range(width)
                for others in itertools.combinations([i for i in range(width) if i != c], size)
            ]
        )
        _, first = np.unique(_keys(faces), return_index=True)
        chi += (-1) ** (size - 1) * np.bincount(faces[first, 0] - (1 << 40), minlength=count)
    lonely = np.ones(len(keys), dtype=bool)
    lonely[order[1:][same]] = lonely[order[:-1][same]] = False
    ends[part[nodes[lonely].ravel()]] = True
    wrong = chi != np.where(ends, 1, 1 + (-1) ** (k - 1))
    vertex = np.zeros(count, dtype=np.int64)
    vertex[part[at.ravel()]] = rows.ravel()
    if wrong.any():
        bad = vertex[wrong][:3].tolist()
        say(
            f"links of region {label} are no spheres or balls at {int(wrong.sum())} vertices, as {bad}"
        )
    return count - len(np.unique(vertex))


# Of M.


def _barycentres(points, simplices, labels, truth, sagitta, say) -> None:  # type: ignore[no-untyped-def]
    middles = points[simplices].mean(axis=1)
    wrong = truth.label(middles) != labels
    far = np.abs(truth.walls(middles[wrong])).min(axis=1, initial=np.inf) > 1.2 * sagitta + _ON
    if far.any():
        say(
            f"{int(far.sum())} barycentres have another label, as {middles[wrong][far][0].tolist()}"
        )


def _across(points, facets, sides, common, truth, sagitta, say) -> None:  # type: ignore[no-untyped-def]
    """Whether labels change, across each facet's wall, as its two sides say."""
    rows = np.flatnonzero(common.any(axis=1))
    wall = common[rows].argmax(axis=1)
    x, d = points[facets[rows]].mean(axis=1), points.shape[1]
    each = np.arange(len(rows))

    def value(x: np.ndarray) -> np.ndarray:
        return truth.walls(x)[each, wall]

    for _ in range(4):
        steps = _ASIDE * np.eye(d)
        slope = np.stack([(value(x + v) - value(x - v)) / (2 * _ASIDE) for v in steps], axis=1)
        unit = slope / norm(slope, axis=1, keepdims=True)
        x = x - (value(x) / norm(slope, axis=1))[:, None] * unit
    have = np.stack([truth.label(x - _ASIDE * unit), truth.label(x + _ASIDE * unit)], axis=1)
    wrong = (np.sort(have, axis=1) != np.sort(sides[rows], axis=1)).any(axis=1)
    others = np.abs(truth.walls(x))
    others[each, wall] = np.inf
    near = others.min(axis=1) <= 3 * sagitta + _ON  # a crease, which the facet's chord cuts short
    if (wrong & ~near).any():
        row = int(np.flatnonzero(wrong & ~near)[0])
        say(
            f"{int((wrong & ~near).sum())} facets are between other labels than M's, as at "
            f"{x[row].tolist()}: {sides[rows][row].tolist()}, not {have[row].tolist()}"
        )


def _volume(volume, area, label, truth, epsilon, curved, found) -> None:  # type: ignore[no-untyped-def]
    true, doubt = truth.volumes[label]
    allowed = area * epsilon**2 / (2 * truth.bend) + doubt + 1e-9 * true
    if curved:
        allowed += true * (epsilon / truth.bend) ** 2
    found.volume_error = max(found.volume_error, abs(volume - true) / allowed)
    if abs(volume - true) > allowed:
        found.wrong.append(
            f"region {label} has the volume {volume:.6g}, not {true:.6g} to {allowed:.2g}"
        )
