"""Composed solids through the real server; volumes, edges and topology are counted here."""

import concurrent.futures as futures
import multiprocessing

import meshio
import numpy as np
import pytest
import stellate
from stellate import executors, manifolds, oracles
from stellate import solids as s
from topology import component_count, euler_characteristic, rim

norm = np.linalg.norm
_SPAWN = multiprocessing.get_context("spawn")


def volume(mesh):
    """Of simplices that fill space."""
    corners = mesh.points[mesh.simplices]
    edges = corners[:, 1:] - corners[:, :1]
    return np.abs(np.linalg.det(edges)).sum() / np.prod(np.arange(1, mesh.dimension + 1))


def thrown(inside, lower, upper, count=400_000):
    """The volume of a set, by points thrown into a box: a function written without the package."""
    lower, upper = np.asarray(lower, float), np.asarray(upper, float)
    x = lower + np.random.default_rng(3).random((count, len(lower))) * (upper - lower)
    return inside(x).mean() * np.prod(upper - lower)


def hold(mesh, chi, walls):
    """Certified, of that Euler characteristic, and bounded by so many walls and nothing else."""
    assert mesh.certified, mesh.report
    assert euler_characteristic(mesh.simplices) == chi
    boundary = np.concatenate([face.simplices for face in mesh.boundary])
    assert {face.walls for face in mesh.boundary} == {(i,) for i in range(walls)}
    assert sorted(map(tuple, boundary)) == sorted(map(tuple, rim(mesh.simplices)))


def test_the_first_example_of_constructive_geometry(server):
    """A cube and a ball, three holes through both: edges where walls meet, and no others."""
    holes = s.Cylinder(0.5, axis="x") | s.Cylinder(0.5, 4, axis="y") | s.Cylinder(0.5)
    part = (s.Box([-1] * 3, [1] * 3) & s.Ball(1.3)) - holes
    mesh = stellate.mesh(part, 0.2, server=server)
    hold(mesh, -4, 10)
    x = mesh.points

    def inside(x, slack=0.0):
        radii = [norm(np.delete(x, i, axis=1), axis=1) for i in range(3)]
        within = (np.abs(x) <= 1 + slack).all(axis=1) & (norm(x, axis=1) <= 1.3 + slack)
        return within & (np.min(radii, axis=0) >= 0.5 - slack)

    assert inside(x, 1e-9).all()
    assert volume(mesh) == pytest.approx(thrown(inside, [-1] * 3, [1] * 3), rel=0.03)
    for edge in mesh.edges:
        for wall in edge.walls:
            on = part.half_walls()[wall](x[np.unique(edge.simplices)])
            assert np.abs(on).max() < 1e-9


def test_a_plate_turned_and_drilled(server):
    """Holes with ends beyond the plate: seven walls and one, wherever it is turned to."""
    plate = s.Box([-1, -0.6, -0.15], [1, 0.6, 0.15])
    for x in (-0.5, 0.5):
        plate = plate - s.Cylinder(0.25, 1, at=(x, 0, 0))
    turn = s.rotation([1, 2, 3], 0.7)
    mesh = stellate.mesh(plate.scaled(2).rotated(turn).at([1, 2, 3]), 0.2, server=server)
    hold(mesh, -1, 8)
    back = (mesh.points - [1, 2, 3]) @ turn / 2
    assert np.abs(back).max(axis=0) == pytest.approx([1, 0.6, 0.15], abs=1e-9)
    assert volume(mesh) / 8 == pytest.approx((2 * 1.2 - 2 * np.pi * 0.25**2) * 0.3, rel=0.01)
    assert len(mesh.corners) == 8 and len(mesh.edges) == 12 + 4


@pytest.mark.parametrize(
    "solid, epsilon, chi, size",
    [
        (s.Cone(1, 1.5, 0.4), 0.25, 1, np.pi * 1.5 / 3 * (1 + 0.4 + 0.16)),
        (s.Capsule([-1, 0, 0], [1, 0, 0], 0.5), 0.2, 1, np.pi * (0.25 * 2 + 4 / 3 * 0.125)),
        (s.Torus(1, 0.4).rotated(s.rotation("x", 1)), 0.2, 0, 2 * np.pi**2 * 0.16),
        (s.Ball() - s.Ball().offset(-0.5), 0.2, 2, 4 / 3 * np.pi * (1 - 0.125)),
        (s.Ball(2) & s.HalfSpace([0, 0, 1], 1), 0.3, 1, np.pi / 3 * (2 * 8 - 3 * 4 + 1)),
    ],
    ids=["cone", "capsule", "torus", "shell", "cap"],
)
def test_volumes(server, solid, epsilon, chi, size):
    mesh = stellate.mesh(solid, epsilon, server=server)
    hold(mesh, chi, solid.walls)
    assert size * 0.92 < volume(mesh) < size * 1.001  # chords of what is round


@pytest.mark.parametrize(
    "solid, epsilon, chi, size",
    [
        # Two balls of radius 1 whose centres are 1 apart have a lens of 5 pi / 12 in common.
        (s.Ball() | s.Ball(at=(1, 0, 0)), 0.25, 1, np.pi * (8 / 3 - 5 / 12)),
        (s.Ball() ^ s.Ball(at=(1, 0, 0)), 0.25, 2, np.pi * (8 / 3 - 10 / 12)),
        (s.Box([-1] * 3, [1] * 3) - s.Box([0] * 3, [2] * 3), 0.4, 1, 7.0),
        (s.Box([-1] * 3, [1] * 3) - s.Cylinder(0.5, 1, at=(0, 0, 1)), 0.25, 1, 8 - np.pi / 8),
        (s.Box([-1, -1], [1, 1]) | s.Ball(0.6, at=(1.1, 0.1)), 0.2, 1, None),
    ],
    ids=["union", "symmetric-difference", "corner-cut-away", "blind-hole", "plane"],
)
def test_what_is_no_intersection_is_meshed_by_labels(server, solid, epsilon, chi, size):
    mesh = stellate.mesh(solid, epsilon, server=server)
    assert mesh.certified, mesh.report.certificate.verdict
    assert mesh.report.certificate.euler_characteristic == chi
    assert len(mesh.labels) == len(mesh.simplices) and set(mesh.labels) == {1}
    if size is not None:
        assert size * 0.92 < volume(mesh) < size * 1.02
    # A vertex is inside, or on the walls that it is said to be on; and it never lies outside.
    values = solid.clearances(mesh.points)
    on = (mesh.walls[:, None] >> np.arange(solid.walls, dtype=np.uint64) & 1).astype(bool)
    assert np.abs(values[on]).max() < 1e-9
    assert solid.contains(mesh.points[~on.any(axis=1)]).all()


def test_materials_are_regions(server, tmp_path):
    # A ball in a block: 2 in the ball, 1 around it.
    walls = [lambda x, i=i, up=up: 1 - up * x[:, i] for i in range(3) for up in (1.0, -1.0)]
    ball = lambda x: 0.36 - (x**2).sum(axis=1)  # noqa: E731
    signs = np.arange(1 << 7)
    labels = np.where(signs % 64 < 63, 0, np.where(signs >= 64, 2, 1))
    block = oracles.Solid([*walls, ball], ([-1.2] * 3, [1.2] * 3), labels=labels)
    mesh = stellate.mesh(block, 0.25, server=server)
    assert mesh.certified, mesh.report.certificate.verdict
    around, inside = mesh.report.certificate.regions
    assert (around.label, around.euler_characteristic) == (1, 2)
    assert (inside.label, inside.euler_characteristic) == (2, 1)
    assert "label 2: 1 component of Euler characteristic 1" in mesh.report.certificate.verdict
    shell, core = mesh.region(1), mesh.region(2)
    assert len(shell.simplices) + len(core.simplices) == len(mesh.simplices)
    assert [face.walls for face in core.boundary] == [(6,)]
    same = {tuple(row) for row in core.boundary[0].simplices.tolist()}
    assert same == {
        tuple(row)
        for face in shell.boundary
        if face.walls == (6,)
        for row in face.simplices.tolist()
    }
    assert volume(core) == pytest.approx(4 / 3 * np.pi * 0.216, rel=0.1)
    assert volume(shell) + volume(core) == pytest.approx(8)
    with pytest.raises(ValueError, match=r"no region 3; it has \[1, 2\]"):
        mesh.region(3)
    # What is between the regions is a face, and not where the mesh ends.
    assert [face.walls for face in mesh.boundary] == [(i,) for i in range(6)]
    assert [face.walls for face in mesh.faces(2)] == [(i,) for i in range(7)]
    mesh.save(tmp_path / "block.msh")
    mesh.save(tmp_path / "block.vtu")
    read = meshio.read(tmp_path / "block.msh")
    tags = {name: tag for name, (tag, _) in read.field_data.items()}
    assert {"region_1", "region_2", "wall_6"} <= set(tags) and "inside" not in tags
    counted = {
        name: sum(int((values == tag).sum()) for values in read.cell_data["gmsh:physical"])
        for name, tag in tags.items()
    }
    assert counted["region_2"] == len(core.simplices)
    assert counted["wall_6"] == len(core.boundary[0].simplices)
    # Outwards of the lower label, which is around the ball: into it.
    triangles = read.cells_dict["triangle"][
        read.cell_data_dict["gmsh:physical"]["triangle"] == tags["wall_6"]
    ]
    a, b, c = read.points[triangles].transpose(1, 0, 2)
    assert ((np.cross(b - a, c - a) * (a + b + c)).sum(axis=1) < 0).all()
    assert sum(len(block.data) for block in meshio.read(tmp_path / "block.vtu").cells) == sum(
        counted.values()
    )


def test_materials_by_name_the_later_ones_win(server):
    composite = s.Labels(matrix=s.Box([-1] * 3, [1] * 3), grain=s.Ball(0.6), core=s.Ball(0.35))
    mesh = stellate.mesh(composite, 0.25, server=server)
    assert mesh.certified, mesh.report.certificate.verdict
    parts = [mesh.region(composite.label_of(name)) for name in composite.names]
    balls = [4 / 3 * np.pi * radius**3 for radius in (0.6, 0.35)]
    assert volume(parts[0]) + volume(parts[1]) + volume(parts[2]) == pytest.approx(8)
    assert volume(parts[1]) == pytest.approx(balls[0] - balls[1], rel=0.1)
    assert volume(parts[2]) == pytest.approx(balls[1], rel=0.25)
    assert [euler_characteristic(part.simplices) for part in parts] == [2, 2, 1]
    traced = s.traced(lambda p: np.abs(p).max(axis=1) - 0.5, ([-1] * 3, [1] * 3))
    mesh = stellate.mesh(s.Labels(around=s.Ball(), block=traced), 0.3, server=server)
    assert mesh.certified and volume(mesh.region(2)) == pytest.approx(1)


@pytest.mark.parametrize("whole", [True, False], ids=["solid", "boundary alone"])
def test_files_have_the_names_of_materials_and_the_labels_of_cells(server, tmp_path, whole):
    composite = s.Labels(**{"soft matrix": s.Box([-1] * 3, [1] * 3), "grain": s.Ball(0.6)})
    mesh = stellate.mesh(composite, 0.25, boundary_only=not whole, server=server)
    assert mesh.certified and mesh.region_names == ("soft matrix", "grain")
    assert np.array_equal(mesh.region("grain").simplices, mesh.region(2).simplices)
    with pytest.raises(ValueError, match="no one region named 'void'"):
        mesh.region("void")
    assert "label 2 (grain): " in mesh.report.text
    mesh.save(tmp_path / "a.msh")
    mesh.save(tmp_path / "a.vtu")
    gmsh, vtu = meshio.read(tmp_path / "a.msh", "gmsh"), meshio.read(tmp_path / "a.vtu")
    names = {"soft_matrix", "grain"} if whole else set()
    assert {name for name in gmsh.field_data if not name.startswith("wall")} == names
    if whole:
        tag, _ = gmsh.field_data["grain"]
        chosen = gmsh.cell_data_dict["gmsh:physical"]["tetra"] == tag
        found = np.sort(gmsh.cells_dict["tetra"][chosen], axis=1)
        assert {*map(tuple, found.tolist())} == {*map(tuple, mesh.region(2).simplices.tolist())}
        regions = {kind: of.ravel() for kind, of in vtu.cell_data_dict["region"].items()}
        assert not regions["triangle"].any() and not regions["line"].any()
        cells = vtu.cells_dict["tetra"]
        for label in (1, 2):
            size = volume(stellate.Mesh(vtu.points, cells[regions["tetra"] == label]))
            assert size == pytest.approx(volume(mesh.region(label)))
    # Of each triangle the materials on both sides: the normal points away from the first.
    triangles, sides = vtu.cells_dict["triangle"], vtu.cell_data_dict["sides"]["triangle"]
    assert {*map(tuple, sides.tolist())} == {(1, 0), (1, 2) if whole else (2, 1)}
    middles = vtu.points[triangles].mean(axis=1)
    a, b, c = vtu.points[triangles].transpose(1, 0, 2)
    outwards = (np.cross(b - a, c - a) * middles).sum(axis=1) > 0
    on_grain = sides.min(axis=1) > 0
    assert np.allclose(np.linalg.norm(middles[on_grain], axis=1), 0.6, atol=0.06)
    assert (outwards[on_grain] == (not whole)).all() and outwards[~on_grain].all()


def test_a_smooth_union_is_one_wall(server):
    mesh = stellate.mesh(s.blend(s.Ball(0.6), s.Ball(0.5, at=(0.8, 0, 0)), 0.2), 0.1, server=server)
    hold(mesh, 1, 1)
    assert not mesh.edges
    on = mesh.points[np.unique(mesh.boundary[0].simplices)]
    a, b = 0.6 - norm(on, axis=1), 0.5 - norm(on - [0.8, 0, 0], axis=1)
    fillet = (a > -0.2) & (b > -0.2)
    assert np.abs(np.hypot(a + 0.2, b + 0.2)[fillet] - 0.2).max() < 1e-9 and fillet.sum() > 20
    assert np.abs(np.maximum(a, b)[~fillet]).max() < 1e-9


def test_plates_of_the_plane(server):
    plate = s.Box([-1, -1], [1, 1]) - s.Ball(0.4, at=(0.2, 0.1)) - s.Ball(0.5, at=(1, -1))
    mesh = stellate.mesh(plate, 0.1, server=server)
    hold(mesh, 0, 6)
    assert volume(mesh) == pytest.approx(4 - np.pi * (0.16 + 0.25 / 4), rel=0.01)


def test_walls_of_a_solid_cut_a_surface(server):
    part = s.Box([-2, -2, -2], [2, 2, 2]) & s.HalfSpace([1, 0.1, 0], 0.05)
    quarter = oracles.Clipped(manifolds.Torus(), part.half_walls())
    mesh = stellate.mesh(quarter, 0.15, server=server)
    assert mesh.certified and euler_characteristic(mesh.simplices) == 0
    assert component_count(mesh.boundary[0].simplices) == 2


def test_processes_answer_for_a_composition(client):
    part = s.Ball() - s.Cylinder(0.4)
    alone = stellate.mesh(part, 0.3, server=client)
    name = client.create(part, 0.3).name
    with futures.ProcessPoolExecutor(2, mp_context=_SPAWN) as pool:
        states = executors.workers_on(pool, part, name, 2, server=client).wait()
    assert alone.certified and states == ["SUCCEEDED"] * 2
    assert (alone.points == stellate.download(name, server=client).points).all()


def test_a_cone_is_meshed_where_its_tip_is_cut_away(server):
    cut = s.Cone(1, 1.5) & s.HalfSpace([0, 0, -1])
    mesh = stellate.mesh(cut, 0.25, server=server)
    hold(mesh, 1, 3)
    assert volume(mesh) == pytest.approx(np.pi * 0.75 / 3 * (1 + 0.5 + 0.25), rel=0.04)


def test_a_lid_with_a_nearly_flat_ridge(server):
    """Two walls at 172 degrees, which end in corners with a third: nothing of the solid is thin there."""
    tilt = np.radians(4)
    lid = s.HalfSpace([np.sin(tilt), 0, -np.cos(tilt)], -0.5 * np.cos(tilt))
    lid = lid & s.HalfSpace([-np.sin(tilt), 0, -np.cos(tilt)], -0.5 * np.cos(tilt))
    turn = s.rotation([1, 2, 3], 0.7)
    mesh = stellate.mesh((s.Box([-1, -1, -0.5], [1, 1, 2]) & lid).rotated(turn), 0.3, server=server)
    assert mesh.certified, mesh.report
    assert euler_characteristic(mesh.simplices) == 1 and len(mesh.boundary) == 7
    assert volume(mesh) == pytest.approx(4 - 2 * np.tan(tilt), rel=1e-12)
    back = mesh.points @ turn
    ridges = [e for e in mesh.edges if np.abs(back[np.unique(e.simplices)][:, 0]).max() < 1e-9]
    assert len(ridges) == 1 and len(ridges[0].walls) == 2


def test_a_ball_with_a_shallow_cut(server):
    """A plane and a sphere at 168 degrees: the walls' conormals are nearly one."""
    height = np.cos(np.radians(12))
    mesh = stellate.mesh(s.Ball() - s.HalfSpace([0, 0, 1], height), 0.09, server=server)
    hold(mesh, 1, 2)
    (rim,) = mesh.edges
    on = mesh.points[np.unique(rim.simplices)]
    assert np.abs(norm(on[:, :2], axis=1) - np.sin(np.radians(12))).max() < 1e-9


BLOCK = s.Box([-1] * 3, [1] * 3)
TOUCHING = {
    "a hole along a face": (BLOCK - s.Cylinder(0.5, at=(0.5, 0, 0)), (3, 6)),
    "the same, turned": (
        (BLOCK - s.Cylinder(0.5, at=(0.5, 0, 0))).rotated(s.rotation((1, 2, 3), 0.7)),
        (3, 6),
    ),
    "two holes": (
        BLOCK - s.Cylinder(0.3, at=(0.3, 0, 0)) - s.Cylinder(0.3, at=(-0.3, 0, 0)),
        (6, 7),
    ),
    "a bar on a plate": (
        s.Box([-1, -1, -0.2], [1, 1, 0]) | s.Cylinder(0.3, 1, axis="x", at=(0, 0, 0.3)),
        (5, 6),
    ),
    "two balls": (s.Ball() | s.Ball(at=(2, 0, 0)), (0, 1)),
}


@pytest.mark.parametrize("name", TOUCHING)
def test_walls_that_touch_are_named_before_they_are_meshed_for_ever(name, server):
    solid, walls = TOUCHING[name]
    words = f"walls {walls[0]} and {walls[1]} touch, near "
    with pytest.raises(stellate.OracleError, match=words) as caught:
        stellate.mesh(solid, 0.2, server=server, max_vertices=20_000)
    text = str(caught.value).split("near [")[1].split("]")[0]
    place = np.array([[float(c) for c in text.split(",")]])
    values = [abs(float(np.ravel(wall(place))[0])) for wall in solid.label_table()[0]]
    assert sorted(values)[1] < 1e-9  # two are zero there
    assert not stellate.check(solid, server=server).ok


@pytest.mark.parametrize(
    "solid, volume_of_it",
    [
        (BLOCK | s.Cylinder(0.5, 1, at=(0.5, 0, 0)), 8),  # it touches from within
        (BLOCK - s.Cylinder(0.5, at=(0.45, 0, 0)), 8 - 2 * np.pi * 0.25),
        (s.Box([-1] * 3, [0, 0, 1]) | s.Box([0, 0, -1], [1, 1, 1]), 4),  # an edge of both
        (s.Ball() | s.Ball(at=(2.05, 0, 0)), 8 * np.pi / 3),
    ],
    ids=["within", "nearly", "an edge", "apart"],
)
def test_walls_that_do_not_touch_where_it_matters_are_not_accused(solid, volume_of_it, server):
    mesh = stellate.mesh(solid, 0.2, server=server)
    assert mesh.certified and mesh.volume == pytest.approx(volume_of_it, rel=0.04)


def gyroid(x):
    x, y, z = x.T
    return np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)


# In two of its corners such a cell has nothing of the solid around it but the corner, which rounding
# finds inside or not.
@pytest.mark.parametrize(
    "low, axis, angle",
    [
        (0.0, [0, 0, 1], 0.0),
        (np.pi, [0, 0, 1], 0.0),
        (0.0, [0, 0, 1], 0.1),
        (np.pi, [1, 2, 3], 1.0),
    ],
)
def test_a_gyroid_in_a_cell_that_begins_at_its_corner(low, axis, angle, server):
    cell = s.Box([low] * 3, [low + 2 * np.pi] * 3) & s.Implicit(gyroid)
    mesh = stellate.mesh(cell.rotated(s.rotation(axis, angle)), 0.45, server=server)
    hold(mesh, -1, 7)
    assert volume(mesh) == pytest.approx(4 * np.pi**3, rel=0.02)
    assert any("has a point by itself" in warning for warning in mesh.report.certificate.warnings)


# A ball's sphere has a corner of a cube within it in common with that, and nothing else: rounding finds
# that point on the sphere inside of the cube or not.
@pytest.mark.parametrize("axis, angle", [([3, -1, 2], 0.5), ([1, 2, 3], 2.0), ([1, -3, 1], 1.0)])
def test_a_wall_that_touches_a_corner_has_no_piece_there(axis, angle, server):
    turn, centre = s.rotation(axis, angle), [5 / 7] * 3
    cube = s.Box([0] * 3, [1.2] * 3).rotated(turn).at([0.3, -0.2, 1.1])
    ball = s.Ball(norm(centre), at=centre).rotated(turn).at([0.3, -0.2, 1.1])
    mesh = stellate.mesh(s.Labels(rest=cube, common=cube & ball), 0.25, server=server)
    hold(mesh, 1, 6)
    assert mesh.report.certificate.warnings == ()
    assert volume(mesh) == pytest.approx(1.2**3)
