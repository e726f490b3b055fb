"""What the writers of files and the errors need to know of a mesh."""

from __future__ import annotations

import os
from typing import Any, Protocol

import numpy as np

from .report import Report


class Complex(Protocol):
    """A stellate.Mesh, which says more of each."""

    @property
    def points(self) -> np.ndarray: ...

    @property
    def simplices(self) -> np.ndarray: ...

    @property
    def walls(self) -> np.ndarray | None: ...

    @property
    def labels(self) -> np.ndarray | None: ...

    @property
    def region_names(self) -> tuple[str, ...]: ...

    @property
    def coordinate_names(self) -> tuple[str, ...]: ...

    @property
    def report(self) -> Report | None: ...

    @property
    def dimension(self) -> int: ...

    @property
    def ambient_dimension(self) -> int: ...

    @property
    def certified(self) -> bool: ...

    def region(self, label: int | str) -> Complex: ...

    def faces(self, dimension: int) -> tuple[Any, ...]: ...

    def oriented_simplices(self) -> np.ndarray | None: ...

    def save(self, path: str | os.PathLike[str]) -> None: ...


def in_space(points: np.ndarray) -> np.ndarray:
    """(n, d) -> (n, 3): the first three coordinates, zeros added where there are fewer."""
    n, d = points.shape
    space = np.zeros((n, 3))
    space[:, : min(d, 3)] = points[:, :3]
    return space
