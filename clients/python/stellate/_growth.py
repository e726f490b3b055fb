"""The client's copy of a mesh that grows by deltas."""

from __future__ import annotations

import numpy as np

from ._arrays import from_wire, indices_from_wire
from ._generated import mesh_pb2
from ._generated import stellate_pb2 as pb


def in_order(rows: np.ndarray) -> np.ndarray:
    """A copy as int64, rows in lexicographic order."""
    return rows[np.lexsort(rows.T[::-1])].astype(np.int64)


class GrowingComplex:
    """Vertices and simplices as of the last complete revision."""

    def __init__(self, dimension: int, ambient_dimension: int) -> None:
        self._k, self._d = dimension, ambient_dimension
        self.revision = 0
        self._vertex_count = 0
        self._points = np.empty((1024, ambient_dimension))
        self._rows = np.empty((0, dimension + 1), dtype=np.uint32)
        self._pending: list[mesh_pb2.MeshDelta] = []

    def absorb(self, chunk: pb.DeltaChunk) -> bool:
        """Takes one chunk; True when a revision is complete with it.

        Raises: ValueError if it does not fit what came before.
        """
        revision = chunk.delta.revision
        if revision <= self.revision or (self._pending and self._pending[-1].revision != revision):
            raise ValueError(f"revision {revision} is out of order")
        self._pending.append(chunk.delta)
        if not chunk.complete:
            return False
        pending, self._pending = self._pending, []
        points = [(delta.first_vertex, from_wire(delta.points, -1, self._d)) for delta in pending]
        added = [indices_from_wire(delta.added, -1, self._k + 1) for delta in pending]
        removed = [indices_from_wire(delta.removed, -1, self._k + 1) for delta in pending]
        for first, block in points:
            self._append_points(first, block)
        self._remove(np.concatenate(removed))
        self._rows = np.concatenate([self._rows, *added])
        if self._rows.size and int(self._rows.max()) >= self._vertex_count:
            raise ValueError(
                f"a simplex has vertex {int(self._rows.max())} of {self._vertex_count} vertices"
            )
        self.revision = revision
        return True

    def forget_pending(self) -> None:
        """Drops the chunks of a revision that was cut short: it will be sent again."""
        self._pending = []

    def reset(self) -> None:
        """Back to the empty mesh. What points() and simplices() gave stays what it is."""
        self.__init__(self._k, self._d)

    def points(self) -> np.ndarray:
        """(n, d), read-only; vertices never change, so it stays true while the mesh grows."""
        view = self._points[: self._vertex_count]
        view.flags.writeable = False
        return view

    def simplices(self) -> np.ndarray:
        """(m, k+1) int64, ids ascending in each row, rows in lexicographic order."""
        return in_order(self._rows)

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

    def _remove(self, removed: np.ndarray) -> None:
        if not len(removed):
            return
        # Few rows share their vertices with the removed ones: only those are compared.
        touched = np.zeros(max(self._vertex_count, int(removed.max()) + 1), dtype=bool)
        touched[removed] = True
        candidates = np.flatnonzero(touched[self._rows].all(axis=1))
        gone = {row.tobytes() for row in np.ascontiguousarray(removed)}
        rows = np.ascontiguousarray(self._rows[candidates])
        drop = [i for i, row in zip(candidates, rows) if row.tobytes() in gone]
        if len(drop) != len(gone):
            raise ValueError(
                f"a delta removes {len(gone) - len(drop)} simplices that are not there"
            )
        keep = np.ones(len(self._rows), dtype=bool)
        keep[drop] = False
        self._rows = self._rows[keep]
