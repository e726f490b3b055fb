"""Files of meshes with boundary: what finite elements read. Groups are read back by meshio."""

import meshio
import numpy as np
import pytest
import stellate
from stellate import manifolds, oracles


@pytest.fixture(scope="module")
def cubes(server, tmp_path_factory):
    """A cube in files, and the mesh."""
    folder = tmp_path_factory.mktemp("cubes")
    mesh = stellate.mesh(oracles.Solid(box=([-1] * 3, [1] * 3)), 0.5, server=server)
    for ending in ("msh", "vtu", "obj", "vtk"):
        mesh.save(folder / f"python.{ending}")
    return mesh, folder


def group(file, name):
    """The simplices of a physical group, by its name."""
    tag, dimension = file.field_data[name]
    kind = {0: "vertex", 1: "line", 2: "triangle", 3: "tetra"}[dimension]
    tags = file.cell_data_dict["gmsh:physical"][kind]
    return file.cells_dict[kind][tags == tag]


@pytest.mark.parametrize("language", ["python"])
def test_msh_has_a_physical_group_for_each_face(cubes, language):
    mesh, folder = cubes
    file = meshio.read(folder / f"{language}.msh", "gmsh")
    names = {"inside"}
    for dimension in range(3):
        for face in mesh.faces(dimension):
            name = ("walls_" if len(face.walls) > 1 else "wall_") + "_".join(map(str, face.walls))
            rows = np.sort(group(file, name), axis=1)
            assert set(map(tuple, rows)) == set(map(tuple, face.simplices))
            names.add(name)
    assert set(file.field_data) == names and len(names) == 1 + 6 + 12 + 8
    # Areas and volumes are signed: every triangle has its normal outwards, none is turned.
    corners = file.points[group(file, "inside")]
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
    assert volumes.min() > 0 and abs(volumes.sum() - 8) < 1e-9
    for wall in range(6):
        a, b, c = np.moveaxis(file.points[group(file, f"wall_{wall}")], 1, 0)
        outward = np.where(np.arange(3) == wall % 3, -1.0 if wall < 3 else 1.0, 0.0)
        areas = np.cross(b - a, c - a) @ outward / 2
        assert areas.min() > 0 and abs(areas.sum() - 4) < 1e-9
    for edge in (name for name in names if name.count("_") == 2):
        a, b = np.moveaxis(file.points[group(file, edge)], 1, 0)
        assert abs(np.linalg.norm(b - a, axis=1).sum() - 2) < 1e-9


@pytest.mark.parametrize("file", ["python.vtu", "python.vtk"])
def test_vtu_says_of_each_cell_on_which_walls_it_is(cubes, file):
    mesh, folder = cubes
    again = meshio.read(folder / file)
    assert np.array_equal(np.ravel(again.point_data["walls"]), mesh.walls)
    for block, bits in zip(again.cells, again.cell_data["walls"]):
        bits = np.ravel(bits).astype(np.uint64)
        on = np.bitwise_and.reduce(mesh.walls[block.data], axis=1)
        inside = block.type == "tetra"
        assert (bits == (0 if inside else on)).all()
        assert inside or bits.min() > 0
    counts = {kind: len(rows) for kind, rows in again.cells_dict.items()}
    assert counts["tetra"] == len(mesh.simplices)
    assert counts["triangle"] == sum(len(face.simplices) for face in mesh.boundary)
    assert counts["vertex"] == 8


@pytest.mark.parametrize("language", ["python"])
def test_obj_is_the_boundary_of_a_solid_in_groups(cubes, language):
    mesh, folder = cubes
    groups, name = {}, ""
    for line in (folder / f"{language}.obj").read_text().splitlines():
        kind, *rest = line.split()
        if kind == "g":
            (name,) = rest
        elif kind != "v":
            groups.setdefault((name, kind), []).append(tuple(sorted(int(i) - 1 for i in rest)))
    for face in mesh.boundary:
        assert groups[f"wall_{face.walls[0]}", "f"] == list(map(tuple, face.simplices))
    assert sum(kind == "l" for _, kind in groups) == 12
    assert sum(kind == "p" for _, kind in groups) == 8


def test_meshes_without_boundary_keep_their_files(server, tmp_path):
    mesh = stellate.mesh(manifolds.Sphere(2), 0.5, server=server)
    for ending in ("msh", "vtu", "obj"):
        mesh.save(tmp_path / f"a.{ending}")
        text = (tmp_path / f"a.{ending}").read_text()
        assert "PhysicalNames" not in text and "walls" not in text and "\ng " not in text


def test_surfaces_of_the_plane_are_saved_as_any(server, tmp_path):
    square = stellate.mesh(oracles.Solid([], box=([0, 0], [1, 1])), 0.2, server=server)
    for ending in ("stl", "ply", "off", "obj", "msh"):
        square.save(tmp_path / f"a.{ending}")
    again = meshio.read(tmp_path / "a.stl")
    a, b, c = np.moveaxis(np.asarray(again.points, float)[again.cells_dict["triangle"]], 1, 0)
    areas = np.cross(b - a, c - a)[:, 2] / 2
    assert areas.min() > 0 and abs(areas.sum() - 1) < 1e-6
