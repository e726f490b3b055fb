"""Clouds of points: how far their neighbours reach, by density and by noise."""

import numpy as np
import pytest
import stellate
from ready_shapes import TORUS, TURN, closest, torus_map
from stellate import oracles
from stellate.oracles._bandwidth import insist_on_flatness


def scan(count, noise, crowding=1):
    """At random places of a torus, closer together towards one of its meridians."""
    random = np.random.default_rng(1)
    u = random.random((count, 2))
    u[:, 0] **= crowding
    return torus_map(TURN * u) + random.normal(0, noise, (count, 3))


def errors(cloud, count=60):
    """How far its points are from the torus, and how its tangents turn from the torus', in degrees."""
    x = TORUS.closest_point(np.random.default_rng(2).uniform(-1.4, 1.4, (count, 3)) * [1, 1, 0.3])
    y, found = closest(cloud, x)
    assert found.all()
    near = TORUS.closest_point(y)
    ours, theirs = cloud.tangent_basis(y), TORUS.tangent_basis(near)
    cosines = np.linalg.svd(ours.transpose(0, 2, 1) @ theirs, compute_uv=False)[:, -1]
    turned = np.degrees(np.arccos(np.clip(cosines, 0, 1)))
    return np.linalg.norm(y - near, axis=1).max(), turned.max()


def test_more_points_of_one_scan_are_no_worse():
    few, many = (oracles.PointCloud(scan(count, 0.003), 2) for count in (8000, 80000))
    (off, turned), (many_off, many_turned) = errors(few), errors(many)
    assert many_off < off and many_off < 0.003
    assert many_turned < turned and many_turned < 3
    assert few.bandwidths.min() > 0.9 * few.bandwidth  # the noise decides, alike everywhere
    # As far as the noise takes, five times as far as twice the seventh neighbour.
    spacing = np.sqrt(15.8 / 80000)
    assert many.bandwidth > 5 * spacing


def test_an_uneven_cloud_has_as_many_neighbours_everywhere():
    points = scan(8000, 0, crowding=3)
    cloud = oracles.PointCloud(points, 2)
    low, high = np.quantile(cloud.bandwidths, [0.02, 0.98])
    assert high > 4 * low
    owners, _, _ = cloud._neighbours(points[::20])
    counts = np.bincount(owners, minlength=len(points[::20]))
    assert counts.min() >= 6
    assert counts.max() < 300  # of 8,000, which one bandwidth for all would make thousands of
    off, turned = errors(cloud)
    assert off < 0.01 and turned < 5
    x = points[:40] + 0.01
    together, found = closest(cloud, x)
    for rows in np.array_split(np.arange(40), 6):
        apart, here = closest(cloud, x[rows])
        assert (here == found[rows]).all() and (apart[here] == together[rows][here]).all()


def test_a_bandwidth_that_is_given_is_everybodys():
    cloud = oracles.PointCloud(scan(4000, 0.003), 2, bandwidth=0.25)
    assert cloud.bandwidth == 0.25 and (cloud.bandwidths == 0.25).all()
    with pytest.raises(stellate.InvalidArgument, match="bandwidth has to be positive"):
        oracles.PointCloud(scan(400, 0), 2, bandwidth=0)


def test_a_cloud_says_how_far_its_neighbours_reach():
    said = repr(oracles.PointCloud(scan(4000, 0.003), 2))
    assert "4,000 points of R^3" in said and "bandwidth 0." in said and "residual 0.00" in said


def test_points_that_come_several_times_are_no_neighbours_of_themselves():
    points = scan(4000, 0.003)
    again = np.concatenate([points, points[:1000], np.repeat(points[:3], 40, axis=0)])
    cloud = oracles.PointCloud(again, 2)
    assert cloud.bandwidths.min() > 0.7 * oracles.PointCloud(points, 2).bandwidths.min()
    off, turned = errors(cloud)
    assert off < 0.01 and turned < 5
    with pytest.raises(stellate.InvalidArgument, match="7 different points are too few"):
        oracles.PointCloud(np.repeat(points[:7], 40, axis=0), 2)


def test_what_is_made_of_a_cloud_tells_of_it_too():
    cloud = oracles.PointCloud(scan(4000, 0.003), 2)
    assert cloud.about == repr(cloud)
    half = oracles.Clipped(cloud, [oracles.HalfSpace([1, 0, 0])])
    assert half.about == cloud.about
    other = oracles.PointCloud(scan(4000, 0.003), 2, bandwidth=0.3)
    assert oracles.Product(cloud, cloud, other).about == f"{cloud.about}; {other.about}"
    torus = stellate.manifolds.Torus(1, 0.4)
    assert oracles.Product(torus, cloud).about == cloud.about
    assert oracles.Transformed(cloud).about == cloud.about
    assert oracles.Transformed(cloud, scale=2).about == cloud.about + ", scaled by 2"
    assert oracles.Transformed(torus, scale=2).about == ""
    assert oracles.LevelSet(cloud, lambda x: x[:, 2:]).about == cloud.about
    rim = oracles.Transformed(stellate.manifolds.Sphere(1), rotation=np.eye(3)[:, :2])
    assert oracles.ManifoldWithBoundary(cloud, rim).about == cloud.about


def colours(count):
    return np.random.default_rng(3).integers(0, 256, (count, 3)) / 50


@pytest.mark.parametrize(
    "points, dimension",
    [
        (scan(8000, 0.003), 1),
        (np.hstack([scan(8000, 0.003), colours(8000)]), 2),
        (np.random.default_rng(1).uniform(-1, 1, (8000, 3)), 2),
    ],
    ids=["a surface as a curve", "colours as coordinates", "a solid as a surface"],
)
def test_points_of_no_manifold_of_that_dimension_are_refused_before_all_are_neighbours(
    points, dimension
):
    with pytest.raises(stellate.InvalidArgument, match=f"no manifold of dimension {dimension}: .*"):
        oracles.PointCloud(points, dimension)


@pytest.mark.parametrize("count, noise", [(400, 0), (1000, 0.02), (8000, 0.08)])
def test_noise_and_distance_between_points_are_not_taken_for_a_wrong_dimension(count, noise):
    insist_on_flatness(scan(count, noise), 2)


def test_a_cloud_may_lie_far_from_the_origin():
    """As scans in coordinates of a map do, where rounding is coarser than what is converged to."""
    away = np.array([5e5, 5e6, 100.0])
    points = 25 * scan(4000, 0)
    x = points[::20] + 0.5
    near, found = closest(oracles.PointCloud(points, 2), x)
    far, found_far = closest(oracles.PointCloud(points + away, 2), x + away)
    assert found.all() and found_far.all()
    assert np.abs(far - away - near).max() < 1e-7


def test_points_as_columns_and_rows_that_are_none_are_told():
    points = scan(500, 0)
    with pytest.raises(stellate.InvalidArgument, match=r"give points\.T"):
        oracles.PointCloud(points.T, 2)
    lacking = np.arange(500) % 100 == 7
    for given in (
        np.where(lacking[:, None], np.nan, points),
        np.ma.masked_array(points, np.repeat(lacking[:, None], 3, axis=1)),
    ):
        with pytest.raises(stellate.InvalidArgument, match="row 7 is not finite.* 5 of 500 in all"):
            oracles.PointCloud(given, 2)
