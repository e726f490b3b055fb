"""Stanford's PLY, binary: curves and surfaces of space, in double precision."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from .._complex import in_space
from .writing import Shape

_FACE = np.dtype([("count", "u1"), ("ids", "<i4", 3)])


class PlyWriter:
    """A MeshWriter of a binary .ply, little-endian."""

    def __init__(self, file: BinaryIO, shape: Shape) -> None:
        self._file, self._is_curve = file, shape.groups[0].dimension == 1
        axes = "".join(f"property double {axis}\n" for axis in "xyz")
        cells = (
            f"element edge {shape.simplices}\nproperty int vertex1\nproperty int vertex2\n"
            if self._is_curve
            else f"element face {shape.simplices}\nproperty list uchar int vertex_indices\n"
        )
        begin = "ply\nformat binary_little_endian 1.0\n"
        head = f"{begin}element vertex {shape.vertices}\n{axes}{cells}end_header\n"
        file.write(head.encode())

    def add_points(self, points: np.ndarray) -> None:
        self._file.write(in_space(points).astype("<f8", copy=False).tobytes())

    def add_cells(self, group: int, cells: np.ndarray) -> None:
        if self._is_curve:
            self._file.write(cells.astype("<i4").tobytes())
            return
        faces = np.empty(len(cells), _FACE)
        faces["count"], faces["ids"] = 3, cells
        self._file.write(faces.tobytes())

    def finish(self) -> None:
        pass
