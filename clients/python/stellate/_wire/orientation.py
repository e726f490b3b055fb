"""How the simplices of a mesh are oriented, as the server tells it."""

from __future__ import annotations

import dataclasses

import numpy as np


@dataclasses.dataclass(frozen=True, eq=False)
class Orientation:
    """Which of a mesh's simplices are turned, their last two vertices exchanged, to agree.

    Attributes:
      orientable: False: no simplex is turned, as not all can agree.
      turned: a bit for each simplex, eight in a byte, the first in the lowest.
    """

    orientable: bool
    turned: bytes = b""

    @classmethod
    def from_bits(cls, orientable: bool, turned: bytes, simplices: int) -> Orientation:
        """As it came. Raises: ValueError if it is not that of so many simplices."""
        if not orientable:
            return cls(False)
        if len(turned) != (simplices + 7) // 8:
            raise ValueError(
                f"an orientation of {len(turned)} bytes came for {simplices} simplices"
            )
        return cls(True, turned)

    @classmethod
    def of(cls, turned: np.ndarray) -> Orientation:
        """turned: (m,) bool."""
        return cls(True, np.packbits(turned, bitorder="little").tobytes())

    def flags(self, simplices: int) -> np.ndarray:
        """(simplices,) bool: which are turned."""
        bits = np.frombuffer(self.turned, dtype=np.uint8)
        return np.unpackbits(bits, count=simplices, bitorder="little").astype(bool)
