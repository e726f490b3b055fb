"""VTK's XML files of unstructured grids."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Iterator

import numpy as np

from .._complex import Complex, in_space
from .._version import __version__

_TYPES = {"<f8": "Float64", "<i8": "Int64", "|u1": "UInt8"}
CELL_TYPES = {1: 3, 2: 5, 3: 10}  # line, triangle, tetrahedron
_BLOCK_BYTES = 1 << 20

DIMENSIONS = tuple(CELL_TYPES)


def lines(mesh: Complex, cells: np.ndarray) -> Iterator[str]:
    """The file of a mesh with these oriented cells, k in DIMENSIONS."""
    n, d = mesh.points.shape
    m, width = cells.shape
    yield '<?xml version="1.0"?>'
    yield (
        '<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" '
        'header_type="UInt64" compressor="vtkZLibDataCompressor">'
    )
    yield "<UnstructuredGrid>"
    yield "<FieldData>"
    for name, values in field_data(mesh).items():
        yield _array(name, values, f'NumberOfTuples="{len(values)}"')
    yield "</FieldData>"
    yield f'<Piece NumberOfPoints="{n}" NumberOfCells="{m}">'
    yield "<Points>"
    yield _array("Points", in_space(mesh.points))
    yield "</Points>"
    yield "<Cells>"
    yield _array("connectivity", cells.ravel())
    yield _array("offsets", width * np.arange(1, m + 1))
    yield _array("types", np.full(m, CELL_TYPES[mesh.dimension], dtype=np.uint8))
    yield "</Cells>"
    if d > 3:
        yield "<PointData>"
        yield _array("coordinates", mesh.points)
        yield "</PointData>"
    yield "</Piece>"
    yield "</UnstructuredGrid>"
    yield "</VTKFile>"


def field_data(mesh: Complex) -> dict[str, np.ndarray]:
    """What a file says of the whole mesh. Text is UTF-8: bytes are what every reader takes."""
    report = mesh.report
    data = {"version": _text(f"stellate {__version__}")}
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
