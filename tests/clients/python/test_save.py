"""Files: what is written is read back the same."""

import dataclasses
import importlib.util
import resource
import sys
import warnings

import meshio
import numpy as np
import pytest
import shapes
import stellate
import topology
from stellate._files import formats
from stellate._generated import mesh_pb2


def outward(mesh, cells):
    """Whether every triangle's normal points away from the inside of the torus's tube."""
    a, b, c = (mesh.points[cells[:, i]] for i in range(3))
    centre = (a + b + c) / 3
    ring = centre * [1, 1, 0]
    ring /= np.linalg.norm(ring, axis=1, keepdims=True)
    return bool((np.einsum("ni,ni->n", np.cross(b - a, c - a), centre - ring) > 0).all())


def test_shapes_are_what_they_claim():
    topology.assert_closed_manifold(shapes.torus(), 0, [1, 2, 1])
    topology.assert_closed_manifold(shapes.projective_plane(), 1, [1, 1, 1])
    topology.assert_closed_manifold(shapes.simplex_boundary(3), 0, [1, 0, 0, 1])


def test_the_topology_check_finds_faults():
    torus = shapes.torus().simplices
    assert not topology.is_closed(torus[1:])
    assert not topology.is_closed(np.vstack([torus, torus[:1]]))
    pinched = torus.copy()
    pinched[pinched == 40] = 3  # two vertices far apart made one
    assert topology.is_closed(np.sort(pinched, axis=1)) and not topology.is_manifold(pinched)


@pytest.mark.parametrize(
    "mesh", [shapes.polygon(9, 10), shapes.torus(), shapes.simplex_boundary(4)]
)
def test_txt_is_exact(mesh, tmp_path):
    mesh = stellate.Mesh(mesh.points * np.pi + 1e-17, mesh.simplices)
    mesh.save(tmp_path / "mesh.txt")
    lines = (tmp_path / "mesh.txt").read_text().splitlines()
    k, d = mesh.dimension, mesh.ambient_dimension
    assert lines[0] == f"{k} {d} {len(mesh.points)} {len(mesh.simplices)}"
    assert len(lines) == 1 + len(mesh.points) + len(mesh.simplices)
    assert lines[1] == " ".join(f"{x:.17g}" for x in mesh.points[0])
    again = stellate.load_txt(tmp_path / "mesh.txt")
    assert again.points.tobytes() == mesh.points.tobytes()
    assert np.array_equal(again.simplices, mesh.simplices)


def test_txt_of_something_else_is_refused(tmp_path):
    (tmp_path / "no.txt").write_text("2 3 4 5\n1 2 3\n")
    with pytest.raises(ValueError, match="do not fit"):
        stellate.load_txt(tmp_path / "no.txt")


@pytest.mark.parametrize("extension", [".vtu", ".vtk", ".obj", ".ply", ".off", ".stl", ".msh"])
def test_surfaces_are_read_back_with_outward_normals(extension, tmp_path):
    mesh = shapes.torus()
    mesh.save(tmp_path / f"torus{extension}")
    again = meshio.read(tmp_path / f"torus{extension}")
    cells = again.cells_dict["triangle"]
    if extension != ".stl":  # which has triangles without common vertices
        assert np.array_equal(again.points, mesh.points)
        assert {tuple(row) for row in np.sort(cells, axis=1)} == {
            tuple(row) for row in mesh.simplices
        }
    assert len(cells) == len(mesh.simplices)
    corners = stellate.Mesh(np.asarray(again.points, dtype=float), cells)
    assert outward(corners, cells)


@pytest.mark.parametrize(
    "mesh, cell", [(shapes.polygon(7), "line"), (shapes.simplex_boundary(3), "tetra")]
)
def test_vtu_of_curves_and_solids(mesh, cell, tmp_path):
    mesh.save(tmp_path / "mesh.vtu")
    again = meshio.read(tmp_path / "mesh.vtu")
    assert np.array_equal(np.sort(again.cells_dict[cell], axis=1), mesh.simplices)
    d = min(3, mesh.ambient_dimension)
    assert np.array_equal(again.points[:, :d], mesh.points[:, :d])


def test_vtu_beyond_space_keeps_all_coordinates(tmp_path):
    mesh = shapes.projective_plane()
    mesh.save(tmp_path / "mesh.vtu")
    again = meshio.read(tmp_path / "mesh.vtu")
    assert np.array_equal(again.points, mesh.points[:, :3])
    assert np.array_equal(again.point_data["coordinates"], mesh.points)


def finished(mesh, certified):
    message = mesh_pb2.Report(termination=mesh_pb2.TERMINATION_VERTEX_BUDGET)
    message.certificate.certified = certified
    message.certificate.verdict = "certified: \N{GREEK SMALL LETTER CHI} = 0" if certified else "no"
    return dataclasses.replace(mesh, report=stellate.Report.from_wire(message, 0.1))


def test_vtu_says_what_the_mesh_is(tmp_path):
    mesh = finished(shapes.torus(), True)
    mesh.save(tmp_path / "mesh.vtu")
    said = meshio.read(tmp_path / "mesh.vtu").field_data
    assert said["epsilon"].ravel().tolist() == [0.1]
    assert said["certified"].ravel().tolist() == [1]
    verdict = bytes(said["verdict"].ravel()).decode()
    assert verdict == mesh.report.certificate.verdict == "certified: \u03c7 = 0"
    assert bytes(said["version"].ravel()).decode() == f"stellate {stellate.__version__}"
    shapes.torus().save(tmp_path / "unknown.vtu")
    assert set(meshio.read(tmp_path / "unknown.vtu").field_data) == {"version"}


def test_vtu_of_many_blocks(tmp_path):
    mesh = shapes.torus(400, 301)
    mesh.save(tmp_path / "mesh.vtu")
    again = meshio.read(tmp_path / "mesh.vtu")
    assert again.points.tobytes() == mesh.points.tobytes()
    assert np.array_equal(np.sort(again.cells_dict["triangle"], axis=1), mesh.simplices)


def test_saving_what_is_not_certified_warns(tmp_path):
    mesh = finished(shapes.torus(), False)
    with pytest.warns(stellate.UncertifiedWarning, match="m.txt .*NOT CERTIFIED: no") as caught:
        mesh.save(tmp_path / "m.txt")
    assert caught[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        finished(shapes.torus(), True).save(tmp_path / "m.txt")
        shapes.torus().save(tmp_path / "m.txt")  # of which nothing is known


def test_curve_as_obj_and_ply(tmp_path):
    shapes.polygon(5).save(tmp_path / "c.obj")
    lines = (tmp_path / "c.obj").read_text().splitlines()
    assert sum(line.startswith("v ") for line in lines) == 5
    ends = [tuple(map(int, line.split()[1:])) for line in lines if line.startswith("l ")]
    assert (
        sorted(a for a, _ in ends) == sorted(b for _, b in ends) == [1, 2, 3, 4, 5]
    )  # one way round
    shapes.polygon(5).save(tmp_path / "c.ply")
    header, _, body = (tmp_path / "c.ply").read_bytes().partition(b"end_header\n")
    assert b"binary_little_endian" in header
    assert b"element vertex 5" in header and b"element edge 5" in header
    points = np.frombuffer(body[: 5 * 24], "<f8").reshape(5, 3)
    assert np.array_equal(points[:, :2], shapes.polygon(5).points) and not points[:, 2].any()
    edges = np.frombuffer(body[5 * 24 :], "<i4").reshape(5, 2)
    assert sorted(edges[:, 0]) == sorted(edges[:, 1]) == [0, 1, 2, 3, 4]


def test_off_of_any_dimension(tmp_path):
    mesh = shapes.projective_plane()
    mesh.save(tmp_path / "p.off")
    lines = (tmp_path / "p.off").read_text().splitlines()
    assert lines[:3] == ["nOFF", "5", "6 10 0"]
    assert np.array_equal(np.array([line.split() for line in lines[3:9]], dtype=float), mesh.points)
    assert np.array_equal([list(map(int, line.split()[1:])) for line in lines[9:]], mesh.simplices)


@pytest.mark.parametrize(
    "mesh, name, words",
    [
        (shapes.projective_plane(), "m.obj", r"in R\^5; known for it: .txt .off .vtu"),
        (shapes.projective_plane(), "m.ply", "points of space"),
        (shapes.projective_plane(), "m.mesh", "points of space"),  # it has no point data
        (shapes.simplex_boundary(3), "m.off", "surfaces of solids in space, .*dimension 3 in R"),
        (shapes.simplex_boundary(3), "m.stl", "surfaces, .*dimension 3 in R"),
        (shapes.simplex_boundary(4), "m.vtu", "dimension 4"),
        (shapes.simplex_boundary(4), "m.msh", "dimension 3 at most.*known for it: .txt .npz$"),
        (shapes.polygon(5), "m.stl", "surfaces"),
        (shapes.polygon(5), "m.su2", "plane and solids"),
        (
            shapes.torus(),
            "m.su2",
            "holds domains of the plane and solids of space, .* R\\^3; known .*.vtu",
        ),
        (shapes.torus(), "m.wkt", "no format"),
        (shapes.torus(), "m.pvtu", "known for this mesh: .*; .pvtu is written by stellate-mpi"),
        (shapes.torus(), "m.docx", r"\.docx.*known for this mesh: .*\.vtu"),
        (shapes.torus(), "m", "no format"),
    ],
)
def test_what_a_format_cannot_hold_is_said_and_nothing_written(mesh, name, words, tmp_path):
    with pytest.raises(stellate.SaveError, match=words):
        mesh.save(tmp_path / name)
    assert not (tmp_path / name).exists()
    with pytest.raises(stellate.SaveError, match=words):  # before there is a mesh
        stellate.check_save(tmp_path / name, mesh.dimension, mesh.ambient_dimension)


SOLID = shapes.simplex_boundary(3)
SOLIDS = stellate.Mesh(SOLID.points[:, :3].copy(), SOLID.simplices[:1])


@pytest.mark.parametrize("mesh", [shapes.polygon(7), shapes.torus(), SOLIDS])
@pytest.mark.parametrize("ending", sorted(formats._FORMATS))
def test_what_is_written_is_read_back(ending, mesh, tmp_path):
    path = tmp_path / f"mesh{ending}"
    if not formats._FORMATS[ending].takes(mesh.dimension, mesh.ambient_dimension):
        with pytest.raises(stellate.SaveError):
            mesh.save(path)
        return
    if mesh.dimension == 3 and ending in (".obj", ".off", ".ply", ".stl"):
        return  # see test_save_solids.py
    if ending in (".3mf", ".glb", ".npz"):
        return  # see test_save_parts.py
    mesh.save(path)
    assert [file.name for file in tmp_path.iterdir()] == [path.name]  # and nothing beside it
    space = np.hstack([mesh.points, np.zeros((len(mesh.points), 3 - mesh.ambient_dimension))])
    if ending in (".txt", ".xdmf", ".xmf"):
        space = mesh.points  # in the plane where the mesh is
    if ending == ".txt":
        again, cells = stellate.load_txt(path), stellate.load_txt(path).simplices
    elif mesh.dimension == 1 and ending in (".off", ".obj", ".ply"):
        return  # meshio reads no curves there; see test_curve_as_obj_and_ply
    else:
        again = meshio.read(path, "gmsh" if ending == ".msh" else None)
        assert len(again.cells) == 1 + (ending == ".su2")  # which has the boundary, too
        cells = again.cells[0].data
    if ending == ".stl":  # meshio joins the corners again, in an order of its own
        order = [int(np.abs(space - p).sum(axis=1).argmin()) for p in again.points]
        assert np.allclose(again.points, space[order], rtol=0, atol=1e-6)
        cells = np.array(order)[cells]
    elif ending in (".bdf", ".fem", ".nas"):  # numbers have 16 columns
        assert np.allclose(again.points, space, rtol=1e-9, atol=0)
    else:
        assert np.array_equal(again.points, space)
    assert {tuple(row) for row in np.sort(cells, axis=1)} == {tuple(row) for row in mesh.simplices}


def test_nastran_has_as_many_digits_as_fit_and_regions_as_properties(tmp_path):
    points = np.array(
        [
            [-0.17355349564702321, 1e-300, 1.0],
            [-1.2345678901234567e-12, -1e6 / 3, 0.0],
            [1e22, -5e-324, 123456789.123456789],
            [0.1, -0.0, 7.0],
        ]
    )
    mesh = stellate.Mesh(points, np.array([[0, 1, 2], [1, 2, 3]]), labels=np.array([1, 2]))
    mesh.save(tmp_path / "m.nas")
    text = (tmp_path / "m.nas").read_text()
    assert max(map(len, text.splitlines())) <= 73
    shells = [line.split() for line in text.splitlines() if line.startswith("CTRIA3")]
    assert [row[:3] for row in shells] == [["CTRIA3", "1", "1"], ["CTRIA3", "2", "2"]]
    again = meshio.read(tmp_path / "m.nas")
    assert np.allclose(again.points, points, rtol=1e-8, atol=0)


def test_obj_of_a_solid_is_its_boundary_by_walls(tmp_path):
    solid = dataclasses.replace(SOLIDS, walls=np.array([7, 11, 13, 14, 0], dtype=np.uint64))
    solid.save(tmp_path / "solid.obj")
    again = meshio.read(tmp_path / "solid.obj")
    cells = np.concatenate([block.data for block in again.cells if block.type == "triangle"])
    assert {tuple(row) for row in np.sort(cells, axis=1)} == {
        tuple(np.delete(SOLIDS.simplices[0], i)) for i in range(4)
    }
    volume = np.linalg.det(SOLIDS.points[SOLIDS.simplices[0, 1:]] - SOLIDS.points[0])
    assert np.linalg.det(again.points[cells]).sum() == pytest.approx(abs(volume))  # outwards


def test_vtk_beyond_space_keeps_all_coordinates(tmp_path):
    mesh = shapes.projective_plane()
    mesh.save(tmp_path / "mesh.vtk")
    again = meshio.read(tmp_path / "mesh.vtk")
    assert np.array_equal(again.point_data["coordinates"], mesh.points)


def test_a_package_that_is_missing_is_named(tmp_path, monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "h5py" else find(name)
    )
    with pytest.raises(stellate.SaveError, match="h5py, which is not installed .python3-h5py"):
        stellate.check_save(tmp_path / "mesh.med", 2, 3)
    stellate.check_save(tmp_path / "mesh.vtk", 2, 3)


def test_places_that_cannot_be_written_are_known_before(tmp_path):
    with pytest.raises(FileNotFoundError):
        stellate.check_save(tmp_path / "missing" / "mesh.txt", 2, 3)
    (tmp_path / "folder.txt").mkdir()
    with pytest.raises(IsADirectoryError):
        stellate.check_save(tmp_path / "folder.txt", 2, 3)
    stellate.check_save("mesh.txt", 2, 3)  # here
    for ending in ("txt", "vtu"):
        with pytest.raises(FileNotFoundError, match=rf"missing/mesh\.{ending}'"):
            shapes.torus().save(tmp_path / "missing" / f"mesh.{ending}")


def test_a_file_is_replaced_whole_or_not_at_all(tmp_path, monkeypatch):
    (tmp_path / "real.txt").write_text("old")
    (tmp_path / "real.txt").chmod(0o640)
    (tmp_path / "link.txt").symlink_to("real.txt")
    shapes.torus().save(tmp_path / "link.txt")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "real.txt").stat().st_mode & 0o777 == 0o640
    before = (tmp_path / "real.txt").read_bytes()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, limits[1]))  # Python ignores SIGXFSZ
    try:
        for name in ("real.txt", "new.vtk"):
            with pytest.raises(OSError):
                shapes.torus().save(tmp_path / name)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert (tmp_path / "real.txt").read_bytes() == before
    assert sorted(file.name for file in tmp_path.iterdir()) == ["link.txt", "real.txt"]


def test_stl_is_refused_where_single_precision_is_too_coarse(tmp_path):
    far = stellate.Mesh(shapes.torus().points + 1e9, shapes.torus().simplices)
    with pytest.raises(stellate.SaveError, match="single precision"):
        far.save(tmp_path / "far.stl")
    assert not list(tmp_path.iterdir())


def test_orientation():
    torus = shapes.torus().oriented_simplices()
    directed = {tuple(edge) for row in torus for edge in (row[[0, 1]], row[[1, 2]], row[[2, 0]])}
    assert len(directed) == 3 * len(torus)  # every edge once each way: neighbours agree
    assert shapes.projective_plane().oriented_simplices() is None
    solid = shapes.simplex_boundary(3)
    volumes = np.linalg.det(solid.points[solid.oriented_simplices()])
    assert (volumes > 0).all()
    three = np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]])  # a book with three pages
    assert stellate.Mesh(np.eye(5, 4), three).oriented_simplices() is None


def test_two_components_each_have_outward_normals():
    one = shapes.torus()
    far = stellate.Mesh(
        np.vstack([one.points, one.points * [1, 1, -1] + [5, 0, 0]]),  # mirrored
        np.vstack([one.simplices, one.simplices + len(one.points)]),
    )
    oriented = far.oriented_simplices()
    half = len(one.simplices)
    assert outward(one, oriented[:half])
    moved = stellate.Mesh(far.points[len(one.points) :] - [5, 0, 0], one.simplices)
    assert outward(moved, oriented[half:] - len(one.points))


def renumbered(mesh, rng):
    """The same complex with its vertices numbered at random."""
    number = rng.permutation(len(mesh.points))
    points = np.empty_like(mesh.points)
    points[number] = mesh.points
    simplices = np.sort(number[mesh.simplices], axis=1)
    return stellate.Mesh(points, simplices[np.lexsort(simplices.T[::-1])])


def oriented_one_by_one(simplices):
    """What orienting is: the first simplex of a component stays, the others follow a neighbour."""
    owners = {}
    for row, simplex in enumerate(simplices.tolist()):
        for i in range(len(simplex)):
            owners.setdefault(tuple(simplex[:i] + simplex[i + 1 :]), []).append((row, (-1) ** i))
    side = {}
    for first in range(len(simplices)):
        if first in side:
            continue
        side[first], front = 1, [first]
        while front:
            row = front.pop()
            simplex = simplices[row].tolist()
            for i in range(len(simplex)):
                for other, sign in owners[tuple(simplex[:i] + simplex[i + 1 :])]:
                    if other not in side:
                        side[other] = -side[row] * sign * (-1) ** i
                        front.append(other)
    turned = simplices.copy()
    for row in (row for row, kept in side.items() if kept < 0):
        turned[row, -2:] = simplices[row, [-1, -2]]
    return turned


def test_many_components_are_oriented_as_one_by_one(rng):
    for flat in (shapes.polygon(11, 4), shapes.torus(6, 5), shapes.simplex_boundary(3)):
        copies, n = 7, len(flat.points)
        pieces = stellate.Mesh(
            np.zeros((copies * n, flat.dimension + 4)),  # no hypersurface: nothing is outwards
            np.concatenate([flat.simplices + i * n for i in range(copies)]),
        )
        mesh = renumbered(pieces, rng)
        expected = oriented_one_by_one(mesh.simplices)
        assert np.array_equal(mesh.oriented_simplices(), expected)


def steps_to_orient(mesh):
    """How many lines of the package run, each over arrays as long as the mesh."""
    count = 0

    def trace(frame, event, argument):
        nonlocal count
        count += event == "line" and "stellate" in frame.f_code.co_filename
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        assert mesh.oriented_simplices() is not None
    finally:
        sys.settrace(before)
    return count


def test_orienting_takes_linear_time(rng):
    curve = shapes.polygon(500, 3), shapes.polygon(32_000, 3)
    for small, large in (curve, (shapes.torus(25, 20), shapes.torus(200, 160))):
        few = steps_to_orient(renumbered(small, rng))
        many = steps_to_orient(renumbered(large, rng))
        assert many < 2 * few  # for 64 times the vertices: with their logarithm, not with a root


SQUARE = stellate.Mesh(
    np.array([[0, 0], [1 / 3, 0], [1 / 3, 1], [0, 1.0]]),
    np.array([[0, 1, 2], [0, 2, 3]]),
    walls=np.array([0b11, 0b110, 0b1100, 0b1001], dtype=np.uint64),
)


def test_su2_has_the_boundary_as_markers(tmp_path):
    SQUARE.save(tmp_path / "m.su2")
    again = meshio.read(tmp_path / "m.su2")
    assert np.array_equal(again.points, SQUARE.points)
    assert np.array_equal(again.cells[0].data, SQUARE.oriented_simplices())
    text = (tmp_path / "m.su2").read_text()
    assert text.startswith("NDIME= 2\nNELEM= 2\n5 0 1 2\n5 0 2 3\nNPOIN= 4\n0.0 0.0\n0.33")
    tags = ["wall_0", "wall_1", "wall_2", "wall_3"]
    assert [line.split()[1] for line in text.splitlines() if "TAG" in line] == tags
    assert "MARKER_TAG= wall_1\nMARKER_ELEMS= 1\n3 0 1\n" in text
    bare = dataclasses.replace(SQUARE, walls=None)
    bare.save(tmp_path / "bare.su2")
    end = (tmp_path / "bare.su2").read_text().partition("NMARK= 1\n")[2].splitlines()
    assert end[:2] == ["MARKER_TAG= boundary", "MARKER_ELEMS= 4"] and len(end) == 6


def test_su2_has_no_markers_between_regions(tmp_path):
    walls = np.array([0b10011, 0b110, 0b11100, 0b1001], dtype=np.uint64)
    halves = dataclasses.replace(SQUARE, walls=walls, labels=np.array([1, 2], dtype=np.int8))
    halves.save(tmp_path / "m.su2")
    text = (tmp_path / "m.su2").read_text()
    assert "wall_4" not in text and text.count("MARKER_TAG") == 4
