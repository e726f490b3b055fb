"""meshio's way to Stellate's .txt format: `import stellate.meshio_plugin`, once.

Afterwards meshio.read and meshio.write know files that end in .stellate.txt, and file_format="stellate"
for any others. meshio has no way to find plug-ins by itself; for its command line say

    python3 -m stellate.meshio_plugin convert torus.stellate.txt torus.vtu
"""

from __future__ import annotations

import os
import sys
from typing import Any

import numpy as np

from ._files import formats, meshio_formats
from ._mesh import Mesh, load_txt
from .errors import InvalidArgument

FORMAT = "stellate"
ENDING = ".stellate.txt"


def read(path: Any) -> Any:
    """A meshio.Mesh; see Mesh.to_meshio. Raises: meshio.ReadError."""
    import meshio

    try:
        return load_txt(path).to_meshio()
    except (ValueError, InvalidArgument) as error:
        raise meshio.ReadError(str(error)) from error


def write(path: Any, mesh: Any) -> None:
    """Writes the cells of the highest dimension, with all that the others are faces of.

    Raises: meshio.WriteError where they are no simplices.
    """
    import meshio

    names = {name: k for k, name in meshio_formats.CELLS.items() if k > 0}
    kinds = sorted({block.type for block in mesh.cells} - {"vertex"})
    foreign = [kind for kind in kinds if kind not in names]
    if foreign or not kinds:
        raise meshio.WriteError(
            f"{ENDING} holds lines, triangles and tetrahedra; this mesh has {foreign or 'no cells'}"
        )
    cells = mesh.get_cells_type(max(kinds, key=lambda kind: names[kind]))
    cells = np.sort(np.asarray(cells, dtype=np.int64), axis=1)
    points = np.asarray(mesh.point_data.get("coordinates", mesh.points), dtype=float)
    formats.save_txt(Mesh(points, cells[np.lexsort(cells.T[::-1])]), os.fspath(path))


def register() -> None:
    """Makes the format known to meshio. Importing this module has done it."""
    import meshio

    meshio.deregister_format(FORMAT)  # so that a second time does no harm
    meshio.register_format(FORMAT, [ENDING], read, {FORMAT: write})


register()

if __name__ == "__main__":
    from meshio._cli import main

    sys.exit(main(sys.argv[1:]))
