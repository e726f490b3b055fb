"""Binary glTF 2.0, what Blender, three.js and browsers show: a node a region, a material a wall."""

from __future__ import annotations

import colorsys
import json
import struct
from typing import Any

import numpy as np

from .._complex import Complex
from .._version import __version__
from .parts import Part, insist_on_single_precision, parts, smooth_normals

_FLOAT, _UNSIGNED = 5126, 5125
_POINTS, _INDICES = 34962, 34963  # targets of buffers
_Z_UP = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]  # glTF's y is up: a quarter turn brings z there


class _Scene:
    """The file's JSON and its one buffer, as they grow."""

    def __init__(self) -> None:
        self.buffer = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []
        self.materials: list[dict[str, Any]] = []

    def add(self, values: np.ndarray, target: int) -> int:
        """An accessor of (n, 3) floats or (n,) numbers."""
        kind = _FLOAT if values.dtype.kind == "f" else _UNSIGNED
        raw = np.ascontiguousarray(values, dtype="<f4" if kind == _FLOAT else "<u4")
        view = {"buffer": 0, "byteOffset": len(self.buffer), "byteLength": raw.nbytes}
        self.views.append({**view, "target": target})
        self.buffer += raw.tobytes()
        accessor: dict[str, Any] = {"bufferView": len(self.views) - 1, "componentType": kind}
        accessor["count"] = len(raw)
        accessor["type"] = "VEC3" if raw.ndim == 2 else "SCALAR"
        if raw.ndim == 2 and target == _POINTS:
            accessor |= {"min": raw.min(axis=0).tolist(), "max": raw.max(axis=0).tolist()}
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def material(self, name: str) -> int:
        """Of a colour of its own, by the golden section around the circle of hues."""
        hue = (0.58 + 0.618034 * len(self.materials)) % 1
        colour = [round(channel, 4) for channel in colorsys.hsv_to_rgb(hue, 0.45, 0.8)]
        look = {"baseColorFactor": [*colour, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.6}
        known = {"name": name, "pbrMetallicRoughness": look, "doubleSided": True}
        self.materials.append(known)
        return len(self.materials) - 1


def contents(mesh: Complex, cells: np.ndarray) -> bytes:
    """The file of a surface of space, or of a solid, with these cells."""
    every = parts(mesh, cells, ".glb")
    insist_on_single_precision(every, ".glb")
    scene = _Scene()
    meshes = [{"name": p.name, "primitives": _primitives(scene, p)} for p in every]
    nodes = [
        {"name": part.name, "mesh": number, "rotation": _Z_UP} for number, part in enumerate(every)
    ]
    document = {
        "asset": {"version": "2.0", "generator": f"stellate {__version__}"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": scene.materials,
        "accessors": scene.accessors,
        "bufferViews": scene.views,
        "buffers": [{"byteLength": len(scene.buffer)}],
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    body = bytes(scene.buffer)  # of numbers of four bytes each
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(body), b"BIN\0") + body
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _primitives(scene: _Scene, part: Part) -> list[dict[str, Any]]:
    """One for each wall, with points and normals of its own: shading is smooth on each, and not across."""
    found = []
    for name, rows in part.patches:
        used, normals = smooth_normals(part, rows)
        where = np.zeros(len(part.points), dtype=np.uint32)
        where[used] = np.arange(len(used))
        attributes = {
            "POSITION": scene.add(part.points[used], _POINTS),
            "NORMAL": scene.add(normals, _POINTS),
        }
        indices = scene.add(where[part.triangles[rows]].ravel(), _INDICES)
        material = scene.material(f"{part.name}_{name}" if name else part.name)
        found.append({"attributes": attributes, "indices": indices, "material": material})
    return found
