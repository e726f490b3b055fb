"""Reading the .txt format back, which is exact."""

from __future__ import annotations

import numpy as np


def read_txt(path: str) -> tuple[np.ndarray, np.ndarray]:
    """The points and the simplices of a file, to the last bit.

    Raises: ValueError for something else, OSError.
    """
    with open(path, errors="replace") as file:
        try:
            k, d, vertex_count, simplex_count = map(int, file.readline().split())
        except ValueError:
            raise ValueError(f"{path}: the first line has to be 'k d nv ns'") from None
        body = file.read().split()
    if len(body) != vertex_count * d + simplex_count * (k + 1):
        raise ValueError(f"{path}: {len(body)} numbers do not fit its first line")
    try:
        points = np.array(body[: vertex_count * d], dtype=float)
        simplices = np.array(body[vertex_count * d :], dtype=np.int64)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    return points.reshape(vertex_count, d), simplices.reshape(simplex_count, k + 1)
