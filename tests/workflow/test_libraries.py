"""Meshes in PyVista, trimesh, Open3D and scikit-fem: these see the surface that we see."""

import re

import numpy as np
import pytest
import pyvista
import shapes
import stellate
import trimesh


def area(mesh):
    a, b, c = (mesh.points[mesh.simplices[:, i]] for i in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def test_pyvista_has_the_surface():
    torus = shapes.torus()
    grid = torus.to_pyvista()
    assert (grid.n_points, grid.n_cells) == (len(torus.points), len(torus.simplices))
    assert np.isclose(grid.area, area(torus), rtol=1e-9, atol=0)
    surface = grid.extract_surface()
    assert surface.is_manifold and surface.n_open_edges == 0
    assert surface.volume > 0


def test_pyvista_has_solids_with_all_their_coordinates():
    sphere = shapes.simplex_boundary(3)
    grid = sphere.to_pyvista()
    assert set(grid.celltypes) == {10}  # VTK_TETRA
    assert np.array_equal(grid.point_data["coordinates"], sphere.points)
    cells = np.sort(grid.cells.reshape(-1, 5)[:, 1:], axis=1)
    assert {tuple(row) for row in cells} == {tuple(row) for row in sphere.simplices}


def test_pyvista_has_curves():
    polygon = shapes.polygon(9, 5)
    assert polygon.to_pyvista().n_cells == len(polygon.simplices)


def test_pyvista_follows_a_series_while_it_grows(tmp_path):
    torus = shapes.torus()
    wanted = [len(torus.simplices) // share for share in (3, 2, 1)]
    read = []

    def growing():
        for revision, count in enumerate(wanted, 1):
            yield stellate.Mesh(torus.points, torus.simplices[:count], revision=revision)
            reader = pyvista.get_reader(tmp_path / "torus.pvd")
            reader.set_active_time_value(reader.time_values[-1])
            read.append((reader.time_values, reader.read()[0]))

    stellate.save_series(growing(), tmp_path / "torus.pvd")
    assert [times for times, _ in read] == [[1.0], [1.0, 2.0], [1.0, 2.0, 3.0]]
    assert [grid.n_cells for _, grid in read] == wanted
    assert np.isclose(read[-1][1].area, area(torus), rtol=1e-9, atol=0)


def test_trimesh_finds_the_torus_closed_and_turned_outwards():
    torus = shapes.torus()
    converted = torus.to_trimesh()
    assert converted.is_watertight and converted.is_winding_consistent
    assert converted.euler_number == 0
    assert converted.volume > 0
    assert np.isclose(converted.area, area(torus), rtol=1e-9, atol=0)


def test_open3d_finds_the_torus_closed():
    torus = shapes.torus()
    converted = torus.to_open3d()
    assert converted.is_watertight() and converted.is_orientable()
    assert converted.euler_poincare_characteristic() == 0
    assert converted.get_volume() > 0
    assert np.isclose(converted.get_surface_area(), area(torus), rtol=1e-9, atol=0)
    lines = shapes.polygon(9, 3).to_open3d()
    assert len(lines.lines) == 9 and len(lines.points) == 9


@pytest.mark.parametrize(
    "convert, mesh",
    [
        ("to_pyvista", shapes.simplex_boundary(4)),
        ("to_trimesh", shapes.projective_plane()),
        ("to_trimesh", shapes.polygon(9, 3)),
        ("to_open3d", shapes.simplex_boundary(3)),
    ],
)
def test_what_a_library_cannot_hold_is_refused(convert, mesh):
    with pytest.raises(stellate.InvalidArgument, match="takes meshes with k in"):
        getattr(mesh, convert)()


def test_scenes_are_read_by_trimesh_and_open3d(tmp_path):
    open3d = pytest.importorskip("open3d")
    torus = shapes.torus()
    torus.save(tmp_path / "torus.glb")
    (part,) = trimesh.load(tmp_path / "torus.glb").geometry.values()
    assert part.is_watertight and part.volume > 0
    assert np.isclose(part.area, area(torus), rtol=1e-5, atol=0)
    read = open3d.io.read_triangle_mesh(str(tmp_path / "torus.glb"))
    assert len(read.triangles) == len(torus.simplices) and read.has_vertex_normals()


def test_scikit_fem_hears_the_drum_of_the_page(tmp_path, monkeypatch, repository):
    """Gradients along the boundary of a solid are those of the mesh of its boundary."""
    monkeypatch.chdir(tmp_path)
    page = (repository / "docs" / "fields" / "elements.md").read_text()
    known = {}
    for block in re.findall(r"^```python\n(.*?)^```", page, re.M | re.S):
        exec(block, known)
    solid, dome, tets = known["solid"], known["dome"], known["tets"]
    mesh = stellate.Mesh(solid.points, np.sort(tets.facets[:, dome].T, axis=1))
    assert len(mesh.simplices) == len(solid.boundary[0].simplices)
    stiffness, _ = mesh.laplacian()
    assert np.abs(known["K"] - stiffness).max() < 1e-9
    assert np.isclose(known["M"].sum(), mesh.area, rtol=1e-9, atol=0)
