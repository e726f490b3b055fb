"""What is measured on meshes, beside closed forms; errors fall with epsilon squared."""

import re

import numpy as np
import pytest
import stellate
from stellate import manifolds, oracles
from stellate import solids as s
from topology import euler_characteristic

PI = np.pi
norm = np.linalg.norm


def torus(x):
    return ((np.hypot(x[:, 0], x[:, 1]) - 1) ** 2 + x[:, 2] ** 2 - 0.4**2)[:, None]


TORUS_BOX = [-1.5, -1.5, -0.5], [1.5, 1.5, 0.5]


def held(server, make, epsilons, measures):
    """Each measure, (function of a mesh, closed form), comes nearer with epsilon squared."""
    meshes = [stellate.mesh(make(), epsilon, server=server) for epsilon in epsilons]
    assert all(mesh.certified for mesh in meshes)
    for measure, exact in measures:
        errors = [abs(measure(mesh) - exact) / abs(exact) for mesh in meshes]
        order = np.log(errors[0] / errors[1]) / np.log(epsilons[0] / epsilons[1])
        assert 1.7 < order < 2.3, (order, errors)
        assert errors[1] < 0.04, errors
    return meshes


def test_a_sphere(server):
    mesh = held(
        server,
        lambda: manifolds.Sphere(2),
        (0.1, 0.05),
        [
            (lambda mesh: mesh.area, 4 * PI),
            (lambda mesh: mesh.volume, 4 * PI),
            (lambda mesh: mesh.enclosed_volume, 4 / 3 * PI),
            # The integral of z^2.
            (lambda mesh: mesh.points[:, 2] ** 2 @ mesh.point_volumes(), 4 / 3 * PI),
        ],
    )[1]
    assert mesh.euler == 2
    middles = mesh.points[mesh.simplices].mean(axis=1)
    normals = mesh.normals()
    assert np.abs(norm(normals, axis=1) - 1).max() < 1e-12
    assert norm(normals - middles / norm(middles, axis=1)[:, None], axis=1).max() < 0.1
    assert len(mesh.boundary_mesh().simplices) == 0


def test_a_torus(server):
    mesh = held(
        server,
        manifolds.Torus,
        (0.06, 0.03),
        [
            (lambda mesh: mesh.area, 4 * PI**2 * 0.4),
            (lambda mesh: mesh.enclosed_volume, 2 * PI**2 * 0.4**2),
        ],
    )[0]
    assert mesh.euler == 0
    ring = mesh.points[mesh.simplices].mean(axis=1)
    ring[:, :2] *= 1 - 1 / norm(ring[:, :2], axis=1)[:, None]
    assert ((mesh.normals() * ring).sum(axis=1) > 0).all()


def test_a_curve(server):
    mesh = held(
        server,
        lambda: manifolds.Sphere(1),
        (0.2, 0.1),
        [(lambda mesh: mesh.volume, 2 * PI), (lambda mesh: mesh.enclosed_volume, PI)],
    )[1]
    assert mesh.euler == 0
    assert ((mesh.normals() * mesh.points[mesh.simplices].mean(axis=1)).sum(axis=1) > 0).all()
    with pytest.raises(stellate.InvalidArgument, match="has a volume, and no area"):
        mesh.area  # noqa: B018


@pytest.mark.parametrize(
    "oracle, epsilon, name, exact, options",
    [
        (manifolds.Sphere(1), 0.2, "length", 2 * PI, {}),
        (manifolds.Torus(), 0.1, "area", 4 * PI**2 * 0.4, {}),
        (manifolds.SpecialOrthogonal3(), 0.5, "volume", 8 * PI**2 * 2**1.5, {}),
        (s.Ball(), 0.3, "volume", 4 / 3 * PI, {}),
        (s.Ball(), 0.3, "volume", 4 / 3 * PI, {"boundary_only": True}),  # which that encloses
    ],
)
def test_the_report_measures_and_says_how_far_that_is_off(
    server, oracle, epsilon, name, exact, options
):
    mesh = stellate.mesh(oracle, epsilon, server=server, **options)
    assert mesh.certified
    said = re.fullmatch(
        rf"{name} (\S+), off by O\(epsilon\^2\): a share of about (\S+)",
        dict(mesh.report.lines())["measure"],
    )
    size, share = map(float, said.groups())
    assert size == pytest.approx(mesh.report.certificate.volume, rel=1e-5)
    own = mesh.enclosed_volume if options else mesh.volume
    assert size == pytest.approx(own, rel=1e-5)
    assert share == pytest.approx(mesh.report.certificate.epsilon_over_reach**2, rel=0.5)
    assert exact * (1 - share) < size < exact


def test_a_ball_and_a_shell(server):
    ball = held(
        server,
        s.Ball,
        (0.4, 0.2),
        [
            (lambda mesh: mesh.volume, 4 / 3 * PI),
            (lambda mesh: mesh.area, 4 * PI),
        ],
    )[1]
    assert ball.euler == 1 and ball.boundary_mesh().euler == 2
    assert ball.boundary_mesh().enclosed_volume == pytest.approx(ball.volume, rel=1e-12)
    # The inner boundary is turned into the cavity: what is enclosed is the solid, not both balls.
    shell = stellate.mesh(s.Ball() - s.Ball(0.5), 0.2, server=server)
    surface = shell.boundary_mesh()
    assert surface.enclosed_volume == pytest.approx(shell.volume, rel=1e-12)
    assert shell.volume == pytest.approx(4 / 3 * PI * (1 - 0.125), rel=0.04)
    # Everywhere but next to the corners of flat triangles, away from the shell.
    middles = surface.points[surface.simplices].mean(axis=1)
    outwards = np.where(norm(middles, axis=1) > 0.75, 1, -1)
    assert ((surface.normals() * middles).sum(axis=1) * outwards > 0).all()


def test_rotations(server):
    """SO(3) in R^9, where a turn by an angle moves by sqrt 2 of it: 8 pi^2 * 2^(3/2)."""
    mesh = held(
        server,
        manifolds.SpecialOrthogonal3,
        (0.8, 0.5),
        [(lambda mesh: mesh.volume, 8 * PI**2 * 2**1.5)],
    )[0]
    assert mesh.euler == 0
    for refused in (mesh.normals, lambda: mesh.enclosed_volume):
        with pytest.raises(stellate.InvalidArgument, match="hypersurfaces"):
            refused()


def test_a_solid_of_two_materials(server):
    grain = 4 / 3 * PI * 0.6**3
    composite = s.Labels(matrix=s.Ball(1.2), grain=s.Ball(0.6))
    mesh = held(
        server,
        lambda: composite,
        (0.25, 0.15),
        [
            (lambda mesh: mesh.region(composite.label_of("grain")).volume, grain),
            (lambda mesh: mesh.region(1).volume, 4 / 3 * PI * 1.2**3 - grain),
            (lambda mesh: mesh.region(2).area, 4 * PI * 0.36),
        ],
    )[1]
    assert mesh.region(1).volume + mesh.region(2).volume == pytest.approx(mesh.volume, rel=1e-12)
    assert mesh.region(1).euler == 2 and mesh.region(2).euler == 1


def test_a_surface_that_has_no_sides(server):
    mesh = stellate.mesh(
        oracles.Clipped(manifolds.Torus(), [lambda x: x[:, 2]]), 0.2, server=server
    )
    assert mesh.boundary_mesh().euler == 0
    assert mesh.boundary_mesh().volume == pytest.approx(2 * PI * (0.6 + 1.4), rel=0.02)
    with pytest.raises(stellate.InvalidArgument, match="encloses no volume"):
        mesh.enclosed_volume  # noqa: B018
    strip = stellate.Mesh(
        np.random.default_rng(1).random((5, 3)),
        np.array([[0, 1, 2], [0, 1, 4], [0, 3, 4], [1, 2, 3], [2, 3, 4]]),
    )
    assert strip.euler == euler_characteristic(strip.simplices) == 0
    with pytest.raises(stellate.InvalidArgument, match="not orientable"):
        strip.normals()


def test_curvature_and_gauss_bonnet(server):
    oracle = stellate.ImplicitManifold(
        torus, ambient_dimension=3, dimension=2, bounding_box=TORUS_BOX
    )
    errors = []
    for epsilon in (0.12, 0.06):
        mesh = stellate.mesh(oracle, epsilon, server=server)
        bend = mesh.curvature(oracle)
        ring = np.hypot(mesh.points[:, 0], mesh.points[:, 1])
        along = (ring - 1) / 0.4 / ring  # cosine over distance from the axis
        want = np.sort(np.stack([along, np.full_like(along, 2.5)], axis=1), axis=1)
        assert np.abs(bend.principal - want).max() < 1e-4
        assert np.abs(bend.mean - want.mean(axis=1)).max() < 1e-4
        errors.append(abs(bend.gauss @ mesh.point_volumes()))
    # 2 pi times the Euler characteristic, which is 0: of 2 pi * 4 where it is above 0.
    assert errors[1] < 0.005 * 8 * PI and errors[1] < errors[0] / 2, errors
    ball = stellate.ImplicitManifold(
        lambda x: 1 - (x**2).sum(axis=1), lambda x: -2 * x, ambient_dimension=3, dimension=2,
        bounding_box=([-1.5] * 3, [1.5] * 3),
    )  # fmt: skip
    errors = []
    for epsilon in (0.3, 0.15):
        mesh = stellate.mesh(ball, epsilon, server=server)
        bend = mesh.curvature(ball)
        assert np.abs(bend.principal - 1).max() < 1e-8  # positive, though f falls outwards
        errors.append(abs(bend.gauss @ mesh.point_volumes() - 2 * PI * mesh.euler))
    assert 1.6 < np.log2(errors[0] / errors[1]) < 2.4, errors
    for other in (manifolds.SpecialOrthogonal3(), object()):
        with pytest.raises(stellate.StellateError):
            mesh.curvature(other)


def without_equations(oracle):
    """The same manifold, of which closest points alone are known."""
    bare = type("Bare", (), {})()
    for name in ("dimension", "ambient_dimension", "bounding_box", "closest_point"):
        setattr(bare, name, getattr(oracle, name))
    return bare


def tori(x):
    """The Clifford torus in R^4, flat: its mean curvature vector is -x, the form's square 4."""
    return np.stack([x[:, 0] ** 2 + x[:, 1] ** 2 - 0.5, x[:, 2] ** 2 + x[:, 3] ** 2 - 0.5], axis=1)


def test_curvature_in_codimension_two(server):
    oracle = stellate.ImplicitManifold(
        tori, ambient_dimension=4, dimension=2, bounding_box=([-1] * 4, [1] * 4)
    )
    errors = []
    for epsilon in (0.2, 0.1):
        mesh = stellate.mesh(oracle, epsilon, server=server)
        assert mesh.certified
        for bend, most in (
            (mesh.curvature(oracle), 1e-4),
            (mesh.curvature(without_equations(oracle)), 1e-3),
        ):
            assert np.abs(bend.gauss).max() < most  # flat in its own metric
            assert np.abs(bend.mean_vector + mesh.points).max() < most
            assert np.abs((bend.second**2).sum(axis=(1, 2, 3)) - 4).max() < 10 * most
            across = np.einsum("nijd,ndk->nijk", bend.second, bend.tangents)
            assert np.abs(across).max() < 1e-9
        fitted = mesh.curvature()
        errors.append(np.abs(fitted.mean_vector + mesh.points).max())
        with pytest.raises(stellate.InvalidArgument, match="principal curvatures"):
            fitted.principal  # noqa: B018
    assert np.log2(errors[0] / errors[1]) > 1.5 and errors[1] < 0.08, errors


def test_curvature_of_rotations(server):
    """SO(3) in R^9 is a round sphere of radius sqrt 8 for its own metric: 6 / 8 everywhere."""
    oracle = manifolds.SpecialOrthogonal3()
    errors = []
    for epsilon in (0.5, 0.35):
        mesh = stellate.mesh(oracle, epsilon, server=server)
        assert np.abs(mesh.curvature(oracle).scalar - 0.75).max() < 1e-3
        errors.append(np.sqrt(np.mean((mesh.curvature().scalar - 0.75) ** 2)))
    assert np.log(errors[0] / errors[1]) / np.log(0.5 / 0.35) > 1.5 and errors[1] < 0.1, errors
    with pytest.raises(stellate.InvalidArgument, match="principal"):
        mesh.curvature().gauss  # noqa: B018


def test_curvature_of_points_alone_keeps_gauss_bonnet(server):
    errors, totals = [], []
    for epsilon in (0.08, 0.04):
        mesh = stellate.mesh(manifolds.Torus(), epsilon, server=server)
        bend = mesh.curvature()
        ring = np.hypot(mesh.points[:, 0], mesh.points[:, 1])
        along = (ring - 1) / 0.4 / ring
        errors.append(np.abs(bend.principal - np.sort([along, 0 * along + 2.5], axis=0).T).max())
        totals.append(abs(bend.gauss @ mesh.point_volumes()))
    assert 1.5 < np.log2(errors[0] / errors[1]) < 2.8 and errors[1] < 0.1, errors
    assert totals[1] < totals[0] / 2 and totals[1] < 0.005 * 8 * PI, totals


def test_curvature_of_a_solids_surface_and_of_a_curve(server):
    ball = stellate.mesh(s.Ball(), 0.2, server=server)
    bend = ball.boundary_mesh().curvature()
    used = np.unique(ball.boundary_mesh().simplices)  # points inside are in no triangle
    assert np.isfinite(bend.mean[used]).all() and np.isnan(bend.mean).any()
    assert np.abs(bend.mean[used] - 1).max() < 0.1
    circle = stellate.mesh(manifolds.Sphere(1), 0.1, server=server)
    assert np.abs(circle.curvature().principal - 1).max() < 0.03
    with pytest.raises(stellate.InvalidArgument, match="boundary_mesh"):
        ball.curvature()
    with pytest.raises(stellate.InvalidArgument, match="a fit takes 9"):
        stellate.Mesh(np.vstack([np.eye(3), np.zeros((1, 3))]), np.array([[0, 1, 2]])).curvature()


def test_minkowski_functionals(server):
    held(
        server,
        s.Ball,
        (0.3, 0.15),
        [
            (lambda mesh: mesh.minkowski().volume, 4 / 3 * PI),
            (lambda mesh: mesh.minkowski().area, 4 * PI),
            (lambda mesh: mesh.minkowski().mean_curvature, 4 * PI),
        ],
    )
    box = stellate.mesh(s.Box([0] * 3, [1, 2, 3]), 0.5, server=server).minkowski()
    # Pi times the sum of its three sides, exactly, as the mesh is.
    assert (box.volume, box.area) == (pytest.approx(6), pytest.approx(22))
    assert box.mean_curvature == pytest.approx(6 * PI) and box.euler == 1
    w, r = box.quermassintegrals, 0.3  # Steiner: what lies within r of the box
    assert w[0] + 3 * w[1] * r + 3 * w[2] * r**2 + w[3] * r**3 == pytest.approx(
        6 + 22 * r + 6 * PI * r**2 + 4 / 3 * PI * r**3
    )
    hollow = stellate.mesh(s.Box([-1] * 3, [1] * 3) - s.Ball(0.5), 0.15, server=server)
    found = hollow.minkowski()
    assert found.euler == 2 and hollow.betti() == (1, 0, 1, 0)
    assert found.area == pytest.approx(24 + PI, rel=0.005)
    assert found.mean_curvature == pytest.approx(6 * PI - 2 * PI, rel=0.005)
    # A level set: 2 pi^2 R, whatever its tube is.
    torus = stellate.mesh(manifolds.Torus(), 0.06, server=server).minkowski()
    assert torus.mean_curvature == pytest.approx(2 * PI**2, rel=1e-3) and torus.euler == 0
    with pytest.raises(stellate.InvalidArgument, match="solids of space"):
        stellate.mesh(manifolds.Sphere(1), 0.3, server=server).minkowski()


def test_betti_numbers(server):
    so3 = stellate.mesh(manifolds.SpecialOrthogonal3(), 0.6, server=server)
    assert so3.betti() == (1, 1, 1, 1) and so3.betti(3) == (1, 0, 0, 1)
    torus = stellate.mesh(manifolds.Torus(), 0.2, server=server)
    assert torus.betti() == torus.betti(5) == (1, 2, 1)
