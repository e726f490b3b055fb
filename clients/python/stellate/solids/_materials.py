"""Several materials: solids with a label each, meshed together."""

from __future__ import annotations

import numpy as np

from .._rows import Array
from ..errors import InvalidArgument
from ..oracles import Solid as WalledSolid
from ._signs import Arrangement, Either, needed, simplified
from ._solid import Solid, box_of

_MOST = 127  # labels


class Labels(WalledSolid):
    """Several materials: a region for each, labelled 1, 2, ... in the order that they are given in.

        composite = Labels(matrix=Box([-1] * 3, [1] * 3), grain=Ball(0.6))
        mesh = stellate.mesh(composite, epsilon=0.25)
        grain = mesh.region(composite.label_of("grain"))

    Where they overlap the later one wins. All of their walls together may be 16.

    Attributes:
      names: of the materials; label i + 1 is names[i].

    Raises: InvalidArgument, for too many walls, and for a material of which nothing is left.
    """

    def __init__(self, **materials: Solid) -> None:
        self.names = tuple(materials)
        if not 1 <= len(materials) <= _MOST:
            raise InvalidArgument(
                f"there are {len(materials)} materials; there may be 1 to {_MOST}"
            )
        for name, solid in materials.items():
            if not isinstance(solid, Solid):
                raise InvalidArgument(f"the material {name!r} has to be a solid, and is {solid!r}")
        solids = list(materials.values())
        d = solids[0].dimension
        for name, solid in materials.items():
            if solid.dimension != d:
                raise InvalidArgument(
                    f"the material {name!r} is a solid of R^{solid.dimension}, and the first one of R^{d}"
                )
        self._witnesses = tuple(witness for solid in solids for witness in solid.witnesses)
        trees = tuple(simplified(solid.tree) for solid in solids)
        arrangement = Arrangement(Either(trees))
        labels = arrangement.labels()
        for label, tree in enumerate(trees, 1):
            labels[(labels > 0) & arrangement.inside(tree)] = label
        for label, name in enumerate(self.names, 1):
            if not (labels == label).any():
                raise InvalidArgument(
                    f"there is nothing of the material {name!r}: it is empty, or later ones cover it"
                )
        walls, labels = needed(arrangement.walls, labels)
        box = box_of(Either(tuple(solid.tree for solid in solids)), d)
        # Signs that no point has count as outside, of which nothing is seen.
        super().__init__(walls, box, labels=np.maximum(labels, 0))
        self.region_names = self.names

    def label_of(self, name: str) -> int:
        """The label of a material, by its name. Raises: InvalidArgument."""
        if name not in self.names:
            raise InvalidArgument(f"there is no material {name!r}; there are {list(self.names)}")
        return self.names.index(name) + 1

    def clearances(self, points: Array) -> Array:
        """(n, d) -> (n, walls): the walls' values."""
        for witness in self._witnesses:
            witness.insist(points)
        return super().clearances(points)
