"""Solids that are composed: which points are in them, which walls they have, what can be meshed."""

import functools
import itertools
import operator
import pickle

import numpy as np
import pytest
import stellate
from stellate import solids as s
from stellate.solids._signs import needed

norm = np.linalg.norm


def turned(axis):
    """Radius about an axis through 0, and the height along it."""
    unit = np.asarray(axis, float) / norm(axis)

    def both(x):
        along = x @ unit
        return norm(x - along[:, None] * unit, axis=1), along

    return both


def primitives():
    """Each solid, and what it is: a function of points, written without the package."""
    ring = turned([0, 0, 1])
    oblique = turned([1, 2, 3])

    def capsule(x):
        a, b = np.array([-0.5, 0.1, 0]), np.array([0.6, 0.3, 0.4])
        t = np.clip((x - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        return norm(x - a - t[:, None] * (b - a), axis=1) < 0.4

    def cone(x):
        radius, along = oblique(x - [0.1, 0, 0])
        return (np.abs(along) < 0.6) & (radius < 0.8 - (along + 0.6) / 1.2 * 0.5)

    return [
        (s.Ball(0.8, at=(0.1, 0, 0.2)), lambda x: norm(x - [0.1, 0, 0.2], axis=1) < 0.8),
        (
            s.Box([-0.7, -0.5, -0.6], [0.8, 0.6, 0.9]),
            lambda x: ((x > [-0.7, -0.5, -0.6]) & (x < [0.8, 0.6, 0.9])).all(axis=1),
        ),
        (s.Cylinder(0.5, axis="x"), lambda x: norm(x[:, 1:], axis=1) < 0.5),
        (
            s.Cylinder(0.6, 1.1, axis=[1, 2, 3], at=(0.1, 0, 0)),
            lambda x: (
                (oblique(x - [0.1, 0, 0])[0] < 0.6) & (np.abs(oblique(x - [0.1, 0, 0])[1]) < 0.55)
            ),
        ),
        (s.HalfSpace([1, -2, 0.5], 0.3), lambda x: x @ [1, -2, 0.5] > 0.3),
        (s.Cone(0.8, 1.2, 0.3, axis=[1, 2, 3], at=(0.1, 0, 0)), cone),
        (s.Torus(0.8, 0.3), lambda x: np.hypot(ring(x)[0] - 0.8, ring(x)[1]) < 0.3),
        (s.Capsule([-0.5, 0.1, 0], [0.6, 0.3, 0.4], 0.4), capsule),
        (
            s.Implicit(lambda x: 1 - (x**4).sum(axis=1), bounding_box=([-1.1] * 3, [1.1] * 3)),
            lambda x: (x**4).sum(axis=1) < 1,
        ),
    ]


NAMES = ["ball", "box", "endless", "cylinder", "half_space", "cone", "torus", "capsule", "implicit"]


@pytest.fixture
def points(rng):
    return rng.random((20_000, 3)) * 4 - 2


@pytest.mark.parametrize("number", range(len(NAMES)), ids=NAMES)
def test_a_primitive_is_what_it_is_called(number, points, rng):
    solid, inside = primitives()[number]
    assert (solid.contains(points) == inside(points)).all()
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    moved = solid.scaled(1.3).rotated(turn).at([0.2, -0.1, 0.3])
    back = (points - [0.2, -0.1, 0.3]) @ turn / 1.3
    assert (moved.contains(points) == inside(back)).all()
    if NAMES[number] not in ("endless", "half_space"):
        lower, upper = moved.bounding_box
        there = points[moved.contains(points)]
        assert (there > lower).all() and (there < upper).all()
        # And not much larger than it: the box of points, with its margins.
        tight = np.ptp(there, axis=0) / (upper - lower) * 1.3
        assert (tight > 0.8 if NAMES[number] != "implicit" else tight > 0.5).all()


@pytest.mark.parametrize("number", range(len(NAMES)), ids=NAMES)
def test_walls_know_their_gradients_and_are_distances(number, points, rng):
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    solid = primitives()[number][0].scaled(1.3).rotated(turn).at([0.2, -0.1, 0.3])
    x, h = points[:500], 1e-6
    for wall in solid.half_walls() + (~solid).label_table()[0]:
        if wall.gradient is None:
            assert NAMES[number] == "implicit"
            continue
        steps = h * np.eye(3)
        by_steps = np.stack([(wall(x + v) - wall(x - v)) / (2 * h) for v in steps], axis=1)
        assert np.abs(by_steps - wall.gradient(x)).max() < 1e-5
        assert np.allclose(norm(wall.gradient(x), axis=1), 1, atol=1e-9)


def trees(rng, depth):
    """Random compositions, and the same of the functions."""
    some = primitives()
    if depth == 0:
        number = int(rng.integers(len(some)))
        solid, inside = some[number]
        shift = rng.normal(size=3) * 0.4
        return solid.at(shift), lambda x: inside(x - shift)
    (a, f), (b, g) = trees(rng, depth - 1), trees(rng, depth - 1)
    return [
        (a & b, lambda x: f(x) & g(x)),
        (a | b, lambda x: f(x) | g(x)),
        (a - b, lambda x: f(x) & ~g(x)),
        (a ^ b, lambda x: f(x) ^ g(x)),
        (~(a & ~b), lambda x: ~(f(x) & ~g(x))),
    ][int(rng.integers(5))]


@pytest.mark.parametrize("seed", range(40))
def test_any_composition_is_the_boolean_of_its_parts(seed):
    rng = np.random.default_rng(seed)
    solid, inside = trees(rng, 1 + seed % 3)
    x = rng.random((20_000, 3)) * 4 - 2
    want = inside(x)
    assert (solid.contains(x) == want).all()
    try:
        walls, labels = solid.label_table()
    except stellate.InvalidArgument as error:
        assert "16 at most" in str(error)
    else:
        signs = np.stack([wall(x) > 0 for wall in walls], axis=1)
        found = labels[signs @ (1 << np.arange(len(walls)))]
        assert set(np.unique(labels)) <= {-1, 0, 1}
        assert (found == want).all()  # so that no point has a label of -1
    try:
        half_walls = solid.half_walls()
    except ValueError as error:
        assert any(
            why in str(error)
            for why in ("no intersection", "is empty", "all of space", "of more than 16")
        )
    else:
        assert (np.all([wall(x) > 0 for wall in half_walls], axis=0) == want).all()


def counted(solid):
    return len(solid.half_walls())


def test_what_does_not_matter_is_left_out():
    box = s.Box([-1] * 3, [1] * 3)
    assert counted(box) == 6 and counted(box & box) == 6
    assert counted(box & s.Box([-2] * 3, [2] * 3)) == 6 == counted(s.Box([-2] * 3, [2] * 3) & box)
    assert counted(box & s.Box([-1, -1, -2], [1, 1, 0])) == 6  # sides shared, of both
    for axis in ("z", [0.1, 0.2, 1]):
        assert counted(box - s.Cylinder(0.5, axis=axis)) == 7
        assert counted(box - s.Cylinder(0.5, 4, axis=axis)) == 7  # its ends lie beyond the box
    assert counted(box - s.Cylinder(0.5, 2)) == 7  # its ends lie on the box's sides
    turn = s.rotation([1, 2, 3], 0.7)
    assert counted((box - s.Cylinder(0.5, 2)).rotated(turn).at([1, 2, 3])) == 7
    assert counted(box.rotated(turn) & box.rotated(turn)) == 6
    assert counted(s.Ball() & s.Ball(2)) == 1 == counted(s.Ball() - s.Ball(1, at=(2.5, 0, 0)))
    assert counted((s.Ball() | s.Ball(2)) - s.Ball(0.5)) == 2
    assert counted((box & s.HalfSpace([0, 0, 1], 0)) | (box & s.HalfSpace([0, 0, -1], 0))) == 6
    assert counted(~~box) == 6 and counted(~(~s.Ball() | ~s.Ball(1, at=(1, 0, 0)))) == 2


def test_a_plate_with_many_holes_is_an_intersection():
    plate = s.Box([0, 0, 0], [8, 5, 1])
    holes = [
        s.Cylinder(0.3, 2, at=(x, y, 0.5)) for x, y in itertools.product(range(1, 8), range(1, 5))
    ]
    for hole in holes:
        plate = plate - hole
    assert counted(plate) == 6 + 28


def test_walls_of_one_function_are_shared():
    g = lambda x: x[:, 0] ** 2 + x[:, 1] ** 2 - x[:, 2]  # noqa: E731
    cup = s.Implicit(g) & s.Box([-1] * 3, [1] * 3)
    assert len((cup & s.Implicit(g)).label_table()[0]) == 7
    assert len((cup & s.Implicit(g).at([0, 0, 0.1])).label_table()[0]) == 8
    assert len((cup - s.HalfSpace([0, 0, 2], 2)).label_table()[0]) == 7  # the lid, from above


@pytest.mark.parametrize(
    "composed, words",
    [
        (lambda: s.Ball() | s.Ball(at=(1, 0, 0)), "none has one sign"),
        (lambda: s.Ball() ^ s.Ball(at=(1, 0, 0)), "no intersection"),
        (lambda: s.Box([-1] * 3, [1] * 3) - s.Box([0] * 3, [2] * 3), "6 have one sign"),
    ],
)
def test_what_is_no_intersection_has_labels_and_no_half_walls(composed, words):
    solid = composed()
    with pytest.raises(stellate.InvalidArgument, match=words) as refused:
        solid.half_walls()
    assert isinstance(refused.value, ValueError) and "differences" in str(refused.value)
    assert solid.labels.shape == (1 << solid.walls,) and set(solid.labels) == {0, 1}
    x = np.random.default_rng(1).random((1000, 3)) * 4 - 2
    signs = (solid.clearances(x) >= 0) @ (1 << np.arange(solid.walls))
    assert (solid.labels[signs] == solid.contains(x)).all()


@pytest.mark.parametrize(
    "composed, words",
    [
        (lambda: s.Ball() & s.Ball(at=(5, 0, 0)), "the solid is empty"),
        (lambda: s.Ball() | ~s.Ball(), "all of space"),
        (
            lambda: functools.reduce(
                operator.or_, (s.Ball(1, at=(0.5 * i, 0, 0)) for i in range(17))
            ),
            "17 walls, and of more than 16",
        ),
    ],
)
def test_what_cannot_be_meshed_says_why(composed, words):
    solid = composed()
    with pytest.raises(ValueError, match=words):
        stellate.mesh(solid, 0.1)  # before any server is looked for
    assert solid.contains(np.zeros((1, 3))).shape == (1,)


def test_walls_that_tell_nothing_are_left_out():
    # Of b: what no point can have tells nothing. Of c: labels are the same on both its sides.
    labels = np.array([0, 1, -1, 1, 0, 1, 0, -1], dtype=np.int8)
    walls, kept = needed(["a", "b", "c"], labels)
    assert walls == ["a"] and kept.tolist() == [0, 1]
    walls, kept = needed(["a", "b"], np.array([0, 1, 1, 1], dtype=np.int8))
    assert walls == ["a", "b"] and kept.tolist() == [0, 1, 1, 1]


def test_an_intersection_needs_no_labels():
    assert (s.Box([-1] * 3, [1] * 3) - s.Ball()).labels is None


@pytest.mark.parametrize(
    "wrong, words",
    [
        (lambda: s.Ball(-1), "a length above 0"),
        (lambda: s.Ball(at=[[0, 0]]), "point of R"),
        (lambda: s.Box([0, 0], [1, 1, 1]), "2 numbers"),
        (lambda: s.Box(0, [1, 1, 1]), "a point of R"),
        (lambda: s.Ball().at(1, 2), "3 numbers"),
        (lambda: s.Box([0, 1], [1, 0]), "lower < upper"),
        (lambda: s.Cylinder(axis="w"), "'x', 'y', 'z'"),
        (lambda: s.Cylinder(axis=[0, 0, 0]), "other than 0"),
        (lambda: s.Torus(0.3, 0.4), "minor < major"),
        (lambda: s.Ball([0, 0, 0], 1), "radius, which comes first"),
        (lambda: s.HalfSpace([0, 0, 1], [0, 0, 0.3]), "offset has to be a number, normal . p"),
        (lambda: s.Capsule([0, 0, 0], [0, 0, 0]), "two points that differ"),
        (lambda: s.Ball().rotated(np.ones((3, 3))), "orthogonal"),
        (lambda: s.Ball().scaled(0), "above 0"),
        (lambda: s.Ball() & s.Ball(at=(0, 0)), "R\\^3 and one of R\\^2"),
        (lambda: s.Box([0] * 3, [1] * 3).offset(0.1), "one wall"),
        (lambda: s.Ball().offset(-2), "nothing would be left"),
        (lambda: s.Implicit(lambda x: x[:, 0]).offset(0.1), "no distances"),
        (lambda: s.blend(s.Ball(), s.Box([0] * 3, [1] * 3), 0.1), "one wall"),
        (lambda: s.blend(s.Ball(), s.Ball(), 0.1, join="^"), "join"),
        (lambda: s.Implicit(3), "takes a function"),
        (lambda: (~s.Ball()).bounding_box, "cut it by a box"),
        (lambda: s.HalfSpace([0, 0, 1]).bounding_box, "cut it by a box"),
        (lambda: s.Ball().contains(np.zeros((2, 4))), r"\(n, 3\)"),
    ],
)
def test_what_makes_no_sense_is_refused_in_words(wrong, words):
    with pytest.raises(stellate.InvalidArgument, match=words):
        wrong()


def test_only_solids_join():
    with pytest.raises(TypeError):
        s.Ball() & 3


def test_offsets_are_parallel(points, rng):
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    for solid, size in ((s.Ball(0.6), 0.2), (s.Torus(0.8, 0.3), 0.1), (s.Cylinder(0.4), -0.2)):
        placed = solid.scaled(1.5).rotated(turn).at([0.1, 0.2, 0])
        for one in (placed, ~placed):
            wall, moved = one.half_walls()[0], one.offset(size).half_walls()[0]
            assert np.allclose(moved(points), wall(points) + size)
    distance = s.Implicit(lambda x: 1 - norm(x, axis=1), distance=True)
    assert np.allclose(distance.offset(0.3).half_walls()[0](points), 1.3 - norm(points, axis=1))


def test_a_fillet_is_round_and_fills_the_edge():
    """Of two planes that cross squarely: a quarter of a circle."""
    floor, post = s.HalfSpace([0, 0, -1]), s.HalfSpace([-1, 0, 0])
    (wall,) = s.blend(floor, post, 0.5).half_walls()
    angle = np.linspace(0, np.pi / 2, 50)
    arc = np.stack([0.5 - 0.5 * np.cos(angle), 0 * angle, 0.5 - 0.5 * np.sin(angle)], axis=1)
    assert np.abs(wall(arc)).max() < 1e-12
    assert np.allclose(norm(wall.gradient(arc), axis=1), 1)
    rounded = s.blend(~floor, ~post, 0.5, "&")
    assert (rounded.contains(arc + 1e-9) != rounded.contains(arc - 1e-9)).all()
    without = s.blend(~floor, post, 0.5, "-")
    assert (without.contains(arc + 1e-9) == rounded.contains(arc + 1e-9)).all()


def test_a_composition_can_be_sent_to_other_processes(points):
    part = (s.Box([-1] * 3, [1] * 3) & s.Ball(1.3)) - s.blend(s.Cylinder(0.5), s.Ball(0.7), 0.1)
    assert part.walls == 8
    again = pickle.loads(pickle.dumps(part))
    assert (again.clearances(points) == part.clearances(points)).all()
    assert stellate.check(again).ok


@pytest.mark.parametrize(
    "materials, words",
    [
        ({}, "there are 0 materials; there may be 1 to 127"),
        ({"a": 1}, "the material 'a' has to be a solid"),
        (
            {"a": s.Ball(), "b": s.Ball(at=(0, 0))},
            "'b' is a solid of R.2, and the first one of R.3",
        ),
        ({"a": s.Ball(0.2), "b": s.Ball()}, "nothing of the material 'a'"),
        ({"a": s.Cylinder()}, "goes on without end"),
    ],
)
def test_materials_that_cannot_be_are_refused(materials, words):
    with pytest.raises(stellate.InvalidArgument, match=words):
        s.Labels(**materials)


def test_materials_have_labels_by_their_names(rng):
    composite = s.Labels(
        matrix=s.Box([-1] * 3, [1] * 3), grain=s.Ball(0.6), bit=s.Ball(0.6, (0.9, 0, 0))
    )
    assert composite.names == ("matrix", "grain", "bit") and composite.label_of("grain") == 2
    with pytest.raises(stellate.InvalidArgument, match="no material 'grit'"):
        composite.label_of("grit")
    x = rng.random((5_000, 3)) * 4 - 2
    want = np.where((np.abs(x) < 1).all(axis=1), 1, 0)
    want[norm(x, axis=1) < 0.6] = 2
    want[norm(x - [0.9, 0, 0], axis=1) < 0.6] = 3
    signs = composite.clearances(x) > 0
    assert (composite.labels[signs @ (1 << np.arange(composite.walls))] == want).all()
    again = pickle.loads(pickle.dumps(composite))
    assert (again.labels == composite.labels).all()


def test_cubes_and_places_may_be_said_as_on_the_command_line():
    cube = s.Box(-1, 2).at(1, 0, 0)
    where = np.array([[2.9, -0.9, 1.9], [-0.1, 0, 0], [1.0, 2.1, 0]])
    assert cube.contains(where).tolist() == [True, False, False]
    assert (
        cube.contains(where).tolist()
        == s.Box([-1] * 3, [2] * 3).at([1, 0, 0]).contains(where).tolist()
    )
    for other in (lambda: cube + s.Ball(), lambda: 2 * cube, lambda: cube * cube):
        with pytest.raises(TypeError, match=r"joined by a \| b"):
            other()
