"""A mesh that is in files, and not in memory."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from ._files import vtu
from ._mesh import Mesh, warn_of_uncertified
from .errors import InvalidArgument
from .report import Report


@dataclasses.dataclass(frozen=True, eq=False)
class SavedMesh:
    """A mesh that went into files as it came: stellate.download(name, to=path), stellate.mesh(..., to=path).

    Attributes:
      paths: of the files.
      dimension, ambient_dimension: k and d.
      vertices, simplices: how many.
      revision: which it was.
      report: how it ended and what is proved; None while the mesh grows.
      name: by which it is on its server still, where it was asked to stay; else "".
    """

    paths: tuple[str, ...]
    dimension: int
    ambient_dimension: int
    vertices: int
    simplices: int
    revision: int
    report: Report | None = dataclasses.field(default=None, repr=False)
    name: str = ""

    @classmethod
    def of(cls, mesh: Mesh, paths: Sequence[str]) -> SavedMesh:
        """One that was in memory, and is in these files."""
        size = mesh.dimension, mesh.ambient_dimension, len(mesh.points), len(mesh.simplices)
        return cls(tuple(paths), *size, mesh.revision, mesh.report, mesh.name)

    def warn_if_uncertified(self, stacklevel: int) -> None:
        """As Mesh.save does."""
        if self.report is not None and not self.report.certified:
            for path in self.paths:
                warn_of_uncertified(path, self.report, stacklevel + 1)

    @property
    def certified(self) -> bool:
        """Whether the mesh is finished and proved good."""
        return self.report is not None and self.report.certified

    @property
    def points(self) -> np.ndarray:
        """(n, d) float64: the points in the .vtu file, a np.memmap, which takes no memory.

        Raises: InvalidArgument where no file is a .vtu, which alone can be mapped; OSError.
        """
        name = "coordinates" if self.ambient_dimension > 3 else "Points"
        return vtu.mapped(self._vtu(), name)[:, : self.ambient_dimension]

    @property
    def cells(self) -> np.ndarray:
        """(m, k+1) int64: the simplices in the .vtu file, turned to agree as
        Mesh.oriented_simplices() does it, in lexicographic order of their sorted rows unless there are
        several regions; a np.memmap.

        Raises: as `points`.
        """
        ids = vtu.mapped(self._vtu(), "connectivity")
        width = self.dimension + 1  # faces of the boundary come after the simplices
        return ids[: self.simplices * width].reshape(self.simplices, width)

    def _vtu(self) -> str:
        for path in self.paths:
            if path.lower().endswith(".vtu"):
                return path
        raise InvalidArgument(f"a .vtu file can be mapped into memory, and not {self.paths}")
