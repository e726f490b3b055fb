"""VTK's XML files of unstructured grids, with raw appended data."""

from __future__ import annotations

import base64
import dataclasses
import re
from collections.abc import Iterator
from typing import BinaryIO, Callable

import numpy as np

from .._complex import in_space
from .._version import __version__
from .writing import Cells, Shape

_TYPES = {
    "<f8": "Float64",
    "<i8": "Int64",
    "<i4": "Int32",
    "<u8": "UInt64",
    "|u1": "UInt8",
}
CELL_TYPES = {0: 1, 1: 3, 2: 5, 3: 10}  # vertex, line, triangle, tetrahedron
_ROWS = 1 << 16  # at a time, of what is not given in blocks

DIMENSIONS = (1, 2, 3)


@dataclasses.dataclass
class _Array:
    """An appended array, and where it is in the file."""

    kind: str
    name: str
    components: int
    rows: int
    section: str
    place: int = 0  # in the appended data, of the byte count before it
    written: int = -1  # without that; -1: nor that

    @property
    def size(self) -> int:
        return self.rows * self.components * np.dtype(self.kind).itemsize

    def tag(self) -> str:
        return (
            f'<DataArray type="{_TYPES[self.kind]}" Name="{self.name}" '
            f'NumberOfComponents="{self.components}" format="appended" offset="{self.place}"/>\n'
        )


class VtuWriter:
    """A MeshWriter. Wider numbers come first in the file: each number begins at a multiple of its size,
    so that a file can be mapped into memory."""

    def __init__(self, file: BinaryIO, shape: Shape) -> None:
        self._file, self._shape = file, shape
        n, m, d = shape.vertices, shape.simplices, shape.ambient_dimension
        ids = sum(group.count * (group.dimension + 1) for group in shape.groups)
        every = {"points": _Array("<f8", "Points", 3, n, "Points")}
        if d > 3:
            every["coordinates"] = _Array("<f8", "coordinates", d, n, "PointData")
        if shape.walls is not None:
            every["point walls"] = _Array("<u8", "walls", 1, n, "PointData")
        every["connectivity"] = _Array("<i8", "connectivity", 1, ids, "Cells")
        every["offsets"] = _Array("<i8", "offsets", 1, m, "Cells")
        for name, kind, components, is_there in (
            ("walls", "<u8", 1, len(shape.groups) > 1 or shape.has_labels),
            ("group", "<i4", 1, len(shape.groups) > 1 or shape.has_labels),
            ("region", "<i4", 1, shape.has_labels),
            ("sides", "<i4", 2, shape.has_labels),
        ):
            if is_there:
                every[name] = _Array(kind, name, components, m, "CellData")
        every["types"] = _Array("|u1", "types", 1, m, "Cells")
        place = 0
        for array in every.values():
            array.place = place
            place += 8 + array.size
        self._arrays = every
        head = self._head().encode()
        self._data, self._end = len(head), 0  # where appended data begin, and what is written
        self._put(0, head)

    def _head(self) -> str:
        shape = self._shape
        fields = "".join(_field(name, values) for name, values in _field_data(shape).items())
        head = (
            '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="1.0" '
            'byte_order="LittleEndian" header_type="UInt64">\n<UnstructuredGrid>\n'
            f"<FieldData>\n{fields}</FieldData>\n"
            f'<Piece NumberOfPoints="{shape.vertices}" NumberOfCells="{shape.simplices}">\n'
        )
        for section in ("Points", "Cells", "PointData", "CellData"):
            inside = [array for array in self._arrays.values() if array.section == section]
            if section == "CellData":  # by the order of their numbers' sizes in the file alone
                inside.sort(key=lambda array: array.name != "group")
            if inside:
                tags = "".join(array.tag() for array in inside)
                head += f"<{section}>\n{tags}</{section}>\n"
        head += '</Piece>\n</UnstructuredGrid>\n<AppendedData encoding="raw">\n'
        return head + " " * (-(len(head.encode()) + 1) % 8) + "_"

    def _put(self, place: int, data: bytes) -> None:
        if place != self._end:  # which pipes cannot do
            self._file.seek(place)
        self._file.write(data)
        self._end = place + len(data)

    def _append(self, name: str, values: np.ndarray) -> None:
        array = self._arrays[name]
        begin = self._data + array.place
        if array.written < 0:
            self._put(begin, np.uint64(array.size).astype("<u8").tobytes())
            array.written = 0
        data = np.ascontiguousarray(values, dtype=array.kind).tobytes()
        self._put(begin + 8 + array.written, data)
        array.written += len(data)

    def add_points(self, points: np.ndarray) -> None:
        self._append("points", in_space(points))
        if "coordinates" in self._arrays:
            self._append("coordinates", points)

    def _add_walls(self) -> None:
        walls, n = self._shape.walls, self._shape.vertices
        if walls is None or self._arrays["point walls"].written >= 0:
            return
        self._append("point walls", np.empty(0))
        for first in range(0, n, _ROWS):
            self._append("point walls", walls.rows(first, min(n, first + _ROWS)))

    def add_cells(self, group: int, cells: np.ndarray) -> None:
        self._add_walls()
        for first in range(0, len(cells), _ROWS):
            self._append("connectivity", cells[first : first + _ROWS])

    def finish(self) -> None:
        nothing = np.empty(0)
        for name in ("points", "coordinates"):
            if name in self._arrays:
                self._append(name, nothing)  # where there was none
        self._add_walls()
        self._append("connectivity", nothing)
        last = 0
        self._append("offsets", nothing)
        for group, _, count in self._blocks():
            ends = last + (group.dimension + 1) * np.arange(1, count + 1)
            self._append("offsets", ends)
            last = int(ends[-1])
        self._fill("walls", lambda group: np.uint64(group.bits))
        self._fill("group", lambda group: group.tag)
        self._fill("region", lambda group: group.label)
        if "sides" in self._arrays:
            self._append("sides", nothing)
            for group, first, count in self._blocks():
                sides = group.sides
                self._append(
                    "sides",
                    np.zeros((count, 2)) if sides is None else sides[first : first + count],
                )
        self._fill("types", lambda group: CELL_TYPES[group.dimension])
        types = self._arrays["types"]
        self._put(self._data + types.place + 8 + types.size, b"\n</AppendedData>\n</VTKFile>\n")

    def _blocks(self) -> Iterator[tuple[Cells, int, int]]:
        """The cells, some at a time: their group, the first one's number in it, how many they are."""
        for group in self._shape.groups:
            for first in range(0, group.count, _ROWS):
                yield group, first, min(_ROWS, group.count - first)

    def _fill(self, name: str, of: Callable[[Cells], int | np.uint64]) -> None:
        """An array with one number for all cells of a group."""
        if name not in self._arrays:
            return
        kind = self._arrays[name].kind
        self._append(name, np.empty(0))
        for group, _, count in self._blocks():
            self._append(name, np.full(count, of(group), dtype=kind))


def _field_data(shape: Shape) -> dict[str, np.ndarray]:
    """What a file says of the whole mesh. Text is UTF-8: bytes are what every reader takes."""
    report = shape.report
    data = {"version": _text(f"stellate {__version__}")}
    if len(shape.groups) > 1:
        data["groups"] = _text("".join(f"{group.name}\n" for group in shape.groups))
    if report is not None:
        data["certified"] = np.array([report.certified], dtype=np.uint8)
        data["verdict"] = _text(report.certificate.verdict)
        if report.epsilon:
            data["epsilon"] = np.array([report.epsilon])
    return data


def _text(text: str) -> np.ndarray:
    return np.frombuffer(text.encode(), dtype=np.uint8)


def _field(name: str, values: np.ndarray) -> str:
    """A DataArray with its numbers inline: base64 of the byte count and the bytes."""
    kind = values.dtype.newbyteorder("<")
    raw = np.ascontiguousarray(values, dtype=kind).tobytes()
    inline = base64.b64encode(np.uint64(len(raw)).astype("<u8").tobytes() + raw).decode()
    return (
        f'<DataArray type="{_TYPES[kind.str]}" Name="{name}" NumberOfComponents="1" '
        f'NumberOfTuples="{len(values)}" format="binary">{inline}</DataArray>\n'
    )


def mapped(path: str, name: str) -> np.ndarray:
    """An appended array of a file that a VtuWriter wrote, (rows, components), on the disk."""
    head = b""
    with open(path, "rb") as file:
        for line in file:
            head += line
            if line.lstrip().startswith(b"<AppendedData"):
                break
        begin = len(head)
        file.seek(begin)
        begin += file.read(8).index(b"_") + 1
        pattern = (
            rb'type="(\w+)" Name="%s" NumberOfComponents="(\d+)" format="appended" offset="(\d+)"'
        )
        found = re.search(pattern % name.encode(), head)
        assert found is not None
        kind = {word: kind for kind, word in _TYPES.items()}[found[1].decode()]
        place = begin + int(found[3])
        file.seek(place)
        size = int.from_bytes(file.read(8), "little")
    shape = (size // np.dtype(kind).itemsize // int(found[2]), int(found[2]))
    if size == 0:
        return np.empty(shape, kind)  # which cannot be mapped
    return np.memmap(path, kind, "r", place + 8, shape)
