"""Solids of formulas beside libfive's dual contouring: prints a table, asserts nothing.

    LIBFIVE=.../libfive.so STELLATED=... PYTHONPATH=clients/python
        python3 tests/bench/solids/dual_contouring.py

$LIBFIVE is the library that its sources build without their studio and bindings; the crate
`libfive-sys` carries them. Both meshers are given the same formula, in numpy: Stellate traces it,
libfive makes a tree of it, whose derivatives it knows. Its cells are as large as the edges of
Stellate's mesh in the mean; where a face is flat it merges them. Seconds are of the clock, one thread
each, without tracing. `bad edges` are not those of exactly two triangles. The other columns are in
surfaces.py.
"""

import ctypes
import os
import time
from typing import Any

import numpy as np
import stellate
from stellate import solids as s
from surfaces import HEADER, area, line, points_of_edges

_HALF = 1.6  # what the solids are in: [-1.6, 1.6]^3
_CALLS = {
    np.add: "add", np.subtract: "sub", np.multiply: "mul", np.divide: "div", np.minimum: "min",
    np.maximum: "max", np.negative: "neg", np.absolute: "abs", np.sqrt: "sqrt", np.sin: "sin",
    np.cos: "cos", np.square: "square",
}  # fmt: skip


class _Interval(ctypes.Structure):
    _fields_ = [("lower", ctypes.c_float), ("upper", ctypes.c_float)]


class _Region(ctypes.Structure):
    _fields_ = [("x", _Interval), ("y", _Interval), ("z", _Interval)]


class _Mesh(ctypes.Structure):
    _fields_ = [
        ("points", ctypes.POINTER(ctypes.c_float)),
        ("triangles", ctypes.POINTER(ctypes.c_uint32)),
        ("triangle_count", ctypes.c_uint32),
        ("point_count", ctypes.c_uint32),
    ]


def _library() -> ctypes.CDLL:
    library = ctypes.CDLL(os.environ["LIBFIVE"])
    tree = ctypes.c_void_p
    for name, arguments, result in (
        ("libfive_tree_x", [], tree),
        ("libfive_tree_y", [], tree),
        ("libfive_tree_z", [], tree),
        ("libfive_tree_const", [ctypes.c_float], tree),
        ("libfive_tree_unary", [ctypes.c_int, tree], tree),
        ("libfive_tree_binary", [ctypes.c_int, tree, tree], tree),
        ("libfive_opcode_enum", [ctypes.c_char_p], ctypes.c_int),
        ("libfive_tree_render_mesh_st", [tree, _Region, ctypes.c_float], ctypes.POINTER(_Mesh)),
        ("libfive_mesh_delete", [ctypes.POINTER(_Mesh)], None),
    ):
        function = getattr(library, name)
        function.argtypes, function.restype = arguments, result
    return library


_FIVE = _library()


class Tree(np.lib.mixins.NDArrayOperatorsMixin):
    """A formula of libfive's that numpy's functions make."""

    def __init__(self, handle: int) -> None:
        self.handle = handle

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any) -> "Tree":
        handles = [
            i.handle if isinstance(i, Tree) else _FIVE.libfive_tree_const(float(i)) for i in inputs
        ]
        code = _FIVE.libfive_opcode_enum(_CALLS[ufunc].encode())
        make = _FIVE.libfive_tree_unary if len(handles) == 1 else _FIVE.libfive_tree_binary
        return Tree(make(code, *handles))


def dual_contour(tree: Tree, step: float) -> np.ndarray:
    """(n, 3, 3): the triangles, cells being `step` wide. libfive halves its region until they are."""
    half = step
    while half < _HALF:
        half *= 2
    side = _Interval(-half, half)
    found = _FIVE.libfive_tree_render_mesh_st(
        tree.handle, _Region(side, side, side), 1 / (1.001 * step)
    )
    mesh = found.contents
    points = np.ctypeslib.as_array(mesh.points, (mesh.point_count, 3)).astype(float)
    triangles = np.ctypeslib.as_array(mesh.triangles, (mesh.triangle_count, 3)).astype(int)
    _FIVE.libfive_mesh_delete(found)
    return points[triangles]


def bad_edges(corners: np.ndarray) -> int:
    _, ids = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    rows = ids.reshape(-1, 3)
    edges = np.sort(np.concatenate([rows[:, [0, 1]], rows[:, [1, 2]], rows[:, [2, 0]]]), axis=1)
    return int((np.unique(edges, axis=0, return_counts=True)[1] != 2).sum())


def ball(x, y, z, radius=1.0, centre=(0.0, 0.0, 0.0)):
    a, b, c = centre
    return np.sqrt(np.square(x - a) + np.square(y - b) + np.square(z - c)) - radius


def cube(x, y, z, half=1.0, centre=(0.0, 0.0, 0.0)):
    a, b, c = centre
    return np.maximum(np.maximum(abs(x - a), abs(y - b)), abs(z - c)) - half


def rod(x, y, radius=0.5):
    return np.sqrt(x * x + y * y) - radius


def drilled(x, y, z):
    rods = np.minimum(np.minimum(rod(x, y), rod(y, z)), rod(z, x))
    return np.maximum(np.maximum(ball(x, y, z), cube(x, y, z, 0.75)), -rods)


def gyroid(x, y, z):
    g = (
        np.sin(3 * x) * np.cos(3 * y)
        + np.sin(3 * y) * np.cos(3 * z)
        + np.sin(3 * z) * np.cos(3 * x)
    )
    return np.maximum(g, ball(x, y, z, 1.2))


SOLIDS = {
    "box minus ball": (lambda *p: np.maximum(cube(*p, 0.9), -ball(*p, 1.0, (0.9, 0.8, 0.7))), 0.08),
    "drilled block and ball": (drilled, 0.06),
    "two balls joined": (lambda *p: np.minimum(ball(*p, 0.8), ball(*p, 0.7, (0.6, 0.2, 0.1))), 0.08),
    "cube and ball joined": (lambda *p: np.minimum(cube(*p, 0.7), ball(*p, 0.8, (0.5, 0.4, 0.5))), 0.08),
    "cylinder": (lambda x, y, z: np.maximum(rod(x, y, 0.5), abs(z) - 1), 0.08),
    "octahedron": (lambda x, y, z: abs(x) + abs(y) + abs(z) - 1, 0.08),
    "gyroid in a ball": (gyroid, 0.08),
    "torus": (lambda x, y, z: np.sqrt(rod(x, y, 0.8) * rod(x, y, 0.8) + z * z) - 0.3, 0.06),
}  # fmt: skip


def main() -> None:
    print(HEADER)
    axes = (
        Tree(_FIVE.libfive_tree_x()),
        Tree(_FIVE.libfive_tree_y()),
        Tree(_FIVE.libfive_tree_z()),
    )
    box = [-_HALF] * 3, [_HALF] * 3
    with stellate.Server() as server:
        for name, (formula, epsilon) in SOLIDS.items():

            def f(x, formula=formula):
                return formula(x[:, 0], x[:, 1], x[:, 2])

            solid = s.traced(f, box)
            began = time.monotonic()
            mesh = stellate.mesh(solid, epsilon, server=server, boundary_only=True)
            seconds = time.monotonic() - began
            corners = mesh.points[mesh.simplices]
            true = points_of_edges(mesh)
            note = "certified" if mesh.certified else "NOT CERTIFIED"
            line(name, "Stellate", f, corners, true, seconds, epsilon, note)
            tree = formula(*axes)
            began = time.monotonic()
            others = dual_contour(tree, float(np.sqrt(2.2 * area(corners) / len(corners))))
            seconds = time.monotonic() - began
            note = f"{bad_edges(others)} bad edges"
            line(name, "libfive", f, others, true, seconds, epsilon, note)


if __name__ == "__main__":
    main()
