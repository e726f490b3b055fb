"""Functions of numpy's, traced into walls: which walls, which inside, and what is refused in words."""

import math
import pickle

import numpy as np
import pytest
import stellate
from stellate import solids as s

norm = np.linalg.norm
BOX = [-1.3] * 3, [1.3] * 3


# What people write. All are negative inside.


def sphere(radius, centre=(0, 0, 0)):
    return lambda p: norm(p - np.asarray(centre), axis=1) - radius


def box(half):
    def f(p):
        q = np.abs(p) - np.asarray(half)
        return norm(np.maximum(q, 0), axis=1) + np.minimum(np.amax(q, axis=1), 0)

    return f


def round_box(p):
    return box([0.65, 0.45, 0.35])(p) - 0.15


def torus(p):
    return np.sqrt((np.sqrt(p[:, 0] ** 2 + p[:, 1] ** 2) - 0.8) ** 2 + p[:, 2] ** 2) - 0.25


def capped_cylinder(p):
    e = np.stack([norm(p[:, [0, 1]], axis=1) - 0.6, np.abs(p[:, 2]) - 0.7], axis=1)
    return np.minimum(np.maximum(e[:, 0], e[:, 1]), 0) + norm(np.maximum(e, 0), axis=1)


def capsule(p):
    a, ab = np.array([-0.5, 0, 0]), np.array([1.0, 0.2, 0.1])
    t = np.clip(((p - a) * ab).sum(axis=1) / (ab @ ab), 0, 1)
    return norm(p - a - t[:, None] * ab, axis=1) - 0.3


def box_or_ball(p):
    return np.minimum(box([0.7, 0.5, 0.5])(p), sphere(0.6, (0.5, 0.4, 0.3))(p))


def drilled(p):
    """The first example of the best known library of constructive geometry."""
    hole = lambda i, j: np.hypot(p[:, i], p[:, j]) - 0.5  # noqa: E731
    f = np.maximum(sphere(1)(p), np.amax(np.abs(p) - 0.75, axis=1))
    return np.maximum(f, -np.minimum(np.minimum(hole(0, 1), hole(0, 2)), hole(1, 2)))


def octahedron(p):
    return np.abs(p).sum(axis=1) - 1.0


def smooth_union(p):
    a, b = sphere(0.5)(p), sphere(0.45, (0.6, 0, 0))(p)
    t = np.clip(0.5 + 0.5 * (b - a) / 0.2, 0, 1)
    return b + (a - b) * t - 0.2 * t * (1 - t)


def gyroid_sheet(p):
    x, y, z = (4 * p).T
    g = np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)
    return np.maximum(np.abs(g) - 0.6, norm(p, axis=1) - 1.1)


def cut_shell(p):
    return np.maximum(np.abs(norm(p, axis=1) - 0.8) - 0.1, p[:, 2] - 0.2)


def where_union(p):
    a, b = sphere(0.7)(p), sphere(0.6, (0.6, 0, 0))(p)
    return np.where(a < b, a, b)


# And, beyond the common ones, other ways to write such things.


def ellipsoid(p):
    k0, k1 = norm(p / [1, 0.7, 0.5], axis=1), norm(p / [1, 0.49, 0.25], axis=1)
    return k0 * (k0 - 1) / k1


def cone(p):
    q = np.column_stack([np.hypot(p[:, 0], p[:, 1]), p[:, 2]])
    return np.maximum(q @ np.array([0.8, 0.6]) - 0.4, -q[:, 1] - 0.5)


def turned_box(p):
    turn = np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1]])
    q = np.dot(p, turn)
    q -= [0.1, 0, 0]
    return np.max(np.abs(q) - 0.6, axis=-1)


def masked(p):
    low = (p[:, 2] < 0) & (np.abs(p[:, 0]) < 2)
    return np.where(low, norm(p, axis=1) - 0.8, np.hypot(p[:, 0], p[:, 1]) - 0.8 + p[:, 2])


def superball(p):
    return np.sum(p**4, axis=1, keepdims=True) - 0.6


def exponential_union(p):
    return -np.logaddexp(-10 * sphere(0.5)(p), -10 * sphere(0.5, (0.5, 0, 0))(p)) / 10


def link(p):
    q = np.stack([p[:, 0], np.maximum(np.abs(p[:, 1]) - 0.3, 0.0), p[:, 2]], axis=1)
    return norm(np.stack([norm(q[:, :2], axis=1) - 0.5, q[:, 2]], axis=1), axis=1) - 0.2


def half_step(p):
    """A ball and a larger one, half of each: a step, where the plane between them is the boundary."""
    return np.where(p[:, 0] > 0, sphere(0.5)(p), sphere(0.8)(p))


def onion(p):
    return np.abs(np.abs(sphere(0.8)(p)) - 0.1) - 0.04


def angle_cut(p):
    return np.maximum(norm(p, axis=1) - 1, np.abs(np.arctan2(p[:, 1], p[:, 0])) - 1.2)


WALLS = [
    (box([0.8, 0.6, 0.5]), 3),
    (round_box, 1),
    (torus, 1),
    (capped_cylinder, 2),
    (capsule, 1),
    (box_or_ball, 4),
    (drilled, 7),
    (octahedron, 8),
    (smooth_union, 1),
    (gyroid_sheet, 2),
    (cut_shell, 2),
    (where_union, 2),
    (ellipsoid, 1),
    (cone, 2),
    (turned_box, 3),
    (masked, 2),
    (superball, 1),
    (exponential_union, 1),
    (link, 1),
    (half_step, 3),
    (onion, 1),
]


def named(value):
    return getattr(value, "__name__", None) if callable(value) else str(value)


@pytest.mark.parametrize("f, walls", WALLS, ids=named)
def test_a_formula_becomes_its_smooth_pieces(f, walls, rng):
    solid = s.traced(f, BOX)
    x = rng.random((100_000, 3)) * 2.6 - 1.3
    with np.errstate(all="ignore"):
        want = np.reshape(f(x), -1) < 0
    assert (solid.contains(x) == want).all()
    table = solid.label_table()
    assert len(table[0]) == walls
    assert (s.traced(lambda p: -f(p), BOX, inside="positive").contains(x) == want).all()
    # The walls are smooth where they are zero: their gradients are those of differences there.
    near, h = x[np.argsort(np.abs(np.reshape(f(x), -1)))[:300]], 1e-6
    for wall in table[0]:
        by_steps = [(wall(near + v) - wall(near - v)) / (2 * h) for v in h * np.eye(3)]
        off = np.abs(np.stack(by_steps, axis=1) - wall.gradient(near)).max(axis=1)
        zero = np.abs(wall(near)) < 0.02
        assert (off[zero] < 1e-4 * (1 + norm(wall.gradient(near[zero]), axis=1))).mean() > 0.97


def test_a_wedge_by_an_angle_is_traced(rng):
    solid = s.traced(angle_cut, BOX)
    x = rng.random((100_000, 3)) * 2.6 - 1.3
    assert (solid.contains(x) == (angle_cut(x) < 0)).all()


def test_traced_solids_are_composed_moved_and_sent(rng):
    x = rng.random((50_000, 3)) * 2.6 - 1.3
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    both = s.traced(drilled, BOX).rotated(turn).scaled(0.8).at([0.1, 0, 0]) & s.HalfSpace([0, 0, 1])
    want = (drilled((x - [0.1, 0, 0]) @ turn / 0.8) < 0) & (x[:, 2] > 0)
    assert (both.contains(x) == want).all() and both.walls == 8
    again = pickle.loads(pickle.dumps(both))
    assert (again.clearances(x[:100]) == both.clearances(x[:100])).all()
    shared = s.traced(torus, BOX) & s.traced(torus, BOX)
    assert len(shared.label_table()[0]) == 1


def test_what_leaves_its_box_has_to_be_cut():
    def gyroid(p):
        x, y, z = (4 * p).T
        return -(np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x))

    solid = s.traced(gyroid, BOX)
    with pytest.raises(stellate.InvalidArgument, match="cut it by a box"):
        solid.bounding_box  # noqa: B018
    assert (solid & s.Ball(1.1)).walls == 2


def test_walls_that_are_not_the_functions_are_found_out(rng):
    """A dent that no random point of the box has met."""
    dent = np.array([0.3, 0.4, 0.2])

    def dented(p):
        return np.maximum(norm(p, axis=1) - 1, 0.004 - norm(p - dent, axis=1))

    solid = s.traced(dented, BOX)
    assert solid.walls == 1
    with pytest.raises(stellate.OracleError, match="smaller than what random points"):
        solid.clearances(np.stack([np.zeros(3), dent + 0.001]))
    solid.clearances(rng.normal(size=(100, 3)) * 0.1)


def by_rows(p):
    return np.array([max(abs(x)) for x in p]) - 1


def with_if(p):
    r = norm(p, axis=1)
    return r - 1 if r > 0.5 else r - 2


def by_mask(p):
    f = norm(p, axis=1) - 1
    f[p[:, 0] > 0] -= 0.1
    return f


REFUSED = [
    (with_if, "branches on values"),
    (lambda p: max(p[:, 0], p[:, 1]) - 1, "branches on values"),
    (by_rows, "one by one"),
    (by_mask, "by a mask"),
    (lambda p: np.abs(p).max() - 1, "reduces over its points"),
    (lambda p: norm(p) - 1, "reduces over its points"),
    (lambda p: p[:, 0] - p.mean(axis=0)[0], "reduces over its points"),
    (lambda p: norm(p % 1 - 0.5, axis=1) - 0.3, "periodic cell"),
    (lambda p: norm(p - np.round(p), axis=1) - 0.3, "periodic cell"),
    (lambda p: np.floor(p[:, 0]), "periodic cell"),
    (lambda p: np.einsum("ij,ij->i", p, p) - 1, "numpy.einsum is not traced"),
    (lambda p: np.interp(p[:, 0], [0, 1], [0, 1]), "numpy.interp is not traced"),
    (lambda p: np.asarray(p)[:, 0], "numpy.array, asarray"),
    (lambda p: math.sqrt(p[:, 0]), "numpy.sqrt for math.sqrt"),
    (lambda p: p[0] - 1, "single rows"),
    (lambda p: p - 1, r"\(n, 3\), and has to return \(n,\)"),
    (lambda p: 1.0, "does not depend"),
    (lambda p: p[:, 0] * np.ones(17), "as if there were that many"),
    (lambda p: norm(p, axis=1) + p, "do not go together"),
    (lambda p: norm(p, axis=1) + 1, "one sign"),
    (lambda p: 1 / norm(p * 0, axis=1), "not finite"),
]


@pytest.mark.parametrize("f, words", REFUSED, ids=[words for _, words in REFUSED])
def test_what_cannot_be_traced_is_refused_in_words(f, words):
    with pytest.raises(stellate.InvalidArgument, match=words):
        s.traced(f, BOX)


def test_an_exception_of_the_functions_own_says_how_it_was_called():
    with pytest.raises(KeyError) as raised:
        s.traced(lambda p: {}["size"] * p[:, 0], BOX)
    assert (
        any("symbols in place of numbers" in note for note in raised.value.__notes__)
        if hasattr(raised.value, "__notes__")
        else "symbols" in str(raised.value)
    )


@pytest.mark.parametrize(
    "given, words",
    [
        (dict(box=([1] * 3, [-1] * 3)), "box is empty"),
        (dict(box=BOX, inside="outside"), "'negative' or 'positive'"),
        (dict(box=([0, 0], [1, 1, 1])), "2 numbers"),
    ],
)
def test_bad_arguments(given, words):
    with pytest.raises(stellate.InvalidArgument, match=words):
        s.traced(torus, **given)
