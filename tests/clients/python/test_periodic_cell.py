"""Flat tori of any lattice: isometric, one to one, with closest points; meshes on them unwrapped."""

import pickle

import numpy as np
import pytest
import stellate
from stellate import oracles
from stellate._places import Places
from topology import euler_characteristic

norm = np.linalg.norm
HEX = [[1, 0], [-0.5, np.sqrt(0.75)]]
LATTICES = {
    "square": np.eye(2),
    "hexagonal": np.array(HEX),
    "cubic": np.eye(3) * 2 * np.pi,
    "body-centred": np.array([[-1, 1, 1], [1, -1, 1], [1, 1, -1]]) * 3.0,
    "face-centred": np.array([[0, 1, 1], [1, 0, 1], [1, 1, 0]]) * 3.0,
    "triclinic": np.array([[6, 0, 0], [1.1, 5.7, 0], [0.7, -0.9, 7.0]]),
    "four cubes": np.eye(4),
    "a root lattice of R^4": np.eye(4) - np.eye(4, k=1),
}
CIRCLES = dict(zip(LATTICES, (2, 3, 3, 6, 4, 6, 4)))


def random_lattice(d, seed):
    """Any: of different lengths, sheared, of either orientation."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(d, d)) * np.exp(rng.normal(size=(d, 1)))


def is_flat_torus(lattice, seed):
    """Isometric and one to one, by distances and by what coordinates come back."""
    cell, rng = oracles.PeriodicCell(lattice), np.random.default_rng(seed)
    d = len(lattice)
    x = (rng.random((200, d)) * 6 - 3) @ lattice
    ways = rng.normal(size=x.shape)
    step = 5e-5 * norm(lattice, axis=1).min() * ways / norm(ways, axis=1)[:, None]
    once, twice = (cell.embed(x + t * step) - cell.embed(x - t * step) for t in (1, 2))
    stretched = norm(8 * once - twice, axis=1) / norm(12 * step, axis=1)  # of fourth order
    assert np.abs(stretched - 1).max() < 1e-8
    back = (cell.coordinates(cell.embed(x)) - x) @ np.linalg.inv(lattice)
    assert np.abs(back - np.round(back)).max() < 1e-8
    shares = cell.coordinates(cell.embed(x)) @ np.linalg.inv(lattice)
    assert (shares > -1e-12).all() and (shares < 1).all()
    for vector in lattice:
        assert np.abs(cell.embed(x + vector) - cell.embed(x)).max() < 1e-9 * norm(cell.radii)
    bases = cell.tangent_basis(cell.embed(x))
    by_steps = [(cell.embed(x + v) - cell.embed(x - v)) / 2e-5 for v in 1e-5 * np.eye(d)]
    assert np.abs(bases - np.stack(by_steps, axis=2)).max() < 1e-5
    assert np.abs(np.swapaxes(bases, 1, 2) @ bases - np.eye(d)).max() < 1e-12
    return cell


@pytest.mark.parametrize("d", [2, 3])
def test_a_hundred_random_lattices_are_flat_tori(d):
    for seed in range(100):
        cell = is_flat_torus(random_lattice(d, seed), seed)
        assert d <= len(cell.radii) <= d * (d + 1) // 2


@pytest.mark.parametrize("name", LATTICES)
def test_lattices_with_names(name):
    cell = is_flat_torus(LATTICES[name], 1)
    assert cell.ambient_dimension == 2 * len(cell.radii)
    if name in CIRCLES:
        assert len(cell.radii) == CIRCLES[name]
    again = pickle.loads(pickle.dumps(cell))
    x = np.random.default_rng(2).random((5, cell.dimension))
    assert (again.embed(x) == cell.embed(x)).all()


@pytest.mark.parametrize("name", ["hexagonal", "body-centred", "triclinic"])
def test_closest_points_are_the_closest(name, rng):
    cell = oracles.PeriodicCell(LATTICES[name])
    d = cell.dimension
    per_side = {2: 200, 3: 40}[d]
    sides = [np.arange(per_side) / per_side] * d
    grid = np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, d) @ cell.lattice
    torus = cell.embed(grid)
    size = cell.radii.min()
    for far in (0.1, 0.4, 1.0):
        x = cell.embed(rng.random((60, d)) @ cell.lattice)
        x = x + far * size * rng.normal(size=x.shape) / np.sqrt(x.shape[1])
        nearest = cell.closest_point(x)
        assert np.abs(cell.embed(cell.coordinates(nearest)) - nearest).max() < 1e-9
        away = norm(nearest - x, axis=1)
        best = np.array([norm(torus - row, axis=1).min() for row in x])
        assert (away <= best + 1e-9).mean() > (0.999 if far < 1 else 0.9)
        # Whatever the rest of the batch.
        one_by_one = np.concatenate([cell.closest_point(row[None]) for row in x])
        assert (one_by_one == nearest).all()


def waves(lattice):
    """Periodic: a surface like Schwarz's P in any cell."""
    inverse = np.linalg.inv(lattice)
    return lambda x: np.cos(2 * np.pi * x @ inverse).sum(axis=1)


def test_functions_have_to_repeat():
    lattice = LATTICES["triclinic"]
    cell = oracles.PeriodicCell(lattice)
    cell.level_set(waves(lattice))
    with pytest.raises(stellate.InvalidArgument, match="f does not repeat by the lattice's vector"):
        cell.level_set(waves(np.eye(3)))
    with pytest.raises(stellate.InvalidArgument, match="wall 1 does not repeat"):
        cell.solid([waves(lattice), lambda x: x[:, 0]])
    with pytest.raises(stellate.OracleError, match="a row for each"):
        cell.level_set(lambda x: x[:2, 0])


@pytest.mark.parametrize(
    "lattice, words",
    [
        ([1, 2, 3], r"a matrix \(d, d\)"),
        ([[1, 0, 0], [0, 1, 0]], r"a matrix \(d, d\)"),
        ([[1, 2], [2, 4]], "independent"),
        ([[np.nan, 0], [0, 1]], r"a matrix \(d, d\)"),
        ([[1, 1, 0, 0], [1, -1, 0, 0], [0, 1, -1, 0], [0, 0, 1, -1]], "no obtuse superbase"),
    ],
)
def test_what_is_no_lattice_is_refused(lattice, words):
    with pytest.raises(stellate.InvalidArgument, match=words):
        oracles.PeriodicCell(lattice)


def torus_grid(cell, count):
    """A triangulation of a cell of the plane, count squares a side, on the torus."""
    i, j = np.meshgrid(np.arange(count), np.arange(count), indexing="ij")
    at = lambda a, b: ((a % count) * count + b % count).reshape(-1)  # noqa: E731
    corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]
    rows = np.concatenate([np.stack([corners[k] for k in t], 1) for t in ((0, 1, 2), (0, 2, 3))])
    plain = np.stack([i, j], -1).reshape(-1, 2) / count @ cell.lattice
    return stellate.Mesh(cell.embed(plain), np.sort(rows, axis=1))


def glued(mesh, pairs):
    """The simplices, with points that belong together as one."""
    same = np.arange(len(mesh.points))
    same[pairs[:, 1]] = pairs[:, 0]
    assert (same[same] == same).all()
    return same[mesh.simplices]


@pytest.mark.parametrize("copies", [1, 2, (3, 1)])
def test_a_mesh_on_a_cell_is_unwrapped(copies):
    cell = oracles.PeriodicCell(HEX)
    mesh = torus_grid(cell, 7)
    period = mesh.unwrap(cell)
    corners = period.corners()
    assert norm(corners[:, 1:] - corners[:, :1], axis=2).max() < 1.8 / 7
    assert (
        np.abs(
            cell.embed(corners.reshape(-1, 2)) - mesh.points[mesh.simplices].reshape(-1, 4 + 2)
        ).max()
        < 1e-9
    )
    shares = corners.mean(axis=1) @ np.linalg.inv(HEX)
    assert (shares > -1e-9).all() and (shares < 1 + 1e-9).all()
    plain = period.plain(copies)
    count = np.prod(np.broadcast_to(copies, 2))
    triangles = plain.points[plain.simplices]
    area = np.abs(np.linalg.det(triangles[:, 1:] - triangles[:, :1])).sum() / 2
    assert area == pytest.approx(count * np.sqrt(0.75)) and len(triangles) == count * 98
    pairs, periods = period.node_pairs(copies)
    assert (
        np.abs(plain.points[pairs[:, 1]] - plain.points[pairs[:, 0]] - periods @ HEX).max() < 1e-9
    )
    assert (periods != 0).any(axis=1).all() and (periods % np.broadcast_to(copies, 2) == 0).all()
    # Glued it is the torus again, each of its points once.
    closed = glued(plain, pairs)
    assert len(np.unique(closed)) == 49 * count and euler_characteristic(closed) == 0
    # Each point of the border that has a like one elsewhere is in a pair: none is left over.
    shares = (plain.points @ np.linalg.inv(HEX) / np.broadcast_to(copies, 2) + 1e-6) % 1
    assert len(np.unique(shares.round(5), axis=0)) == len(plain.points) - len(pairs)


def test_meshes_that_cannot_be_unwrapped_say_why():
    cell = oracles.PeriodicCell(HEX)
    with pytest.raises(stellate.InvalidArgument, match="smaller epsilon"):
        torus_grid(cell, 2).unwrap(cell)
    with pytest.raises(stellate.InvalidArgument, match="in R\\^6"):
        torus_grid(cell, 7).unwrap(oracles.PeriodicCell(np.eye(2)))
    with pytest.raises(stellate.InvalidArgument, match="away from the torus"):
        torus_grid(cell, 7).unwrap(oracles.PeriodicCell(np.array(HEX) * 2))
    with pytest.raises(stellate.InvalidArgument, match="copies"):
        torus_grid(cell, 7).unwrap(cell).plain(0)


def as_servers_write(point):
    shown = ", ".join(f"{number:.4g}" for number in point[:6])
    return f"({shown}, ...)" if len(point) > 6 else f"({shown})"


@pytest.mark.parametrize("name", LATTICES)
def test_places_are_named_in_plain_coordinates(name, rng):
    cell = oracles.PeriodicCell(LATTICES[name])
    d = cell.dimension
    x = cell.coordinates(cell.embed(rng.random((50, d)) @ cell.lattice))
    points = cell.embed(x)
    solid = cell.solid(waves(cell.lattice))
    cut = cell.cut(waves(cell.lattice), labels=[1, 2], origin=0.1 * cell.lattice.sum(axis=0))
    for oracle in (cell, solid, cut, cell.level_set(waves(cell.lattice))):
        places = Places(oracle)
        said = places.in_words(f"near {as_servers_write(points[7])}, on wall 1 (0, 1)", points)
        plain = ", ".join(f"{number:.4g}" for number in x[7])
        assert said == f"near ({plain}), on wall 1 (0, 1)"
    # Where there is no vertex, what was written is all that there is, if it is whole.
    text = f"at {as_servers_write(points[7])}"
    said = places.in_words(text, points[:0])
    if len(cell.radii) > 3:
        assert said == text
    else:
        numbers = [float(number) for number in said[4:-1].split(", ")]
        off = (numbers - x[7]) @ np.linalg.inv(cell.lattice)
        assert np.abs(off - np.round(off)).max() < 1e-2


def test_places_of_other_oracles_are_left_as_they_are():
    class Plain:
        dimension, ambient_dimension = 2, 3

    text = "near (1, 2, 3)"
    assert Places(Plain()).in_words(text, np.zeros((1, 3))) == text


def test_an_incomplete_place_that_several_vertices_have_stays():
    cell = oracles.PeriodicCell(LATTICES["triclinic"])
    points = np.repeat(cell.embed([[0.1, 0.2, 0.3]]), 2, axis=0)
    points[1, 6:] = -points[1, 6:]

    class Told:
        coordinates = staticmethod(lambda points: points[:, 6:8])

    text = f"near {as_servers_write(points[0])}"
    assert Places(Told()).in_words(text, points) == text
    assert Places(Told()).in_words(text, points[:1]) != text
