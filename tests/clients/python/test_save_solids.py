"""Solids in files of triangles: their surfaces."""

import itertools

import meshio
import numpy as np
import pytest
import stellate


def hollow_cube(cells=4):
    """Of cells^3 cubes in six tetrahedra each, without one in the middle; the simplices turned at random."""
    number = np.arange((cells + 1) ** 3).reshape([cells + 1] * 3)
    corners = [c for c in itertools.product(range(cells), repeat=3) if c != (1, 1, 1)]
    rows = []
    for corner, order in itertools.product(corners, itertools.permutations(range(3))):
        way = np.array(corner)[None] + np.vstack(
            [np.zeros(3, int), np.eye(3, dtype=int)[[*order]].cumsum(0)]
        )
        rows.append(number[tuple(way.T)])
    points = np.stack(np.meshgrid(*[np.arange(cells + 1.0)] * 3, indexing="ij"), axis=-1)
    return stellate.Mesh(points.reshape(-1, 3), np.sort(np.array(rows), axis=1))


@pytest.mark.parametrize("ending", [".obj", ".off", ".ply", ".stl"])
def test_a_solid_is_its_surface_in_formats_of_triangles(ending, tmp_path):
    solid = hollow_cube()
    stellate.check_save(tmp_path / f"solid{ending}", 3, 3)
    solid.save(tmp_path / f"solid{ending}")
    again = meshio.read(tmp_path / f"solid{ending}")
    triangles = again.cells_dict["triangle"]
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()  # watertight
    assert len(triangles) == 2 * (6 * 4 * 4 + 6)
    # Outwards on the outside, and into the cavity there.
    assert np.linalg.det(again.points[triangles]).sum() / 6 == pytest.approx(4**3 - 1)
    inside = (again.points > 2.5).all(axis=1) & (again.points < 3.5).all(axis=1)
    assert inside.any() == (ending == ".obj")  # which keeps the numbers of all points
