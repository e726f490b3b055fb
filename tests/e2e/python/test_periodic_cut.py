"""Periodic cells cut along their faces, through the real server: opposite faces have the same nodes, and
finite elements with periodic conditions find the known conductivity of a laminate."""

import math
import re

import numpy as np
import pytest
import scipy.sparse as sparse
import scipy.sparse.linalg as linalg
import stellate
from stellate import oracles

OBLIQUE = np.array([[1, 0], [0.3, 0.9]])


def shares(cell, period, points):
    return (points - period.origin) @ np.linalg.inv(cell.lattice)


def hold(cell, period, plain):
    """The cell is filled, its faces are plane, and opposite ones have the same nodes and facets."""
    d = len(cell.lattice)
    at = shares(cell, period, plain.points)
    assert at.min() > -1e-12 and at.max() < 1 + 1e-12
    edges = plain.points[plain.simplices][:, 1:] - plain.points[plain.simplices][:, :1]
    sizes = np.abs(np.linalg.det(edges)) / math.factorial(d)
    pairs, periods = period.node_pairs()
    apart = plain.points[pairs[:, 1]] - plain.points[pairs[:, 0]] - periods @ cell.lattice
    assert np.abs(apart).max() < 1e-12
    same = np.arange(len(plain.points))
    same[pairs[:, 1]] = pairs[:, 0]
    facets = np.concatenate([np.delete(plain.simplices, i, axis=1) for i in range(d + 1)])
    facets, counts = np.unique(facets, axis=0, return_counts=True)
    border = facets[counts == 1]
    for axis in range(d):
        low, high = (
            border[(np.abs(at[border, axis] - side) < 1e-12).all(axis=1)] for side in (0, 1)
        )
        assert len(low) == len(high) > 2
        rows = [np.unique(np.sort(same[face], axis=1), axis=0) for face in (low, high)]
        assert np.array_equal(*rows)
    return sizes


def conductivity(plain, pairs, of_simplices, volume):
    """(d, d): what the cell conducts on the whole, by linear finite elements with periodic conditions."""
    d = plain.points.shape[1]
    same = np.arange(len(plain.points))
    same[pairs[:, 1]] = pairs[:, 0]
    used, ids = np.unique(same[plain.simplices], return_inverse=True)
    ids = ids.reshape(plain.simplices.shape)
    corners = plain.points[plain.simplices]
    edges = corners[:, 1:] - corners[:, :1]
    slopes = np.linalg.inv(edges).transpose(0, 2, 1)
    slopes = np.concatenate([-slopes.sum(axis=1, keepdims=True), slopes], axis=1)
    weight = of_simplices * np.abs(np.linalg.det(edges)) / math.factorial(d)
    stiff = np.einsum("m,mia,mja->mij", weight, slopes, slopes)
    places = np.repeat(ids, d + 1, axis=1).ravel(), np.tile(ids, (1, d + 1)).ravel()
    matrix = sparse.csr_matrix((stiff.ravel(), places), (len(used),) * 2)[1:, 1:].tocsc()
    whole = np.zeros((d, d))
    for axis in range(d):
        load = -np.bincount(ids.ravel(), (weight[:, None] * slopes[:, :, axis]).ravel())
        field = np.append(0, linalg.spsolve(matrix, load[1:]))
        flux = np.eye(d)[axis] + np.einsum("mi,mia->ma", field[ids], slopes)
        whole[axis] = (weight[:, None] * flux).sum(axis=0) / volume
    return whole


@pytest.mark.parametrize(
    "lattice, epsilon, origin",
    [(np.eye(2), 0.06, None), (OBLIQUE, 0.04, [0.2, 0.1]), (np.eye(3), 0.1, [0.1, -0.3, 0])],
    ids=["square", "oblique", "cube"],
)
def test_a_laminate_conducts_as_it_is_known_to(server, lattice, epsilon, origin):
    cell = oracles.PeriodicCell(lattice)
    normal = cell.dual[0]

    def layers(x):
        return np.cos(2 * np.pi * cell.fractional(x)[:, 0])

    def gradient(x):
        return -2 * np.pi * np.sin(2 * np.pi * cell.fractional(x)[:, :1]) * normal

    cut = cell.cut(layers, gradient, labels=[1, 2], origin=origin, names=["soft", "hard"])
    mesh = stellate.mesh(cut, epsilon, server=server)
    assert mesh.certified, mesh.report
    period = mesh.unwrap(cut)
    plain = period.plain()
    sizes = hold(cell, period, plain)
    volume = abs(np.linalg.det(lattice))
    for label in (1, 2):
        assert sizes[plain.labels == label].sum() == pytest.approx(volume / 2, rel=1e-9)
    assert len(plain.region("hard").simplices) == (plain.labels == 2).sum()
    hard, soft = 10.0, 1.0
    pairs, _ = period.node_pairs()
    found = conductivity(plain, pairs, np.where(plain.labels == 2, hard, soft), volume)
    # In series across the layers, side by side along them.
    across = np.outer(normal, normal) / (normal @ normal)
    known = 2 / (1 / hard + 1 / soft) * across + (hard + soft) / 2 * (np.eye(len(lattice)) - across)
    assert found == pytest.approx(known, abs=1e-9)


def test_two_phases_that_both_go_through_the_cell(server):
    """Schwarz P, which crosses the faces squarely."""
    cell = oracles.PeriodicCell(2 * np.pi * np.eye(3))

    def schwarz(x):
        return np.cos(x).sum(axis=1)

    cut = cell.cut(schwarz, lambda x: -np.sin(x), labels=[1, 2])
    mesh = stellate.mesh(cut, 0.5, server=server)
    assert mesh.certified, mesh.report
    period = mesh.unwrap(cut)
    plain = period.plain()
    sizes = hold(cell, period, plain)
    assert sizes.sum() == pytest.approx(8 * np.pi**3, rel=1e-9)
    middles = plain.points[plain.simplices].mean(axis=1)
    assert ((schwarz(middles) > 0) == (plain.labels == 2)).mean() > 0.98
    # Both phases have the same volume, and any two of the axes are alike.
    assert sizes[plain.labels == 2].sum() == pytest.approx(4 * np.pi**3, rel=0.02)
    pairs, _ = period.node_pairs()
    found = conductivity(plain, pairs, np.where(plain.labels == 2, 4.0, 1.0), sizes.sum())
    assert np.diag(found) == pytest.approx(np.trace(found) / 3, rel=0.01)
    # The bounds of Hashin and Shtrikman for two halves.
    low, high = 1 + 0.5 / (1 / 3 + 0.5 / 3), 4 + 0.5 / (-1 / 3 + 0.5 / 12)
    assert low < np.trace(found) / 3 < high


def test_a_plate_with_holes_is_cut(server):
    """A solid, not all of the cell: only where it is there are faces and nodes."""
    cell = oracles.PeriodicCell(np.eye(2))
    cut = cell.cut(lambda x: 0.5 - np.cos(2 * np.pi * x).sum(axis=1), origin=[-0.5, -0.5])
    mesh = stellate.mesh(cut, 0.05, server=server)
    assert mesh.certified, mesh.report
    plain = mesh.unwrap(cut).plain(copies=(2, 1))
    assert plain.points.min(axis=0) == pytest.approx([-0.5, -0.5])
    assert plain.points.max(axis=0) == pytest.approx([1.5, 0.5])
    pairs, periods = mesh.unwrap(cut).node_pairs(copies=(2, 1))
    assert len(pairs) > 10 and {tuple(p) for p in np.abs(periods).tolist()} == {
        (2, 0),
        (0, 1),
        (2, 1),
    }


def test_what_cannot_be_cut_is_refused(server):
    cell = oracles.PeriodicCell(np.eye(3))
    with pytest.raises(stellate.InvalidArgument, match="14 walls, and 3 that cut"):
        cell.cut([lambda x: np.cos(2 * np.pi * x[:, 0])] * 14)
    with pytest.raises(stellate.InvalidArgument, match="origin has to be a point of R.3"):
        cell.cut(origin=[0, 0])
    with pytest.raises(stellate.InvalidArgument, match="labels have to be 2 whole numbers"):
        cell.cut(lambda x: np.cos(2 * np.pi * x[:, 0]), labels=[1, 2, 3])
    with pytest.raises(stellate.InvalidArgument, match="16 labels above 0, each in 8 parts"):
        cell.cut(
            [lambda x, i=i: np.cos(2 * np.pi * (x[:, 0] - i / 9)) for i in range(4)],
            labels=range(1, 17),
        )
    plain = stellate.mesh(cell.solid(lambda x: np.cos(2 * np.pi * x[:, 0])), 0.12, server=server)
    with pytest.raises(stellate.InvalidArgument, match="not of this cell that is cut"):
        plain.unwrap(cell.cut())


def test_a_refusal_and_a_report_name_places_in_plain_coordinates(server):
    cell = oracles.PeriodicCell(np.eye(2))
    stripe = lambda x: np.cos(2 * np.pi * x[:, 0])  # noqa: E731
    wavy = lambda x: stripe(x) + 0.05 * np.sin(2 * np.pi * x[:, 1])  # noqa: E731
    with pytest.raises(stellate.OracleError, match="walls 0 and 1 at 177.1 degrees") as refused:
        stellate.mesh(cell.solid([stripe, wavy]), 0.05, server=server)
    at = re.search(r"degrees, at \((\S+), (\S+)\);", str(refused.value))
    assert np.abs(2 * (float(at[1]) - 0.25) - np.round(2 * (float(at[1]) - 0.25))) < 1e-3
    assert np.abs(2 * float(at[2]) - np.round(2 * float(at[2]))) < 1e-3
    oblique = lambda x: stripe(x) / 2 + np.sin(2 * np.pi * x[:, 1])  # noqa: E731
    mesh = stellate.mesh(cell.solid([stripe, oblique]), 0.05, server=server)
    sharpest = mesh.report.certificate.sharpest
    assert mesh.certified and len(sharpest.point) == 2
    assert (
        np.abs([stripe(np.array([sharpest.point])), oblique(np.array([sharpest.point]))]).max()
        < 1e-9
    )


def test_a_gyroid_is_cut_at_a_corner_without_symmetry(server):
    """Walls that meet at 38 degrees, so that some answers on a face are used by no star: they are no
    points of the inside, though the mesh is far from them."""
    cell = oracles.PeriodicCell(2 * np.pi * np.eye(3))

    def gyroid(x):
        return sum(np.sin(x[:, i]) * np.cos(x[:, (i + 1) % 3]) for i in range(3))

    cut = cell.cut(gyroid, labels=[1, 2], origin=[0.3, 0.4, 0.5])
    mesh = stellate.mesh(cut, 0.45, server=server)
    assert mesh.certified, mesh.report.certificate.verdict
    plain = mesh.unwrap(cut).plain()
    volumes = [plain.region(label).volume for label in (1, 2)]
    assert np.allclose(volumes, 4 * np.pi**3, rtol=1e-3)
