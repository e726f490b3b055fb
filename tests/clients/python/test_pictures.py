"""Slices and pictures."""

import builtins

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest
import shapes
import stellate
import topology

matplotlib.use("Agg")


def drawn(axes):
    """The corners that are drawn, and their colours."""
    (collection,) = axes.collections
    return collection


def test_a_slice_of_a_torus_is_two_circles():
    torus = shapes.torus()
    slice = torus.slice([1.0, 0.1, 0.0], 0.03)
    assert (slice.dimension, slice.ambient_dimension, slice.report) == (1, 3, None)
    assert topology.is_closed(slice.simplices)
    assert topology.betti_numbers(slice.simplices) == [2, 2]
    assert np.allclose(slice.points @ [1.0, 0.1, 0.0], 0.03, rtol=0, atol=1e-12)


@pytest.mark.parametrize("k", [2, 3, 4, 5])
def test_slices_of_spheres_are_spheres(k, rng):
    mesh = shapes.simplex_boundary(k)
    normal = rng.normal(size=mesh.ambient_dimension)
    heights = np.sort(mesh.points @ normal)
    for low, high in zip(heights, heights[1:]):  # one vertex above, two above, ...
        slice = mesh.slice(normal, (low + high) / 2)
        assert slice.dimension == k - 1
        sphere = [1] + [0] * (k - 2) + [1]
        assert topology.is_closed(slice.simplices)
        assert topology.betti_numbers(slice.simplices) == sphere


def test_a_slice_through_vertices_is_still_closed():
    torus = shapes.torus()
    level = float(torus.points[5, 0])
    assert topology.is_closed(torus.slice(0, level).simplices)


def test_a_slice_that_misses_is_empty_and_no_picture():
    missed = shapes.torus().slice(2, 10.0)
    assert missed.points.shape == (0, 3) and missed.simplices.shape == (0, 2)
    with pytest.raises(stellate.InvalidArgument, match="does not meet"):
        missed.plot()


@pytest.mark.parametrize("normal", [3, -1, [1.0, 2.0], [0, 0, 0], [np.nan, 0, 1]])
def test_what_is_no_hyperplane_is_refused(normal):
    with pytest.raises(stellate.InvalidArgument):
        shapes.torus().slice(normal)


def test_a_surface_is_drawn_with_all_its_triangles(tmp_path):
    torus = shapes.torus()
    axes = torus.plot()
    assert len(drawn(axes).get_facecolor()) == len(torus.simplices)
    axes.figure.savefig(tmp_path / "torus.png")
    picture = matplotlib.image.imread(tmp_path / "torus.png")
    assert (picture[..., :3] < 0.99).any(axis=2).mean() > 0.05


def test_a_curve_is_drawn_and_axes_are_taken():
    axes = plt.figure().add_subplot(projection="3d")
    assert shapes.polygon(9, 3).plot(ax=axes) is axes
    assert len(axes.collections) == 1


def test_more_dimensions_are_sliced_and_coloured():
    axes = shapes.simplex_boundary(3).plot()
    assert len(drawn(axes).get_facecolor()) > 0
    assert [axes.get_xlabel(), axes.get_ylabel(), axes.get_zlabel()] == ["x1", "x2", "x3"]
    projected = shapes.projective_plane()
    matrix = np.eye(projected.ambient_dimension)[[2, 0, 1]]
    values = np.arange(len(projected.points), dtype=float)
    axes = projected.plot(coordinates=matrix, color=values)
    assert len(np.unique(drawn(axes).get_facecolor(), axis=0)) > 3


def test_two_coordinates_make_a_flat_picture():
    axes = shapes.torus().plot(coordinates=[0, 2])
    assert axes.name == "rectilinear"


@pytest.mark.parametrize(
    "wrong",
    [
        {"coordinates": [0]},
        {"coordinates": [0, 1, 7]},
        {"coordinates": "xyz"},
        {"color": [1.0, 2.0]},
        {"color": 9},
        {"slices": [(0, 0.03), (1, 0.9), (2, 0.0)]},
    ],
)
def test_wrong_pictures_are_refused(wrong):
    with pytest.raises(stellate.InvalidArgument):
        shapes.torus().plot(**wrong)


def test_without_matplotlib_the_error_says_how_to_get_it(monkeypatch):
    real = builtins.__import__

    def without(name, *rest, **more):
        if name.startswith("matplotlib"):
            raise ImportError(name)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ImportError, match="pip install matplotlib"):
        shapes.torus().plot()


@pytest.fixture(autouse=True)
def closed_figures():
    yield
    plt.close("all")


def test_the_numbers_of_a_thin_axis_have_place():
    """Of a terrain a hundredth as high as wide, whose picture had eight heights over each other."""
    corners = np.array([[0, 0, 0], [40, 0, 0.4], [0, 40, 0.2], [40, 40, 0.0]])
    axes = stellate.Mesh(corners, np.array([[0, 1, 2], [1, 2, 3]])).plot()
    axes.figure.canvas.draw()
    low, high = axes.get_zlim()
    assert sum(low <= at <= high for at in axes.zaxis.get_ticklocs()) <= 2
    low, high = axes.get_xlim()
    assert sum(low <= at <= high for at in axes.xaxis.get_ticklocs()) >= 4
    plt.close(axes.figure)
