"""Files of meshes with boundary: what finite elements read, from both languages, and that both agree
on the mesh. Groups are read back by meshio."""

import json
import os
import pathlib
import subprocess

import meshio
import numpy as np
import pytest
import stellate
from stellate import manifolds, oracles

PIPE = pathlib.Path(__file__).resolve().parents[3] / "clients" / "pipe"
ROOM = ([-1.3] * 3, [1.3] * 3)


def cylinder():
    return oracles.Solid(
        [
            oracles.HalfSpace([0, 0, 1], -1),
            oracles.HalfSpace([0, 0, -1], -1),
            lambda x: 1 - x[:, 0] ** 2 - x[:, 1] ** 2,
        ],
        ROOM,
    )


# As clients/cpp/oracles/ready/domains.cc makes them, with what they come to.
DOMAINS = {
    "hemisphere": (
        lambda: oracles.Clipped(manifolds.Sphere(2), [oracles.HalfSpace([0, 0, 1])]),
        0.3,
    ),
    "half-torus": (
        lambda: oracles.Clipped(manifolds.Torus(), [oracles.HalfSpace([1, 0, 0])]),
        0.16,
    ),
    "cube": (lambda: oracles.Solid([], ROOM, box=([-1] * 3, [1] * 3)), 0.65),
    "ball": (lambda: oracles.Solid([], ROOM, ball=([0] * 3, 1)), 0.35),
    "cylinder": (cylinder, 0.3),
}


def by_command_line(server, what, epsilon, *outputs):
    """The report of the C++ command line."""
    program = pathlib.Path(os.environ["STELLATED"]).parent / "stellate"
    files = [argument for path in outputs for argument in ("-o", str(path))]
    command = [program, "mesh", *what, "-e", str(epsilon), "--json", "--server", server.address]
    done = subprocess.run([*command, *files], check=True, capture_output=True, text=True)
    return json.loads(done.stdout)


@pytest.mark.parametrize("name", DOMAINS)
def test_both_languages_know_the_same_domains(name, server, tmp_path):
    make, epsilon = DOMAINS[name]
    ours = stellate.mesh(make(), epsilon, server=server)
    theirs = by_command_line(server, [name], epsilon, tmp_path / "a.msh")
    assert theirs["certificate"]["certified"] and ours.certified
    for key in ("euler_characteristic", "components", "orientable"):
        assert theirs["certificate"][key] == getattr(ours.report.certificate, key)
    ours.save(tmp_path / "b.msh")
    a, b = (meshio.read(tmp_path / file, "gmsh") for file in ("a.msh", "b.msh"))
    assert {k: v.tolist() for k, v in a.field_data.items()} == {
        k: v.tolist() for k, v in b.field_data.items()
    }
    if name == "cube":  # where both languages' rounding decides alike
        assert np.allclose(a.points, b.points, rtol=0, atol=1e-12)
        for kind, rows in a.cells_dict.items():
            assert np.array_equal(np.sort(rows, axis=1), np.sort(b.cells_dict[kind], axis=1))


@pytest.mark.parametrize(
    "command",
    [f"perl {PIPE}/half_torus.pl", f"mawk -W interactive -f {PIPE}/half_torus.awk"],
)
def test_both_languages_make_the_same_mesh_of_the_same_answers(command, server, tmp_path):
    with stellate.CommandOracle(command) as oracle:
        ours = stellate.mesh(oracle, 0.16, server=server)
    by_command_line(server, ["--oracle-command", command], 0.16, tmp_path / "a.vtu")
    ours.save(tmp_path / "b.vtu")
    a, b = (meshio.read(tmp_path / file) for file in ("a.vtu", "b.vtu"))
    assert np.array_equal(a.points, b.points)
    assert [block.type for block in a.cells] == [block.type for block in b.cells]
    for mine, other in zip(a.cells, b.cells):
        assert np.array_equal(mine.data, other.data)
    for key in ("walls", "group"):
        assert all(np.array_equal(x, y) for x, y in zip(a.cell_data[key], b.cell_data[key]))
    assert np.array_equal(a.point_data["walls"], b.point_data["walls"])
    assert [face.walls for face in ours.boundary] == [(0,)] and ours.certified


@pytest.fixture(scope="module")
def cubes(server, tmp_path_factory):
    """The same cube in files of both languages, and the mesh."""
    folder = tmp_path_factory.mktemp("cubes")
    mesh = stellate.mesh(DOMAINS["cube"][0](), DOMAINS["cube"][1], server=server)
    for ending in ("msh", "vtu", "obj", "vtk"):
        mesh.save(folder / f"python.{ending}")
    outputs = (folder / f"cpp.{ending}" for ending in ("msh", "vtu", "obj"))
    by_command_line(server, ["cube"], DOMAINS["cube"][1], *outputs)
    return mesh, folder


def group(file, name):
    """The simplices of a physical group, by its name."""
    tag, dimension = file.field_data[name]
    kind = {0: "vertex", 1: "line", 2: "triangle", 3: "tetra"}[dimension]
    tags = file.cell_data_dict["gmsh:physical"][kind]
    return file.cells_dict[kind][tags == tag]


@pytest.mark.parametrize("language", ["python", "cpp"])
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


@pytest.mark.parametrize("file", ["python.vtu", "cpp.vtu", "python.vtk"])
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


@pytest.mark.parametrize("language", ["python", "cpp"])
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
        text = (tmp_path / f"a.{ending}").read_bytes().decode(errors="replace")
        assert "PhysicalNames" not in text and "walls" not in text and "\ng " not in text


def test_surfaces_of_the_plane_are_saved_as_any(server, tmp_path):
    square = stellate.mesh(oracles.Solid([], box=([0, 0], [1, 1])), 0.2, server=server)
    for ending in ("stl", "ply", "off", "obj", "msh"):
        square.save(tmp_path / f"a.{ending}")
    again = meshio.read(tmp_path / "a.stl")
    a, b, c = np.moveaxis(np.asarray(again.points, float)[again.cells_dict["triangle"]], 1, 0)
    areas = np.cross(b - a, c - a)[:, 2] / 2
    assert areas.min() > 0 and abs(areas.sum() - 1) < 1e-6
    by_command_line(server, ["cube:2"], 0.3, tmp_path / "b.stl")
    assert meshio.read(tmp_path / "b.stl").cells_dict["triangle"].size > 0
