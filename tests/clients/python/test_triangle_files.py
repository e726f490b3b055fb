"""Files of triangles by strangers: read, or refused in one way; none is waited for for ever."""

import os

import meshio
import numpy as np
import pytest
import stellate
from scipy import spatial
from stellate import oracles

CORNERS = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]])
FACES = np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]])


def written(folder, ending):
    path = folder / f"a.{ending}"
    meshio.write_points_cells(path, CORNERS, [("triangle", FACES)])
    return path


# Of these meshio reads on where .off, .ply and .msh end, exits the program over .vtk and .vtu, and
# raises ValueError, AssertionError, IndexError for the rest.
@pytest.mark.parametrize("ending", ["off", "ply", "stl", "msh", "vtk", "vtu"])
@pytest.mark.parametrize("share", [0.03, 0.6])
def test_a_file_cut_short_is_refused(ending, share, tmp_path):
    path = written(tmp_path, ending)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(stellate.InvalidArgument, match=rf"a\.{ending}.*(cannot be read|no tri)"):
        oracles.TriangleMesh(path, spacing=0.1)


def test_a_file_that_promises_too_much_fills_no_memory(tmp_path):
    path = tmp_path / "a.off"
    path.write_text("OFF\n1000000000 1000000000 0\n0 0 0\n")
    with pytest.raises(stellate.InvalidArgument, match="cannot be read as a mesh: MemoryError"):
        oracles.TriangleMesh(path)


@pytest.mark.parametrize(
    "name, words",
    [
        ("part.STEP", "exact faces .* Write .stl or .obj, .* gmsh"),
        ("part.igs", "exact faces .* Write .stl or .obj, .* gmsh"),
        ("part.blend", r"no format that meshio knows has the ending '\.blend'\. Write one"),
    ],
)
def test_a_file_of_another_kind_is_told_and_not_called_damaged(name, words, tmp_path):
    (tmp_path / name).write_text("ISO-10303-21;\nHEADER;\n")
    with pytest.raises(stellate.InvalidArgument, match=words) as caught:
        oracles.TriangleMesh(tmp_path / name)
    assert "damaged" not in str(caught.value)


def test_what_is_no_file_is_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe.off")  # opened, it would wait for ever
    for path in (tmp_path / "pipe.off", tmp_path):
        with pytest.raises(stellate.InvalidArgument, match="no file"):
            oracles.TriangleMesh(path)


def test_polygons_are_split(tmp_path):
    x = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1.0)])
    squares = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    meshio.write_points_cells(tmp_path / "cube.obj", x, [("quad", np.array(squares))])
    cube = oracles.TriangleMesh(tmp_path / "cube.obj", spacing=0.1)
    assert np.abs(cube.closest_point([[0.5, 0.5, 1.05]]) - [0.5, 0.5, 1]).max() < 1e-6


def test_creases_of_a_part_are_said_to_be_rounded():
    """A cube has twelve, whichever way round its triangles are; an icosahedron bends by 42 degrees."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    squares = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]
    faces = np.array([[q[i] for i in part] for q in squares for part in ((0, 1, 2), (0, 3, 2))])
    cube = oracles.TriangleMesh(corners, faces, spacing=0.1)
    assert "where 12 edges bend by more than 60 degrees" in cube.about
    golden = (1 + 5**0.5) / 2
    ball = [
        np.roll([0, a, b], turn) for turn in range(3) for a in (1, -1) for b in (golden, -golden)
    ]
    hull = spatial.ConvexHull(ball)
    assert "edges" not in oracles.TriangleMesh(hull.points, hull.simplices, spacing=0.3).about
