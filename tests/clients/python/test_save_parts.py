"""Files for printers, scenes, numpy and FEniCS, read back by others' code or by the formats' own rules."""

import dataclasses
import json
import struct
import xml.etree.ElementTree as ElementTree
import zipfile

import meshio
import numpy as np
import pytest
import shapes
import stellate
from test_save import finished
from test_save_solids import hollow_cube

CORE = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"


def halves(cells=2):
    """A cube of two regions, left and right of a plane, with walls: its six sides, and the plane."""
    cube = hollow_cube(4)
    keep = (cube.points[cube.simplices] >= cells).all(axis=(1, 2))  # which has no cavity
    used, rows = np.unique(cube.simplices[keep], return_inverse=True)
    points, rows = cube.points[used] - cells, rows.reshape(-1, 4)
    walls = np.zeros(len(points), dtype=np.uint64)
    for axis in range(3):
        walls |= np.where(points[:, axis] == 0, 1 << axis, 0).astype(np.uint64)
        walls |= np.where(points[:, axis] == cells, 8 << axis, 0).astype(np.uint64)
    walls |= np.where(points[:, 0] == 1, 64, 0).astype(np.uint64)
    labels = np.where(points[rows].mean(axis=1)[:, 0] < 1, 1, 2).astype(np.int8)
    return stellate.Mesh(
        points, rows, walls=walls, labels=labels, region_names=("left & low", "right")
    )


def volume(points, triangles):
    return np.linalg.det(points[triangles]).sum() / 6


def objects_of_3mf(path):
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        names = archive.namelist()
        assert names[0] == "[Content_Types].xml" and "_rels/.rels" in names
        root = ElementTree.fromstring(archive.read("3D/3dmodel.model"))
    assert root.get("unit") == "millimeter"
    found = {}
    for thing in root.iter(f"{CORE}object"):
        points = [[float(v.get(c)) for c in "xyz"] for v in thing.iter(f"{CORE}vertex")]
        rows = [[int(t.get(f"v{i}")) for i in (1, 2, 3)] for t in thing.iter(f"{CORE}triangle")]
        found[thing.get("name")] = thing.get("type"), np.array(points), np.array(rows)
    assert len(list(root.iter(f"{CORE}item"))) == len(found)
    return found


def test_3mf_has_an_object_for_each_region(tmp_path):
    halves().save(tmp_path / "two.3mf")
    found = objects_of_3mf(tmp_path / "two.3mf")
    assert list(found) == ["left_&_low", "right"]
    for kind, points, rows in found.values():
        assert kind == "model" and volume(points, rows) == pytest.approx(4)
    hollow_cube().save(tmp_path / "hollow.3mf")
    ((kind, points, rows),) = objects_of_3mf(tmp_path / "hollow.3mf").values()
    assert kind == "model" and volume(points, rows) == pytest.approx(4**3 - 1)


def test_3mf_of_an_open_surface_is_no_solid(tmp_path):
    torus = shapes.torus()
    torus.save(tmp_path / "torus.3mf")
    torus.save(tmp_path / "again.3mf")
    assert (tmp_path / "torus.3mf").read_bytes() == (tmp_path / "again.3mf").read_bytes()
    ((kind, points, rows),) = objects_of_3mf(tmp_path / "torus.3mf").values()
    assert kind == "model" and np.array_equal(points, torus.points)
    stellate.Mesh(torus.points, torus.simplices[1:]).save(tmp_path / "open.3mf")
    ((kind, _, rows),) = objects_of_3mf(tmp_path / "open.3mf").values()
    assert kind == "surface" and len(rows) == len(torus.simplices) - 1


def meshes_of_glb(path):
    """The JSON, and for each mesh its primitives' positions, normals and triangles."""
    raw = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", raw)
    assert (magic, version, length) == (b"glTF", 2, len(raw))
    size, kind = struct.unpack_from("<I4s", raw, 12)
    assert kind == b"JSON" and size % 4 == 0
    text = json.loads(raw[20 : 20 + size])
    body_size, kind = struct.unpack_from("<I4s", raw, 20 + size)
    assert kind == b"BIN\0" and 28 + size + body_size == len(raw)
    body = raw[28 + size :]
    assert text["buffers"] == [{"byteLength": body_size}]

    def read(number):
        accessor = text["accessors"][number]
        view = text["bufferViews"][accessor["bufferView"]]
        width = {"SCALAR": 1, "VEC3": 3}[accessor["type"]]
        kind = {5126: "<f4", 5125: "<u4"}[accessor["componentType"]]
        values = np.frombuffer(body, kind, accessor["count"] * width, view["byteOffset"])
        assert values.nbytes == view["byteLength"]
        values = values.reshape(-1, width)
        if "min" in accessor:
            assert accessor["min"] == values.min(axis=0).tolist()
            assert accessor["max"] == values.max(axis=0).tolist()
        return values

    return text, [
        [
            (
                read(p["attributes"]["POSITION"]),
                read(p["attributes"]["NORMAL"]),
                read(p["indices"]).reshape(-1, 3),
            )
            for p in mesh["primitives"]
        ]
        for mesh in text["meshes"]
    ]


def test_glb_has_a_node_a_region_and_a_material_a_wall(tmp_path):
    halves().save(tmp_path / "two.glb")
    text, meshes = meshes_of_glb(tmp_path / "two.glb")
    assert [node["name"] for node in text["nodes"]] == ["left_&_low", "right"]
    for mesh in meshes:
        assert len(mesh) == 6  # five sides, and the plane
        assert sum(volume(points, rows) for points, _, rows in mesh) == pytest.approx(4)
        for points, normals, rows in mesh:  # flat patches, whose normals are their own
            across = np.cross(*(points[rows[:, i]] - points[rows[:, 0]] for i in (1, 2)))
            assert (np.abs(normals).max(axis=1) == 1).all()
            assert (across @ normals[0] > 0).all()
    names = {material["name"] for material in text["materials"]}
    assert len(names) == 12 and "right_wall_3" in names and "left_&_low_wall_6" in names


def test_glb_of_a_smooth_surface_has_its_normals(tmp_path):
    torus = shapes.torus(40, 25)
    torus.save(tmp_path / "torus.glb")
    _, (((points, normals, rows),),) = meshes_of_glb(tmp_path / "torus.glb")
    assert len(points) == len(torus.points) and len(rows) == len(torus.simplices)
    ring = points * [1, 1, 0] / np.hypot(points[:, 0], points[:, 1])[:, None]
    assert ((normals * (points - ring)).sum(axis=1) > 0.99 * 0.4).all()


def test_glb_is_refused_where_vertices_would_fall_together(tmp_path):
    far = stellate.Mesh(shapes.torus().points + 1e8, shapes.torus().simplices)
    with pytest.raises(stellate.SaveError, match="glb has single precision"):
        far.save(tmp_path / "far.glb")
    assert not list(tmp_path.iterdir())
    for ending in (".glb", ".3mf"):
        nothing = stellate.Mesh(np.eye(3), np.empty((0, 3), dtype=int))
        with pytest.raises(stellate.SaveError, match=f"no triangle, and {ending}"):
            nothing.save(tmp_path / f"nothing{ending}")
        with pytest.raises(stellate.SaveError, match="dimension 1"):
            shapes.polygon(5, 3).save(tmp_path / f"polygon{ending}")


@pytest.mark.parametrize("mesh", [shapes.simplex_boundary(4), halves(), shapes.polygon(5, 7)])
def test_npz_is_exact(mesh, tmp_path):
    mesh.save(tmp_path / "mesh.npz")
    with np.load(tmp_path / "mesh.npz", allow_pickle=False) as again:
        for name in ("points", "simplices", "walls", "labels", "places", "smoothed"):
            known = getattr(mesh, name)
            assert (known is None) == (name not in again.files)
            if known is not None:
                assert again[name].dtype == known.dtype
                assert again[name].tobytes() == known.tobytes()
        names = again["region_names"].tolist() if mesh.region_names else []
    assert tuple(names) == mesh.region_names


def test_npz_says_what_became_of_the_mesh(tmp_path):
    torus = shapes.torus()
    places = np.array(["OK"] * len(torus.points), dtype=object)
    mesh = dataclasses.replace(finished(torus, True), places=places)
    mesh.save(tmp_path / "mesh.npz")
    with np.load(tmp_path / "mesh.npz", allow_pickle=False) as again:
        assert again["certified"] and float(again["epsilon"]) == 0.1
        assert str(again["verdict"]) == mesh.report.certificate.verdict
        assert again["places"].tolist() == places.tolist()


def test_xdmf_pairs_have_regions_and_walls(tmp_path):
    mesh = halves()
    mesh.save(tmp_path / "two.xdmf")
    cells = meshio.read(tmp_path / "two.xdmf")
    facets = meshio.read(tmp_path / "two_facets.xdmf")
    assert np.array_equal(cells.points, mesh.points) and np.array_equal(facets.points, mesh.points)
    assert cells.cell_data["region"][0].tolist() == mesh.labels.tolist()
    rows, walls = facets.cells_dict["triangle"], facets.cell_data["wall"][0]
    assert set(walls.tolist()) == set(range(1, 8))
    assert (facets.points[rows[walls == 4]][:, :, 0] == 2).all()  # wall 3, x = 2
    assert (facets.points[rows[walls == 7]][:, :, 0] == 1).all()  # between the regions
    shapes.torus().save(tmp_path / "torus.xdmf")
    assert not (tmp_path / "torus_facets.xdmf").exists()
    assert len(list(tmp_path.iterdir())) == 3


def test_facets_of_an_earlier_mesh_go(tmp_path):
    halves().save(tmp_path / "a.xdmf")
    assert (tmp_path / "a_facets.xdmf").exists()
    shapes.torus().save(tmp_path / "a.xdmf")
    assert [file.name for file in tmp_path.iterdir()] == ["a.xdmf"]
    halves().save(tmp_path / "a.xdmf")
    with pytest.raises(stellate.SaveError):  # which is not written
        stellate.Mesh(np.eye(3), np.empty((0, 3), dtype=int)).save(tmp_path / "a.xdmf")
    assert (tmp_path / "a_facets.xdmf").exists()


def test_what_others_call_facets_stays(tmp_path):
    mine = tmp_path / "a_facets.xdmf"
    mine.write_text("<Xdmf>not a pair's</Xdmf>")
    shapes.torus().save(tmp_path / "a.xdmf")
    assert mine.read_text() == "<Xdmf>not a pair's</Xdmf>"


def test_xdmf_of_the_plane_has_two_coordinates(tmp_path):
    square = stellate.Mesh(
        np.array([[0, 0], [1, 0], [0, 1], [1, 1.0]]), np.array([[0, 1, 2], [1, 2, 3]])
    )
    square.save(tmp_path / "square.xdmf")
    assert meshio.read(tmp_path / "square.xdmf").points.shape == (4, 2)
