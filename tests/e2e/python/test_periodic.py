"""Surfaces and solids that repeat by a lattice, through the real server, judged in plain coordinates."""

import numpy as np
import pytest
import stellate
from stellate import oracles
from topology import euler_characteristic, is_closed

norm = np.linalg.norm
LATTICES = {
    "cubic": np.eye(3) * 2 * np.pi,
    "hexagonal": np.array([[6, 0, 0], [-3, 6 * np.sqrt(0.75), 0], [0, 0, 7]]),
    "triclinic": np.array([[6, 0, 0], [1.1, 5.7, 0], [0.7, -0.9, 7.0]]),
}


class Gyroid:
    """sin x cos y + sin y cos z + sin z cos x, of lattice coordinates, above a level."""

    def __init__(self, lattice, level=0.0):
        self.cell, self.level = oracles.PeriodicCell(lattice), level
        self.inverse = 2 * np.pi * np.linalg.inv(lattice)

    def __call__(self, p):
        x, y, z = 2 * np.pi * self.cell.fractional(p).T
        return np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x) - self.level

    def gradient(self, p):
        x, y, z = 2 * np.pi * self.cell.fractional(p).T
        slopes = [
            np.cos(x) * np.cos(y) - np.sin(z) * np.sin(x),
            np.cos(y) * np.cos(z) - np.sin(x) * np.sin(y),
            np.cos(z) * np.cos(x) - np.sin(y) * np.sin(z),
        ]
        return (np.stack(slopes, axis=1)[:, None, :] * self.inverse).sum(axis=2)


def sizes(corners):
    """Of simplices (m, k+1, d): lengths, areas, volumes."""
    edges = corners[:, 1:] - corners[:, :1]
    k = edges.shape[1]
    return np.sqrt(np.linalg.det(edges @ np.swapaxes(edges, 1, 2))) / np.prod(np.arange(1, k + 1))


def thrown(lattice, count=400_000):
    return np.random.default_rng(5).random((count, len(lattice))) @ lattice


def area(g, lattice):
    """Of {g = 0} in a cell: of the layers |g| < w, as thick as 2 w over the gradient."""
    x, w = thrown(lattice), 0.1
    near = np.abs(g(x)) < w
    return norm(g.gradient(x[near]), axis=1).sum() / (2 * w) / len(x) * abs(np.linalg.det(lattice))


def glued(plain, pairs):
    same = np.arange(len(plain.points))
    same[pairs[:, 1]] = pairs[:, 0]
    return same[plain.simplices]


@pytest.mark.parametrize(
    "name, epsilon", [("cubic", 0.45), ("hexagonal", 0.35), ("triclinic", 0.45)]
)
def test_a_gyroid_surface(server, name, epsilon):
    lattice = LATTICES[name]
    cell, g = oracles.PeriodicCell(lattice), Gyroid(lattice)
    mesh = stellate.mesh(cell.level_set(g, g.gradient), epsilon, server=server)
    assert mesh.certified, mesh.report
    assert is_closed(mesh.simplices) and euler_characteristic(mesh.simplices) == -8
    period = mesh.unwrap(cell)
    assert np.abs(g(period.points)).max() < 1e-9
    assert sizes(period.corners()).sum() == pytest.approx(area(g, lattice), rel=0.03)
    # Eight periods, glued, are a surface that is eight times as much.
    plain = period.plain(2)
    assert len(plain.simplices) == 8 * len(mesh.simplices)
    assert np.abs(g(plain.points)).max() < 1e-9
    pairs, periods = period.node_pairs(2)
    off = plain.points[pairs[:, 1]] - plain.points[pairs[:, 0]] - periods @ lattice
    assert np.abs(off).max() < 1e-9
    closed = glued(plain, pairs)
    assert is_closed(closed) and euler_characteristic(closed) == -64


@pytest.mark.parametrize(
    "name, epsilon", [("cubic", 0.45), ("hexagonal", 0.28), ("triclinic", 0.45)]
)
def test_a_gyroid_solid(server, name, epsilon):
    lattice = LATTICES[name]
    cell, g = oracles.PeriodicCell(lattice), Gyroid(lattice, 0.3)
    mesh = stellate.mesh(cell.solid(g, g.gradient), epsilon, server=server)
    assert mesh.certified, mesh.report
    assert euler_characteristic(mesh.simplices) == -4
    period = mesh.unwrap(cell)
    volume = abs(np.linalg.det(lattice))
    inside = (g(thrown(lattice)) > 0).mean() * volume
    assert sizes(period.corners()).sum() == pytest.approx(inside, rel=0.01)
    assert g(period.points).min() > -1e-9
    plain = period.plain()
    (skin,) = plain.boundary  # where the wall is, and not where the cell ends
    assert np.abs(g(plain.points[np.unique(skin.simplices)])).max() < 1e-9
    assert len(skin.simplices) == len(mesh.boundary[0].simplices)
    assert sizes(plain.points[skin.simplices]).sum() == pytest.approx(area(g, lattice), rel=0.03)
    pairs, _ = period.node_pairs()
    assert euler_characteristic(glued(plain, pairs)) == -4 and len(pairs) > 50


def test_a_sheet_between_two_walls(server):
    lattice = LATTICES["cubic"]
    cell, above, below = oracles.PeriodicCell(lattice), Gyroid(lattice, -0.8), Gyroid(lattice, 0.8)
    walls = [above, lambda x: -below(x)]
    slopes = [above.gradient, lambda x: -below.gradient(x)]
    mesh = stellate.mesh(cell.solid(walls, slopes), 0.4, server=server)
    assert mesh.certified, mesh.report
    assert {face.walls for face in mesh.boundary} == {(0,), (1,)} and not mesh.edges
    x = thrown(lattice)
    inside = ((above(x) > 0) & (below(x) < 0)).mean() * abs(np.linalg.det(lattice))
    assert sizes(mesh.unwrap(cell).corners()).sum() == pytest.approx(inside, rel=0.03)
    assert euler_characteristic(mesh.simplices) == -8


def test_a_plate_of_a_plane_cell(server):
    lattice = np.array([[1, 0], [-0.5, np.sqrt(0.75)]])
    cell = oracles.PeriodicCell(lattice)

    def g(x):  # hexagonally symmetric: holes about the lattice's points
        first, second = 2 * np.pi * cell.fractional(x).T
        return 0.4 - np.cos(first) - np.cos(second) - np.cos(first + second)

    mesh = stellate.mesh(cell.solid(g), 0.035, server=server)
    assert mesh.certified and euler_characteristic(mesh.simplices) == -1
    corners = mesh.unwrap(cell).corners()
    inside = (g(thrown(lattice)) > 0).mean() * np.sqrt(0.75)
    assert sizes(corners).sum() == pytest.approx(inside, rel=0.01)


def test_the_doctor_finds_nothing_wrong():
    assert stellate.check(oracles.PeriodicCell(LATTICES["triclinic"])).ok
