"""Surfaces of values on a grid: the spline through them, and what is said of values that hold none."""

import numpy as np
import pytest
import stellate
from ready_shapes import closest
from scipy import ndimage
from stellate import oracles

OfGrid = oracles.SignedDistance.of_grid
OfVolume = oracles.SignedDistance.of_volume


def lattice(count=24):
    side = np.arange(count) - (count - 1) / 2
    return np.meshgrid(side, side, side, indexing="ij")


def ball(count=24, radius=8.0):
    x, y, z = lattice(count)
    return np.sqrt(x * x + y * y + z * z) - radius


def box_of(values, spacing=1.0):
    return np.zeros(values.ndim), spacing * (np.array(values.shape) - 1)


def radii(oracle, count=24, around=8.0):
    """Of the points that closest_point finds from about the ball's surface."""
    way = np.random.default_rng(1).normal(size=(200, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    middle = np.full(3, (count - 1) / 2)
    points, found = closest(oracle, middle + around * way)
    assert found.all()
    return np.linalg.norm(points - middle, axis=1)


@pytest.mark.parametrize("shape", [(9,), (7, 12), (6, 8, 5), (5, 4, 6, 5)])
def test_the_spline_is_scipys(shape):
    random = np.random.default_rng(1)
    values = random.normal(size=shape)
    values[(0,) * len(shape)] = -50
    lower, upper = random.uniform(-1, 0, len(shape)), random.uniform(1, 3, len(shape))
    spline = oracles._grid.Spline(oracles._grid.Grid(values, (lower, upper)), 1.0)
    x = random.uniform(lower, upper, (300, len(shape)))
    places = ((x - lower) / spline.spacing).T
    expected = ndimage.map_coordinates(values, places, order=3, mode="mirror")
    assert np.abs(spline.value(x) - expected).max() < 1e-12 * 50
    h = 1e-6
    for axis in range(len(shape)):
        step = h * np.eye(len(shape))[axis]
        slope = (spline.value(x + step) - spline.value(x - step)) / (2 * h)
        assert np.abs(spline.gradient(x)[:, axis] - slope).max() < 1e-6
    alone = [spline.gradient(row[None])[0] for row in x]
    assert np.array_equal(alone, spline.gradient(x))
    assert np.array_equal(np.concatenate([spline.value(row[None]) for row in x]), spline.value(x))


@pytest.mark.parametrize("sign", [1, -1], ids=["negative inside", "positive inside"])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
def test_there_is_no_other_surface_beyond_the_border(sign, scale):
    values = scale * (sign * ball() + 3)
    oracle = OfGrid(values, box_of(values), level=3 * scale)
    far = np.random.default_rng(1).uniform(-60, 80, (300, 3))
    points, found = closest(oracle, far)
    assert found.mean() > 0.5
    assert (np.abs(np.linalg.norm(points[found] - 11.5, axis=1) - 8) < 0.05).all()


def rounded_egg(parts):
    x, y, z = lattice()
    return np.round(parts * (10 - np.sqrt(x**2 + y**2 + 2 * z**2))) / parts


def test_numbers_that_equal_the_level_make_a_surface():
    values = rounded_egg(8)
    assert (values == 3).sum() > 50
    oracle = OfGrid(values, box_of(values), level=3)
    points, found = closest(oracle, np.random.default_rng(1).uniform(0, 23, (100, 3)))
    away = points[found] - 11.5
    assert found.mean() > 0.5
    assert np.abs(np.sqrt((away**2 * [1, 1, 2]).sum(axis=1)) - 7).max() < 1


def test_a_surface_that_leaves_the_grid_is_told_with_what_to_type():
    values = ball(radius=12.0)
    with pytest.raises(
        stellate.InvalidArgument, match="leaves the grid through its border"
    ) as told:
        OfGrid(values, box_of(values))
    place = [float(n) for n in str(told.value).split("near [")[1].split("]")[0].split(",")]
    assert any(side in (0.0, 23.0) for side in place)
    assert 'border="open"' in str(told.value) and "np.pad" in str(told.value)


def test_an_open_border_is_clipped():
    values = ball(radius=12.0)
    box = box_of(values)
    oracle = oracles.Clipped(OfGrid(values, box, border="open"), box=box)
    sides = np.random.default_rng(1).uniform(0, 23, (200, 3))
    sides[:, 0] = 0.0  # where it is met
    points, found = closest(oracle, sides)
    assert found.mean() > 0.9
    assert np.abs(np.linalg.norm(points[found] - 11.5, axis=1) - 12).max() < 0.03
    with pytest.raises(stellate.InvalidArgument, match="'closed' or 'open'"):
        OfGrid(values, box, border="clip")


@pytest.mark.parametrize("level", [0.5, 0.3])
def test_two_valued_data_is_told_and_smoothed(level):
    mask = ball() < 0
    for values in (mask, mask.astype(float), mask.astype(np.uint8)):
        with pytest.raises(stellate.InvalidArgument, match=r"labels and masks.*smooth=1.5"):
            OfGrid(values, box_of(values), level=level)
    ball_of_mask = OfVolume(mask, smooth=1.5)
    shape = " x ".join(map(str, mask.shape))
    told = f"a spline through {shape} values on a grid, spacing 1, smoothed by 1.5"
    assert ball_of_mask.about == told
    smooth = radii(ball_of_mask)
    assert np.abs(smooth - (8 - 1.5**2 / 8)).max() < 0.15


@pytest.mark.parametrize("parts", [1, 0.1])
def test_numbers_rounded_to_the_size_of_voxels_are_told(parts):
    values = rounded_egg(1) if parts == 1 else 10 * rounded_egg(1).astype(np.int16)
    with pytest.raises(stellate.InvalidArgument, match=r"rounded too coarsely.*smooth=1.5"):
        OfGrid(values, box_of(values), level=3 / parts)
    OfVolume(values, level=3 / parts, smooth=1.5)


def test_labels_are_told():
    labels = np.where(ball() < 0, 3, np.where(ball(radius=11) < 0, 7, 12))
    with pytest.raises(stellate.InvalidArgument, match="labels and masks"):
        OfVolume(labels, level=5)
    assert np.abs(radii(OfVolume(labels == 3, smooth=1.5)) - 8).max() < 0.4


def test_a_volume_lies_where_its_voxels_are():
    values = ball()
    oracle = OfVolume(values, spacing=[0.5, 0.25, 2], origin=[-1, 0, 4])
    assert oracle.resolution == 2
    lower, upper = oracle.bounding_box
    assert lower.tolist() == [-1, 0, 4] and upper.tolist() == [10.5, 5.75, 50]
    middle = (lower + upper) / 2
    away = (oracle.closest_point(middle + [[3.0, 0, 0], [0, 3.0, 0]]) - middle) / [0.5, 0.25, 2]
    assert np.abs(np.linalg.norm(away, axis=1) - 8).max() < 0.01


@pytest.mark.parametrize(
    "options, words",
    [
        ({"spacing": [1, 2]}, "one number or 3"),
        ({"spacing": 0}, "spacing has to be positive"),
        ({"smooth": -1}, "smooth not negative"),
        ({"level": 99}, "no set of level 99"),
    ],
)
def test_a_volume_that_makes_no_sense_is_refused(options, words):
    with pytest.raises(stellate.InvalidArgument, match=words):
        OfVolume(ball(), **options)


@pytest.mark.parametrize("make", [lambda v: OfVolume(v), lambda v: OfVolume(v, smooth=1.0)])
def test_what_was_not_measured_is_told_with_its_place(make):
    values = ball()
    lacking = values > 5
    first = str(np.argwhere(lacking)[0].tolist())
    for given in (np.where(lacking, np.nan, values), np.ma.masked_where(lacking, values)):
        with pytest.raises(stellate.InvalidArgument) as refusal:
            make(given)
        words = str(refusal.value)
        assert f"{lacking.sum():,} of {values.size:,} are NaN, infinite or masked" in words
        assert f"the first at index {first}. " in words and "np.where(np.isfinite(" in words
    make(np.ma.masked_array(values, mask=False))


def test_a_sheet_that_smoothing_takes_away_is_told_with_a_level_that_keeps_it():
    sheet = np.abs(ball(24, 8.0)) < 0.6  # a voxel
    with pytest.raises(stellate.InvalidArgument, match=r"thinner than some three.*level=") as told:
        OfVolume(sheet, smooth=1.5)
    level = float(str(told.value).split("level=")[1].split(",")[0])
    OfVolume(sheet, smooth=1.5, level=level)


@pytest.mark.parametrize("spacing", [1.0, (0.5, 0.5, 2.0), 1e-3, 1e3])
def test_a_smoothed_mask_is_not_said_to_have_a_wrong_derivative(spacing):
    """It is constant to rounding where it is far from the surface."""
    z, y, x = lattice(48)
    sides = np.broadcast_to(spacing, (3,))
    oracle = OfVolume(z * z + y * y + x * x < 150, spacing=spacing, smooth=1.5 * sides.min())
    lower, upper = oracle.bounding_box
    random = np.random.default_rng(3)
    for _ in range(12):
        closest(oracle, lower + random.random((100, 3)) * (upper - lower))


def test_smoothing_by_too_many_voxels_is_told():
    spacing = 0.05
    with pytest.raises(stellate.InvalidArgument, match=r"is a length.*40 voxels.*smooth=0.075"):
        OfVolume(ball() < 0, spacing=spacing, smooth=2)
    OfVolume(ball() < 0, spacing=spacing, smooth=0.075)
    with pytest.raises(stellate.InvalidArgument, match="no set of level 99"):
        OfVolume(ball(), level=99, smooth=40)  # nor was there before


def test_numbers_in_single_precision_are_data_like_others():
    values = ball()
    single = OfGrid(values.astype(np.float32), box_of(values))
    assert np.abs(radii(single) - radii(OfGrid(values, box_of(values)))).max() < 1e-5


@pytest.mark.parametrize("shape", [(1, 8, 8), (8, 8, 8, 1)])
def test_an_axis_of_one_value_is_told(shape):
    with pytest.raises(
        stellate.InvalidArgument, match=r"an axis of one value is none: squeeze\(\)"
    ):
        oracles.SignedDistance.of_volume(np.zeros(shape))


def segmented():
    """A ball of label 7 in one of label 3."""
    return np.select([ball() < -4, ball() < 0], [7, 3], 0).astype(np.int16)


@pytest.mark.parametrize("settings", [{}, {"smooth": 1.5}, {"level": 2, "smooth": 1.5}])
def test_labels_of_a_segmentation_are_no_values(settings):
    with pytest.raises(
        stellate.InvalidArgument, match=r"3 numbers 0, 3, 7 alone.*labels == 3.*solids\.Phases"
    ):
        OfVolume(segmented(), **settings)
    OfVolume(segmented() == 3, smooth=1.0)


def test_a_label_that_is_not_there_is_said_to_be_none():
    with pytest.raises(stellate.InvalidArgument, match=r"False everywhere.*np\.unique"):
        OfVolume(segmented() == 5, smooth=1.5)


def test_one_length_smooths_all_axes():
    with pytest.raises(stellate.InvalidArgument, match=r"smooth is one length.*\(1, 1, 2\)"):
        OfVolume(segmented() == 3, spacing=(1, 1, 2), smooth=(1, 1, 2))


def test_voxels_of_a_crystal_that_is_not_square_are_said_to_have_no_spacing():
    with pytest.raises(stellate.InvalidArgument, match=r"not square to each other.*\.cube"):
        OfVolume(ball(), spacing=np.eye(3) + 0.1)
