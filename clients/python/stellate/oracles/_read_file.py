"""A program: reads a file of polygons by meshio, writes points and triangles to standard output.

It is a process of its own since meshio takes damaged files in every way there is: by exceptions of any
class, by sys.exit, by asking for all memory, and by reading on for ever where a file ends too soon.
"""

from __future__ import annotations

import builtins
import contextlib
import io
import os
import resource
import sys
from typing import Any

import numpy as np

_builtin_open = open
# Times in a row before it is taken for a loop; right readers do it once or twice.
_END_IS_READ = 1000
# Of Python and numpy; of lists of Python's objects, for each byte of the file.
_BYTES, _BYTES_A_BYTE = 1 << 30, 200


def main(path: str) -> None:
    import meshio

    most = resource.getrlimit(resource.RLIMIT_AS)[1]
    wanted = _BYTES + _BYTES_A_BYTE * os.path.getsize(path)
    with contextlib.suppress(ValueError):  # macOS has no such limit
        resource.setrlimit(resource.RLIMIT_AS, (wanted if most < 0 else min(wanted, most), most))
    builtins.open = _open  # type: ignore[assignment]  # meshio's
    with contextlib.redirect_stdout(sys.stderr):
        mesh = meshio.read(path)
    corners: list[Any] = [np.empty((0, 3), np.int64)]
    for block in mesh.cells:
        if block.type in ("triangle", "quad", "polygon"):
            polygons = np.asarray(block.data)
            for i in range(2, polygons.shape[1]):
                corners.append(polygons[:, [0, i - 1, i]])
    found = io.BytesIO()
    np.savez(
        found,
        points=np.asarray(mesh.points, dtype=float),
        triangles=np.concatenate(corners).astype(np.int64),
        kinds=np.array(sorted({block.type for block in mesh.cells}), dtype=str),
    )
    sys.stdout.buffer.write(found.getvalue())


def _count(line: bytes | str, ends: int) -> int:
    """How often in a row the end was read. Raises EOFError where it is read for ever."""
    if line:
        return 0
    if ends == _END_IS_READ:
        raise EOFError("the file ends too soon")
    return ends + 1


class _Binary(io.BufferedReader):
    _ends = 0

    def readline(self, size: int | None = -1, /) -> bytes:
        line = super().readline(size)
        self._ends = _count(line, self._ends)
        return line


class _Text(io.TextIOWrapper):
    _ends = 0

    def readline(self, size: int = -1, /) -> str:  # type: ignore[override]
        line = super().readline(size)
        self._ends = _count(line, self._ends)
        return line


def _open(path: Any, mode: str = "r", *args: Any, **kwargs: Any) -> Any:
    if mode not in ("r", "rt", "rb"):
        return _builtin_open(path, mode, *args, **kwargs)
    raw = _Binary(io.FileIO(path))
    return raw if "b" in mode else _Text(raw)


if __name__ == "__main__":
    try:
        main(sys.argv[1])
    except BaseException as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        sys.exit(1)
