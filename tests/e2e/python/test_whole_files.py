"""Files that are written whole, .npz .3mf .glb .nas: both languages' say the same of the same mesh."""

import collections
import json
import os
import pathlib
import struct
import subprocess
import xml.etree.ElementTree as ElementTree
import zipfile

import numpy as np
import pytest
import stellate

MATERIALS = ("--material", "grain=ball(0.6)", "--material", "matrix=box(-1,1)-ball(0.6)")
MESHES = {
    "surface": ("torus", "-e", "0.2"),
    "open surface with a wall": ("half-torus", "-e", "0.16"),
    "solid": ("cube", "-e", "0.65"),
    "regions": (*MATERIALS, "-e", "0.35"),
    "boundary alone": (*MATERIALS, "-e", "0.35", "--boundary-only"),
}


def by_command_line(server, what, *outputs):
    """The report of the C++ command line."""
    program = pathlib.Path(os.environ["STELLATED"]).parent / "stellate"
    files = [argument for path in outputs for argument in ("-o", str(path))]
    command = [program, "mesh", *what, "--json", "--server", server.address, *files]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return json.loads(done.stdout)


def mesh_of(path):
    """A mesh from an .npz file."""
    with np.load(path, allow_pickle=False) as arrays:
        names = tuple(arrays["region_names"].tolist()) if "region_names" in arrays else ()
        some = {key: arrays[key] for key in ("walls", "labels") if key in arrays}
        return stellate.Mesh(arrays["points"], arrays["simplices"], region_names=names, **some)


def turned(rows):
    """How often each triangle is there, from its least corner on."""
    rows = np.asarray(rows)
    first = rows.argmin(axis=1)[:, None]
    return collections.Counter(
        map(tuple, np.take_along_axis(rows, (first + np.arange(3)) % 3, axis=1).tolist())
    )


def as_read(path):
    """What a .3mf file says: of each object its name and kind, its points, its triangles."""
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        rest = [archive.read(name) for name in archive.namelist()[:2]]
        root = ElementTree.fromstring(archive.read("3D/3dmodel.model"))
    tag = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"
    said = [
        (
            thing.attrib,
            [[float(v.get(c)) for c in "xyz"] for v in thing.iter(f"{tag}vertex")],
            turned(
                [[int(t.get(f"v{i}")) for i in (1, 2, 3)] for t in thing.iter(f"{tag}triangle")]
            ),
        )
        for thing in root.iter(f"{tag}object")
    ]
    items = [item.attrib for item in root.iter(f"{tag}item")]
    return rest, root.attrib, root.find(f"{tag}metadata").text, said, items


def as_drawn(path):
    """What a .glb file says: its JSON, without where things are in its buffer, and its arrays."""
    raw = path.read_bytes()
    size = struct.unpack_from("<I", raw, 12)[0]
    assert struct.unpack_from("<4sII", raw) == (b"glTF", 2, len(raw)) and size % 4 == 0
    text, body = json.loads(raw[20 : 20 + size]), raw[28 + size :]
    for mesh in text["meshes"]:
        for drawing in mesh["primitives"]:
            assert {"min", "max"} <= set(text["accessors"][drawing["attributes"]["POSITION"]])
    arrays = []
    for accessor, view in zip(text["accessors"], text["bufferViews"]):
        kind = "<u4" if accessor["type"] == "SCALAR" else "<f4"
        count = accessor["count"] * (1 if kind == "<u4" else 3)
        assert view["byteLength"] == 4 * count
        values = np.frombuffer(body, kind, count, view["byteOffset"]).reshape(-1, 3)
        for bound, least in (("min", values.min(axis=0)), ("max", values.max(axis=0))):
            assert accessor.pop(bound, least.tolist()) == least.tolist()
        arrays.append(turned(values) if kind == "<u4" else values)
    return text, arrays


@pytest.mark.parametrize("name", MESHES)
def test_both_languages_write_the_same(name, server, tmp_path):
    files = {ending: tmp_path / f"cpp.{ending}" for ending in ("npz", "3mf", "glb", "nas", "txt")}
    report = by_command_line(server, MESHES[name], *files.values())
    mesh = mesh_of(files["npz"])
    exact = stellate.load_txt(files["txt"])
    assert np.array_equal(mesh.points, exact.points)
    assert np.array_equal(mesh.simplices, exact.simplices)
    assert report["certificate"]["certified"]

    for ending in ("npz", "3mf", "glb"):
        mesh.save(tmp_path / f"python.{ending}")
    assert as_read(files["3mf"]) == as_read(tmp_path / "python.3mf")

    text, arrays = as_drawn(files["glb"])
    ours, expected = as_drawn(tmp_path / "python.glb")
    assert text == ours
    for mine, theirs in zip(arrays, expected):
        if isinstance(mine, collections.Counter):
            assert mine == theirs
        else:
            assert np.allclose(mine, theirs, rtol=0, atol=1e-6)

    mesh.save(tmp_path / "python.nas")
    assert files["nas"].read_bytes() == (tmp_path / "python.nas").read_bytes()

    with np.load(files["npz"]) as mine, np.load(tmp_path / "python.npz") as theirs:
        assert set(mine) - set(theirs) == {"certified", "verdict", "epsilon"}
        for key in theirs:
            assert mine[key].dtype == theirs[key].dtype and np.array_equal(mine[key], theirs[key])
        assert mine["certified"].dtype == bool and mine["certified"]
        assert str(mine["verdict"]) == report["certificate"]["verdict"]
        assert float(mine["epsilon"]) == float(MESHES[name][-1 - (name == "boundary alone")])


def test_npz_takes_any_dimension(server, tmp_path):
    by_command_line(server, ("so3", "-e", "0.4"), tmp_path / "a.npz", tmp_path / "a.txt")
    mesh, exact = mesh_of(tmp_path / "a.npz"), stellate.load_txt(tmp_path / "a.txt")
    assert mesh.dimension == 3 and mesh.ambient_dimension == 9
    assert np.array_equal(mesh.points, exact.points)
    assert np.array_equal(mesh.simplices, exact.simplices)
