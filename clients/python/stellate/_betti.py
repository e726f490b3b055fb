"""The Betti numbers of a complex: how many components, tunnels, cavities it has."""

from __future__ import annotations

import itertools

import numpy as np

from ._complex import Complex
from ._convert import to_simplex_tree
from .errors import InvalidArgument

_MOST = 400_000  # faces of all dimensions that are reduced here: about a minute


def betti(mesh: Complex, modulus: int) -> tuple[int, ...]:
    """See Mesh.betti."""
    if modulus < 2 or any(modulus % i == 0 for i in range(2, int(modulus**0.5) + 1)):
        raise InvalidArgument(f"a field has a prime number of elements, and not {modulus}")
    if not len(mesh.simplices):
        return (0,) * (mesh.dimension + 1)
    try:
        tree = to_simplex_tree(mesh)
    except ImportError:
        return reduced(mesh.simplices, modulus)
    tree.compute_persistence(homology_coeff_field=modulus, persistence_dim_max=True)
    found = tree.betti_numbers()
    return tuple(found) + (0,) * (mesh.dimension + 1 - len(found))


def reduced(simplices: np.ndarray, modulus: int) -> tuple[int, ...]:
    """Without GUDHI: the boundary matrices' ranks, by elimination of columns from the top dimension down.

    A face that pairs with a coface needs no elimination of its own ("clearing": C. Chen and M. Kerber,
    "Persistent homology computation with a twist", 2011).
    """
    size = simplices.shape[1]
    faces = []
    for width in range(1, size + 1):
        columns = itertools.combinations(range(size), width)
        faces.append(np.unique(np.concatenate([simplices[:, list(c)] for c in columns]), axis=0))
    count = sum(map(len, faces))
    if count > _MOST:
        raise InvalidArgument(
            f"the mesh has {count:,} faces of all dimensions; beyond {_MOST:,} Betti numbers take GUDHI: "
            "apt-get install python3-gudhi, or pip install gudhi"
        )
    numbers = [{tuple(face): i for i, face in enumerate(rows.tolist())} for rows in faces]
    ranks = [0] * (size + 1)
    paired: set[int] = set()  # faces of this dimension that are last in a column of the one above
    for width in range(size - 1, 0, -1):
        below = numbers[width - 1]
        lows: dict[int, dict[int, int]] = {}
        for i, face in enumerate(faces[width].tolist()):
            if i in paired:
                continue
            column = {
                below[tuple(face[:out] + face[out + 1 :])]: (-1) ** out % modulus
                for out in range(width + 1)
            }
            _eliminate(column, lows, modulus)
        ranks[width] = len(lows)
        paired = set(lows)
    return tuple(len(faces[j]) - ranks[j] - ranks[j + 1] for j in range(size))


def _eliminate(column: dict[int, int], lows: dict[int, dict[int, int]], modulus: int) -> None:
    """Adds others to a column until it is empty or ends where no other does, and is one of them then."""
    while column:
        low = max(column)
        other = lows.get(low)
        if other is None:
            lows[low] = column
            return
        factor = column[low] * pow(other[low], -1, modulus) % modulus
        for row, value in other.items():
            left = (column.get(row, 0) - factor * value) % modulus
            if left:
                column[row] = left
            else:
                column.pop(row, None)
