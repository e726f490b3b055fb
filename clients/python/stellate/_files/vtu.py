"""VTK's XML files of unstructured grids."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Iterator

import numpy as np

from .._complex import Complex, in_space
from .._version import __version__
from .groups import Group, groups, label_data

_TYPES = {
    "<f8": "Float64",
    "<i8": "Int64",
    "<i4": "Int32",
    "<u8": "UInt64",
    "<u4": "UInt32",
    "|u1": "UInt8",
}
CELL_TYPES = {0: 1, 1: 3, 2: 5, 3: 10}  # vertex, line, triangle, tetrahedron
_BLOCK_BYTES = 1 << 20

DIMENSIONS = (1, 2, 3)


def lines(mesh: Complex, cells: np.ndarray) -> Iterator[str]:
    """The file of a mesh with these oriented cells, k in DIMENSIONS."""
    n, d = mesh.points.shape
    every = groups(mesh, cells)
    counts = [len(group.simplices) for group in every]
    widths = np.repeat([group.dimension + 1 for group in every], counts)
    kinds = [CELL_TYPES[group.dimension] for group in every]
    yield '<?xml version="1.0"?>'
    yield (
        '<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" '
        'header_type="UInt64" compressor="vtkZLibDataCompressor">'
    )
    yield "<UnstructuredGrid>"
    yield "<FieldData>"
    for name, values in field_data(mesh, every).items():
        yield _array(name, values, f'NumberOfTuples="{len(values)}"')
    yield "</FieldData>"
    yield f'<Piece NumberOfPoints="{n}" NumberOfCells="{sum(counts)}">'
    yield "<Points>"
    yield _array("Points", in_space(mesh.points))
    yield "</Points>"
    yield "<Cells>"
    yield _array("connectivity", np.concatenate([group.simplices.ravel() for group in every]))
    yield _array("offsets", np.cumsum(widths))
    yield _array("types", np.repeat(np.array(kinds, dtype=np.uint8), counts))
    yield "</Cells>"
    if d > 3 or mesh.walls is not None:
        yield "<PointData>"
        if d > 3:
            yield _array("coordinates", mesh.points)
        if mesh.walls is not None:
            yield _array("walls", mesh.walls)
        yield "</PointData>"
    if len(every) > 1 or mesh.labels is not None:
        bits = np.array([group.bits for group in every], dtype=np.uint64)
        tags = np.array([group.tag for group in every], dtype=np.int32)
        yield "<CellData>"
        yield _array("group", np.repeat(tags, counts))
        yield _array("walls", np.repeat(bits, counts))
        if mesh.labels is not None:
            for name, parts in label_data(every).items():
                yield _array(name, np.concatenate(parts))
        yield "</CellData>"
    yield "</Piece>"
    yield "</UnstructuredGrid>"
    yield "</VTKFile>"


def field_data(mesh: Complex, every: list[Group]) -> dict[str, np.ndarray]:
    """What a file says of the whole mesh. Text is UTF-8: bytes are what every reader takes."""
    report = mesh.report
    data = {"version": _text(f"stellate {__version__}")}
    if len(every) > 1:
        data["groups"] = _text("".join(f"{group.name}\n" for group in every))
    if report is not None:
        data["certified"] = np.array([report.certified], dtype=np.uint8)
        data["verdict"] = _text(report.certificate.verdict)
        if report.epsilon:
            data["epsilon"] = np.array([report.epsilon])
    return data


def _text(text: str) -> np.ndarray:
    return np.frombuffer(text.encode(), dtype=np.uint8)


def _array(name: str, values: np.ndarray, more: str = "") -> str:
    """A DataArray with its numbers inline: base64 of the blocks' sizes, base64 of the blocks."""
    kind = _TYPES[values.dtype.newbyteorder("<").str]
    raw = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<")).tobytes()
    blocks = [zlib.compress(raw[i : i + _BLOCK_BYTES], 1) for i in range(0, len(raw), _BLOCK_BYTES)]
    head = [len(blocks), _BLOCK_BYTES, len(raw) % _BLOCK_BYTES, *map(len, blocks)]
    sizes = np.array(head, dtype="<u8").tobytes()
    inline = base64.b64encode(sizes) + base64.b64encode(b"".join(blocks))
    components = values.shape[1] if values.ndim == 2 else 1
    return (
        f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{components}" {more} '
        f'format="binary">{inline.decode()}</DataArray>'
    )
