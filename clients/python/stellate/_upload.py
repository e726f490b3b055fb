"""Sending the points of a reconstruction, through breaks of the connection."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Iterator
from typing import Any

import grpc
import numpy as np

from ._generated import stellate_pb2 as pb
from ._generated import stellate_pb2_grpc as rpc
from ._info import MeshInfo
from ._reconnect import Reconnector
from ._wire.arrays import fill
from ._wire.calls import end
from .errors import from_rpc

_CHUNK_BYTES = 1 << 20  # of the points in a message, where the server takes so much


class Upload:
    """The points of one mesh on their way to the server.

    Any thread may call stop(); one calls run().
    """

    def __init__(
        self,
        stub: rpc.StellateStub,
        attempts: Reconnector,
        name: str,
        points: np.ndarray,
        tangents: np.ndarray | None,
        most_bytes: int,
        rows: int | None = None,
    ) -> None:
        """`rows`: in a chunk; by default as many as a megabyte holds."""
        self._stub, self._attempts, self._name = stub, attempts, name
        self._points, self._tangents = points, tangents
        numbers = points[:1].size + (0 if tangents is None else tangents[:1].size)
        fit = min(_CHUNK_BYTES, most_bytes // 2) // (8 * numbers)
        self._rows = max(1, fit if rows is None else rows)
        self._stopped = threading.Event()
        self._call: Any = None

    def run(self) -> MeshInfo:
        """Returns once the server has recorded all points. Raises what it refuses."""
        while True:
            try:
                first = self._send(iter([pb.PointsChunk(mesh=self._name)])).rows
                reply = self._send(self._chunks(first))
            except grpc.RpcError as error:
                self._attempts.wait_or_raise(error, self._attempts.explain(from_rpc(error)))
            else:
                self._attempts.heard()
                return MeshInfo.from_wire(reply.mesh)

    def stop(self) -> None:
        """Sends no more."""
        self._stopped.set()
        self._attempts.stop()
        if self._call is not None:
            self._call.cancel()

    def _send(self, chunks: Iterator[pb.PointsChunk]) -> Any:
        call = self._stub.Reconstruct.future(chunks)
        self._call = call
        if self._stopped.is_set():  # by another thread, which saw no call
            call.cancel()
        try:
            return call.result()
        finally:
            end(call)

    def _chunks(self, first: int) -> Iterator[pb.PointsChunk]:
        yield pb.PointsChunk(mesh=self._name)
        for row in range(first, len(self._points), self._rows):
            chunk = pb.PointsChunk()
            chunk.points.first_row = row
            fill(chunk.points.points, self._points[row : row + self._rows])
            if self._tangents is not None:
                fill(chunk.points.tangents, self._tangents[row : row + self._rows])
            yield chunk
        end = pb.PointsChunk()
        end.end.points_sha256 = _digest(self._points)
        if self._tangents is not None:
            end.end.tangents_sha256 = _digest(self._tangents)
        yield end


def _digest(array: np.ndarray) -> bytes:
    return hashlib.sha256(np.ascontiguousarray(array, dtype="<f8").data).digest()
