"""The client's copy of a mesh that grows by deltas."""

from __future__ import annotations

import numpy as np

from .._generated import mesh_pb2
from .._generated import stellate_pb2 as pb
from .arrays import from_wire, indices_from_wire
from .orientation import Orientation


def _keys(rows: np.ndarray) -> np.ndarray:
    """(n,) numbers that are ordered as the rows are, lexicographically."""
    bits = max(1, int(rows.max(initial=0)).bit_length())
    keys, used = rows[:, 0].astype(np.uint64), bits
    for column in rows.T[1:]:
        if used + bits > 64:  # their ranks need fewer bits
            keys = np.unique(keys, return_inverse=True)[1].astype(np.uint64)
            used = len(rows).bit_length()
        keys = (keys << np.uint64(bits)) | column.astype(np.uint64)
        used += bits
    return keys


def lexicographic(rows: np.ndarray) -> np.ndarray:
    """(n,) int64: the order that sorts the rows."""
    return np.argsort(_keys(rows), kind="stable")


def _net(rows: np.ndarray, removed: int) -> np.ndarray:
    """What is left in lexicographic order when the last `removed` rows cancel one like them each.

    Raises: ValueError if there is none, or a row is there twice.
    """
    keys = _keys(rows)
    order = np.argsort(keys, kind="stable")
    keys = keys[order]
    first = np.flatnonzero(np.append(True, keys[1:] != keys[:-1]))
    count = np.where(order < len(rows) - removed, 1, -1)
    count = np.add.reduceat(count, first)
    if (count < 0).any():
        raise ValueError(
            f"a delta removes {-int(count[count < 0].sum())} simplices that are not there"
        )
    if (count > 1).any():
        raise ValueError(f"a delta adds {int((count > 1).sum())} simplices that are there already")
    return rows[order[first[count == 1]]]


_UNSETTLED = 100_000  # removed simplices at least; else half of those that are there


def walls_from_wire(
    message: mesh_pb2.MeshDelta | pb.DownloadMeshResponse, vertices: int
) -> list[tuple[np.ndarray, np.ndarray]]:
    """What a message says of vertices on walls: none or one pair of arrays.

    Raises: ValueError if there are not that many vertices.
    """
    if not message.boundary_vertices:
        return []
    on = np.array(message.boundary_vertices, dtype=np.int64)
    walls = np.array(message.boundary_walls, dtype=np.uint64)
    if len(on) != len(walls) or int(on.max()) >= vertices:
        raise ValueError(f"walls of {len(on)} vertices do not fit the {vertices} that there are")
    return [(on, walls)]


def spread_walls(boundary: list[tuple[np.ndarray, np.ndarray]], vertices: int) -> np.ndarray | None:
    """(vertices,) uint64 from what walls_from_wire found; None where there was nothing."""
    if not boundary:
        return None
    walls = np.zeros(vertices, dtype=np.uint64)
    for on, of in boundary:
        walls[on] = of
    return walls


def labels_from_wire(
    labels: bytes, rows: np.ndarray, boundary_only: bool
) -> list[tuple[np.ndarray, np.ndarray]]:
    """What a message says of the regions of simplices: none or one pair of arrays. Of the boundary
    alone each simplex has two labels, always.

    Raises: ValueError if there are not that many simplices.
    """
    each = 2 if boundary_only else 1
    if len(labels) != each * len(rows) and (labels or boundary_only):
        raise ValueError(f"{len(labels)} labels do not fit {len(rows)} simplices")
    of = np.frombuffer(labels, dtype=np.int8)
    return [(rows, of.reshape(-1, 2) if boundary_only else of)] if labels else []


def spread_labels(
    labels: list[tuple[np.ndarray, np.ndarray]], rows: np.ndarray
) -> np.ndarray | None:
    """(m,) int8, or (m, 2), of these rows, from what labels_from_wire found; None where there was nothing.

    Raises: ValueError if there is none for one of them.
    """
    if not labels:
        return None
    known = np.concatenate([some for some, _ in labels])
    keys = _keys(np.concatenate([rows, known]))
    keys, known_keys = keys[: len(rows)], keys[len(rows) :]
    order = np.argsort(known_keys, kind="stable")
    # The last of those that came and went, and came again.
    last = np.searchsorted(known_keys[order], keys, side="right") - 1
    if len(rows) and not (known_keys[order[last]] == keys).all():
        raise ValueError("a simplex has no label, and others have one")
    return np.concatenate([of for _, of in labels])[order[last]]


class DeltaMesh:
    """Vertices and simplices as of the last complete revision.

    What comes and goes is put aside, and settled for many revisions together.
    """

    def __init__(self, dimension: int, ambient_dimension: int, boundary_only: bool = False) -> None:
        """dimension: of its simplices. boundary_only: each of them has two labels."""
        self._k, self._d, self._boundary_only = dimension, ambient_dimension, boundary_only
        self._begin()

    def _begin(self) -> None:
        self.revision = 0
        self._vertex_count = 0
        self._boundary: list[tuple[np.ndarray, np.ndarray]] = []  # vertices and their walls
        self._labels: list[tuple[np.ndarray, np.ndarray]] = []  # simplices and their regions
        self._points = np.empty((1024, self._d))
        self._rows = np.empty((0, self._k + 1), dtype=np.uint32)  # in lexicographic order
        self._added: list[np.ndarray] = []
        self._removed: list[np.ndarray] = []
        self._removed_count = 0
        self._pending: list[mesh_pb2.MeshDelta] = []
        self._orientable: bool | None = None  # None: not known
        self._turned = b""

    def absorb(self, chunk: pb.DeltaChunk) -> bool:
        """Takes one chunk; True when a revision is complete with it.

        Raises: ValueError if it does not fit what came before. A simplex that goes and is not there,
        or that comes and is, may show later: in whatever settles.
        """
        revision = chunk.delta.revision
        if revision <= self.revision or (self._pending and self._pending[-1].revision != revision):
            raise ValueError(f"revision {revision} is out of order")
        self._pending.append(chunk.delta)
        self._orientable = None
        if not chunk.complete:
            return False
        pending, self._pending = self._pending, []
        points = [(delta.first_vertex, from_wire(delta.points, -1, self._d)) for delta in pending]
        added = [indices_from_wire(delta.added, -1, self._k + 1) for delta in pending]
        removed = [indices_from_wire(delta.removed, -1, self._k + 1) for delta in pending]
        for first, block in points:
            self._append_points(first, block)
        for delta in pending:
            self._boundary += walls_from_wire(delta, self._vertex_count)
        for rows in added:
            if rows.size and int(rows.max()) >= self._vertex_count:
                raise ValueError(
                    f"a simplex has vertex {int(rows.max())} of {self._vertex_count} vertices"
                )
        for rows, delta in zip(added, pending):
            self._labels += labels_from_wire(delta.added_labels, rows, self._boundary_only)
        self._added += [rows for rows in added if len(rows)]
        self._removed += [rows for rows in removed if len(rows)]
        self._removed_count += sum(map(len, removed))
        if self._removed_count > max(_UNSETTLED, len(self._rows) // 2):
            self.settle()
        self.revision = revision
        return True

    def orient(self, chunk: mesh_pb2.Orientation) -> None:
        """Takes a chunk of the last revision's orientation. Raises: ValueError if it does not follow."""
        if chunk.first_simplex == 0:
            self._orientable, self._turned = chunk.orientable, b""
        if self._orientable is None or chunk.first_simplex != 8 * len(self._turned):
            raise ValueError(f"the orientation of simplex {chunk.first_simplex} is out of order")
        self._turned += chunk.turned

    def orientation(self) -> Orientation | None:
        """The orientation of simplices(), once the server has sent it. Raises: ValueError if it has not
        sent it of all of them."""
        self.settle()
        if self._orientable is None:
            return None
        return Orientation.from_bits(self._orientable, self._turned, len(self._rows))

    def forget_pending(self) -> None:
        """Drops the chunks of a revision that was cut short: it will be sent again."""
        self._pending = []

    def reset(self) -> None:
        """Back to the empty mesh. What points() and simplices() gave stays what it is."""
        self._begin()

    def points(self) -> np.ndarray:
        """(n, d), read-only; vertices never change, so it stays true while the mesh grows."""
        view = self._points[: self._vertex_count]
        view.flags.writeable = False
        return view

    def walls(self) -> np.ndarray | None:
        """(n,) uint64, the walls of each vertex as bits; None where there are none."""
        return spread_walls(self._boundary, self._vertex_count)

    def labels(self) -> np.ndarray | None:
        """(m,) int8, the region of each of the simplices(); of the boundary alone (m, 2), those of
        both sides; None where there are none."""
        self.settle()
        return spread_labels(self._labels, self._rows)

    def simplices(self) -> np.ndarray:
        """(m, k+1) int64, ids ascending in each row, rows in lexicographic order."""
        self.settle()
        return self._rows.astype(np.int64)

    def settle(self) -> None:
        """Makes simplices() cheap. Raises: ValueError as absorb does."""
        if not self._added and not self._removed:
            return
        rows = np.concatenate([self._rows, *self._added, *self._removed])
        self._rows = _net(rows, self._removed_count)
        self._added, self._removed, self._removed_count = [], [], 0

    def _append_points(self, first: int, block: np.ndarray) -> None:
        if not len(block):
            return
        if first != self._vertex_count:
            raise ValueError(
                f"a delta starts at vertex {first}, and there are {self._vertex_count}"
            )
        needed = first + len(block)
        if needed > len(self._points):
            larger = np.empty((max(needed, 2 * len(self._points)), self._d))
            larger[:first] = self._points[:first]
            self._points = larger
        self._points[first:needed] = block
        self._vertex_count = needed
