"""Linear algebra a row at a time, in an order of its own: no batch changes a row's last bit.

numpy leaves products to BLAS, whose dot products and products with one vector round by where a row
lies in memory.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


def unmasked(values: Any) -> Any:
    """values, or, of a masked array, an array that is NaN where a mask hides the number.

    numpy.asarray takes what is behind the mask for data.
    """
    if not np.ma.is_masked(values):
        return values
    kind = values.dtype if values.dtype.kind in "fc" else np.float64
    return np.ma.filled(values.astype(kind), np.nan)


def norms(rows: Array) -> Array:
    """Lengths of the vectors along the last axis."""
    return np.asarray(np.sqrt((rows * rows).sum(axis=-1)))


def transposed(matrices: Array) -> Array:
    """(n, a, b) -> (n, b, a)."""
    return matrices.transpose(0, 2, 1)


def apply(matrices: Array, vectors: Array) -> Array:
    """(n, a, b), (n, b) -> (n, a)."""
    total = matrices[:, :, 0] * vectors[:, :1]
    for j in range(1, matrices.shape[2]):
        total += matrices[:, :, j] * vectors[:, j : j + 1]
    return np.asarray(total)


def product(a: Array, b: Array) -> Array:
    """(n, p, q), (n, q, r) -> (n, p, r)."""
    if a.shape[1] > 1 and b.shape[2] > 1:
        return np.asarray(a @ b)  # of many, which BLAS copies to where it wants them
    total = a[:, :, :1] * b[:, :1, :]
    for j in range(1, a.shape[2]):
        total += a[:, :, j : j + 1] * b[:, j : j + 1, :]
    return np.asarray(total)
