"""A growing mesh as files that ParaView plays."""

from __future__ import annotations

import os
import xml.sax.saxutils
from collections.abc import Iterable

from ._files.formats import check_save, save
from ._files.vtu import DIMENSIONS
from ._mesh import Mesh
from .errors import InvalidArgument, SaveError


def save_series(meshes: Iterable[Mesh], path: str | os.PathLike[str], every: int = 1) -> Mesh:
    """Writes a mesh at its revisions: NAME.pvd, which ParaView plays, and NAME_00001.vtu and so on.

        mesh = stellate.save_series(stellate.watch(oracle, epsilon=0.1), "torus.pvd")

    The .pvd file lists what is there at any time, so it can be opened while the mesh grows, and
    opened again. Its time is the revision.

    Args:
      meshes: what stellate.watch gives; or any others, which are numbered where they have no
        revision. k from 1 to 3. Revisions without simplices are passed over.
      path: ends in .pvd.
      every: writes every n-th revision, and the last.

    Returns: the last mesh.
    Raises: SaveError, before anything is taken, where the ending is another; InvalidArgument where
      there is no mesh; OSError.
    """
    root, ending = os.path.splitext(os.fspath(path))
    if ending.lower() != ".pvd":
        raise SaveError(f"a series is a .pvd file with .vtu files beside it, and this is {path}")
    if every < 1:
        raise InvalidArgument(f"every is 1 or more, and is {every}")
    check_save(f"{root}.vtu", DIMENSIONS[0], 3)  # whether the folder can be written to
    steps: list[tuple[int, str]] = []
    last: Mesh | None = None
    written = True
    for count, mesh in enumerate(meshes):
        last, written = mesh, False
        if count % every == 0 and len(mesh.simplices):
            _write_step(mesh, root, steps)
            written = True
    if last is None:
        raise InvalidArgument("there is no mesh to make a series of")
    if not written and len(last.simplices):
        _write_step(last, root, steps)
    return last


def _write_step(mesh: Mesh, root: str, steps: list[tuple[int, str]]) -> None:
    before = steps[-1][0] if steps else 0
    time = max(mesh.revision, before + 1)
    name = f"{root}_{time:05d}.vtu"
    check_save(name, mesh.dimension, mesh.ambient_dimension)
    save(mesh, name)
    steps.append((time, name))
    rows = "\n".join(
        f'<DataSet timestep="{step}" file={xml.sax.saxutils.quoteattr(os.path.basename(file))}/>'
        for step, file in steps
    )
    draft = f"{root}.pvd.part"
    with open(draft, "w", encoding="utf-8") as file:
        file.write(
            '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n'
            f"{rows}\n</Collection>\n</VTKFile>\n"
        )
    os.replace(draft, f"{root}.pvd")
