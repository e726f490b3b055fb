"""Axes of different units: what is meshed in x / scale is handed back in x."""

import re
import subprocess

import numpy as np
import pytest
import samples
import stellate
from stellate import oracles, solids
from stellate import viewer as viewer_module

SCALE = np.array([0.01, 500.0, 1.0])


def on_ellipsoid(x):
    return ((x / SCALE) ** 2).sum(axis=1) - 1


def ellipsoid(**more):
    return stellate.ImplicitManifold(
        on_ellipsoid,
        ambient_dimension=3,
        dimension=2,
        bounding_box=(-1.3 * SCALE, 1.3 * SCALE),
        **more,
    )


def sphere(**more):
    return stellate.ImplicitManifold(
        lambda y: (y * y).sum(axis=1) - 1,
        ambient_dimension=3,
        dimension=2,
        bounding_box=([-1.3] * 3, [1.3] * 3),
        **more,
    )


def certified(mesh):
    certificate = mesh.report.certificate
    assert mesh.certified, certificate.verdict
    assert "coordinates were divided by " in certificate.verdict
    assert "coordinates were divided by " in " ".join(str(mesh.report).split())
    return certificate


def test_an_ellipsoid_of_two_units_is_meshed_as_the_sphere_that_it_is(server):
    mesh = stellate.mesh(ellipsoid(), 0.3, server=server, scale=SCALE)
    certificate = certified(mesh)
    assert (certificate.components, certificate.euler_characteristic) == (1, 2)
    assert certificate.max_circumradius <= 0.3
    np.testing.assert_allclose(on_ellipsoid(mesh.points), 0, atol=1e-9)
    np.testing.assert_array_less(0.9 * SCALE, mesh.points.max(axis=0))
    plain = stellate.mesh(sphere(), 0.3, server=server)
    assert certificate.estimated_reach == pytest.approx(
        plain.report.certificate.estimated_reach, rel=0.05
    )


def test_units_that_are_powers_of_two_change_no_bit(server):
    units = np.array([2.0**-7, 512.0, 1.0])
    wide = stellate.ImplicitManifold(
        lambda x: ((x / units) ** 2).sum(axis=1) - 1,
        ambient_dimension=3,
        dimension=2,
        bounding_box=(-1.3 * units, 1.3 * units),
    )
    scaled = stellate.mesh(wide, 0.3, server=server, scale=units)
    plain = stellate.mesh(sphere(), 0.3, server=server)
    np.testing.assert_array_equal(scaled.points, plain.points * units)
    np.testing.assert_array_equal(scaled.simplices, plain.simplices)


@pytest.mark.parametrize("given", [False, True])
def test_seeds_are_in_the_oracles_own_coordinates(server, given):
    seeds = [[0, 510.0, 0]]
    oracle = ellipsoid() if given else ellipsoid(seeds=np.array(seeds))
    more = {"seeds": seeds} if given else {}
    certified(stellate.mesh(oracle, 0.4, server=server, scale=SCALE, box_seeds=0, **more))


def test_the_jacobian_and_sizes_are_asked_in_own_coordinates(server):
    asked = []

    def size(x):
        asked.append(np.abs(x).max(axis=0))
        return np.full(len(x), 0.8)

    oracle = ellipsoid(jacobian=lambda x: 2 * x / SCALE**2, local_size=size)
    certificate = certified(stellate.mesh(oracle, 0.9, server=server, scale=SCALE, size_rate=0.5))
    assert certificate.max_circumradius <= 0.4 * 1.01
    np.testing.assert_array_less(np.max(asked, axis=0), 1.01 * SCALE)


@pytest.mark.parametrize("way", ["inequalities", "clipped", "solid"])
def test_walls_are_scaled(server, way):
    def right(x):
        return x[:, 0] - 0.002

    if way == "inequalities":
        oracle = ellipsoid(inequalities=[right])
    elif way == "clipped":
        oracle = oracles.Clipped(ellipsoid(), [right])
    else:
        oracle = stellate.ImplicitSolid(
            lambda x: -on_ellipsoid(x),
            bounding_box=(-1.3 * SCALE, 1.3 * SCALE),
            inequalities=[right],
        )
    mesh = stellate.mesh(oracle, 0.35, server=server, scale=SCALE)
    certified(mesh)
    assert mesh.points[:, 0].min() == pytest.approx(0.002, rel=1e-9)
    if way == "solid":
        x, y, _ = mesh.report.certificate.sharpest.point
        assert x == pytest.approx(0.002) and abs(y) < 500 and abs(y) > 1e-3


def test_materials_keep_their_names(server):
    low, high = -SCALE, SCALE
    layers = solids.Labels(left=solids.Box(low, [0, 500, 1]), right=solids.Box([0, -500, -1], high))
    mesh = stellate.mesh(layers, 0.7, server=server, scale=SCALE)
    certified(mesh)
    assert mesh.region_names == ("left", "right")
    assert mesh.volume == pytest.approx(8 * SCALE.prod(), rel=1e-7)


def test_charts_are_scaled(server):
    ring = oracles.Parametrized(
        lambda u: np.stack([0.01 * np.cos(u[:, 0]), 500 * np.sin(u[:, 0])], axis=1),
        lambda u: np.stack([-0.01 * np.sin(u), 500 * np.cos(u)], axis=1),
        [0],
        [2 * np.pi],
        True,
    )
    mesh = stellate.mesh(ring, 0.2, server=server, scale=[0.01, 500])
    certified(mesh)
    np.testing.assert_allclose(((mesh.points / [0.01, 500]) ** 2).sum(axis=1), 1, atol=1e-9)


def test_one_unit_for_all_axes_will_do_for_any_oracle(server):
    torus = stellate.manifolds.Torus()
    mesh = stellate.mesh(torus, 0.07, server=server, scale=2)
    np.testing.assert_allclose(mesh.points, torus.closest_point(mesh.points), atol=1e-12)
    assert certified(mesh).max_circumradius <= 0.07
    assert mesh.points[:, 0].max() == pytest.approx(1.4, abs=0.1)


def test_an_oracle_may_scale_itself(server):
    class Own:
        dimension, ambient_dimension = 2, 3
        bounding_box = -1.3 * SCALE, 1.3 * SCALE

        def closest_point(self, points):
            raise AssertionError("of the scaled one")

        def in_units(self, scale):
            np.testing.assert_array_equal(scale, SCALE)
            return sphere()

    mesh = stellate.mesh(Own(), 0.4, server=server, scale=SCALE)
    certified(mesh)
    np.testing.assert_allclose(on_ellipsoid(mesh.points), 0, atol=1e-9)


def test_what_keeps_its_own_nearest_points_is_refused_with_the_cure(server):
    with pytest.raises(stellate.InvalidArgument, match=r"points / scale.*in_units"):
        stellate.mesh(stellate.manifolds.Torus(), 0.2, server=server, scale=[1, 2, 3])


@pytest.mark.parametrize(
    "scale",
    [[1, 2], [1, -1, 1], [1, 0, 1], [1, np.nan, 1], [1, np.inf, 1], "x", True, [[1, 2, 3]], 0],
)
def test_a_bad_scale_is_refused(server, scale):
    with pytest.raises(
        stellate.InvalidArgument, match="scale has to be 3 positive numbers"
    ) as raised:
        stellate.mesh(ellipsoid(), 0.3, server=server, scale=scale)
    assert "scale" in raised.value.details["fields"]


def test_places_of_a_refusal_are_in_own_coordinates(server):
    def thin_torus(x):
        y = x / SCALE
        return (np.hypot(y[:, 0], y[:, 1]) - 0.7) ** 2 + y[:, 2] ** 2 - 0.2**2

    oracle = stellate.ImplicitManifold(
        thin_torus, ambient_dimension=3, dimension=2, bounding_box=(-SCALE, SCALE)
    )
    mesh = stellate.mesh(oracle, 0.2, server=server, scale=SCALE)
    verdict = mesh.report.certificate.verdict
    assert not mesh.certified and "too coarse to trust" in verdict
    place = re.search(r"at (\(.*?\)):", verdict)[1]
    near = np.array([[float(number) for number in place.strip("()").split(",")]])
    assert abs(thin_torus(near)[0]) < 1e-3
    assert np.abs(near / SCALE - mesh.points / SCALE).max(axis=1).min() < 1e-3
    assert place in " ".join(str(mesh.report).split())


def test_the_doctor_names_places_in_own_coordinates(server):
    def wrong(x):  # the second derivative is three times too large
        return (2 * x / SCALE**2 * [1, 3, 1])[:, None, :]

    box = {"bounding_box": (-1.3 * SCALE, 1.3 * SCALE), "ambient_dimension": 3, "dimension": 2}
    scaled = oracles.in_units(stellate.ImplicitManifold(on_ellipsoid, wrong, **box), SCALE)
    (error,) = [
        it for it in stellate.check(scaled, server=server).findings if it.code == "WRONG_DERIVATIVE"
    ]
    near = error.message[error.message.index("[") + 1 : error.message.index("]")].split(",")
    assert abs(on_ellipsoid(np.array([near], dtype=float))[0]) < 0.05

    class Halfway:
        """closest_point goes half of the way to the sphere x / SCALE in S^2, and is found out."""

        dimension, ambient_dimension, coordinate_scale = 2, 3, SCALE
        bounding_box = [-1.3] * 3, [1.3] * 3

        def closest_point(self, y):
            return y / np.sqrt(np.linalg.norm(y, axis=1, keepdims=True))

    (error,) = [
        it for it in stellate.check(Halfway(), server=server).findings if it.severity == "error"
    ]
    first = error.message[error.message.index("[") + 1 : error.message.index("]")].split(",")
    assert np.allclose(error.place, np.array(first, dtype=float), rtol=1e-4)
    assert 0.3 < np.linalg.norm(error.place / SCALE) < 2


def test_places_of_a_reconstruction_are_in_own_coordinates(server, rng):
    half = rng.normal(size=(600, 3))
    half = half[half[:, 2] > 0] / np.linalg.norm(half[half[:, 2] > 0], axis=1, keepdims=True)
    points = half * SCALE
    mesh = stellate.reconstruct(points, 2, scale=SCALE, server=server)
    words = re.search(r"first is point (\d+), \((.*?)\): EDGE", mesh.report.certificate.verdict)
    there = np.array(words[2].split(","), dtype=float)
    assert np.allclose(there, points[int(words[1])], rtol=2e-3)


def test_places_of_an_error_are_in_own_coordinates(server):
    squared = stellate.ImplicitManifold(
        lambda x: on_ellipsoid(x) ** 2,
        ambient_dimension=3,
        dimension=2,
        bounding_box=(-1.3 * SCALE, 1.3 * SCALE),
    )
    with pytest.raises(stellate.OracleError, match="touches zero") as raised:
        stellate.mesh(squared, 0.2, server=server, scale=SCALE)
    words = str(raised.value)
    near = [float(n) for n in words[words.index("[") + 1 : words.index("]")].split(",")]
    assert abs(on_ellipsoid(np.array([near]))[0]) < 0.01


def test_growing_meshes_are_in_own_coordinates(server):
    sizes = [
        np.abs(mesh.points).max(axis=0)
        for mesh in stellate.watch(ellipsoid(), 0.4, server, scale=SCALE)
        if len(mesh.points)
    ]
    assert len(sizes) > 1
    assert (np.array(sizes) < 1.01 * SCALE).all()


def test_keep_cuts_at_the_box_of_own_coordinates(server):
    sheet = stellate.ImplicitManifold(
        lambda x: x[:, 2] - 0.2 * np.sin(x[:, 1] / 200),
        ambient_dimension=3,
        dimension=2,
        bounding_box=(-SCALE, SCALE),
    )
    mesh = stellate.mesh(sheet, 0.3, server=server, scale=SCALE, keep="box")
    certified(mesh)
    np.testing.assert_allclose(mesh.points.max(axis=0)[:2], SCALE[:2], rtol=1e-9)
    np.testing.assert_allclose(mesh.points.min(axis=0)[:2], -SCALE[:2], rtol=1e-9)


def test_another_scale_is_another_mesh_to_a_checkpoint(tmp_path):
    first = stellate.mesh(ellipsoid(), 0.4, scale=SCALE, checkpoint=tmp_path)
    again = stellate.mesh(ellipsoid(), 0.4, scale=SCALE, checkpoint=tmp_path)
    np.testing.assert_array_equal(first.points, again.points)
    assert first.scale == again.scale == tuple(SCALE)
    assert str(first.report) == str(again.report)
    with pytest.raises(stellate.InvalidArgument):
        stellate.mesh(ellipsoid(), 0.4, scale=1.01 * SCALE, checkpoint=tmp_path)


def test_the_command_line_takes_a_scale(tmp_path, monkeypatch, capfd):
    from stellate._command_line import main

    (tmp_path / "states.py").write_text(
        "import numpy as np, stellate\n"
        "scale = np.array([0.01, 500.0, 1.0])\n"
        "def ellipsoid():\n"
        "    return stellate.ImplicitManifold(\n"
        "        lambda x: ((x / scale) ** 2).sum(axis=1) - 1, ambient_dimension=3, dimension=2,\n"
        "        bounding_box=(-1.3 * scale, 1.3 * scale))\n"
    )
    monkeypatch.chdir(tmp_path)
    given = ["states:ellipsoid", "-e", "0.4", "--scale", ".01,500,1"]
    assert main(["mesh", *given, "-q", "-o", "mesh.txt"]) == 0
    rows = (tmp_path / "mesh.txt").read_text().splitlines()
    count = int(rows[0].split()[2])
    points = np.array([row.split() for row in rows[1 : 1 + count]], dtype=float)
    np.testing.assert_allclose(on_ellipsoid(points), 0, atol=1e-9)
    assert main(["doctor", *given]) == 0
    assert main(["mesh", *given[:-1], "1,2", "-q"]) == 2
    assert "scale has to be 3 positive numbers" in capfd.readouterr().err
    with pytest.raises(SystemExit):
        main(["mesh", *given[:-1], "1;2", "-q"])
    assert "one for each axis" in capfd.readouterr().err


def test_points_alone_are_reconstructed_in_scaled_coordinates(server, rng):
    torus, units = samples.torus(rng), np.array([2.0**-7, 512.0, 1.0])  # which divide exactly
    plain = stellate.reconstruct(torus, 2, server=server)
    scaled = stellate.reconstruct(torus * units, 2, scale=units, server=server)
    assert scaled.certified, scaled.report
    assert scaled.points.tobytes() == (torus * units).tobytes()
    assert (plain.scale, scaled.scale) == ((), tuple(units))
    assert np.array_equal(scaled.simplices, plain.simplices)
    assert scaled.places.tolist() == plain.places.tolist()
    words = "coordinates were divided by 0.0078125, 512, 1, and lengths and angles are of these"
    assert scaled.report.certificate.verdict == f"{plain.report.certificate.verdict}; {words}"
    assert str(scaled.report).endswith(f"\n{'scale':>13}  {words}")
    assert len(scaled.report.lines()) == len(plain.report.lines()) + 1
    noisy = torus + 0.01 * rng.normal(size=torus.shape)
    smooth = stellate.reconstruct(noisy, 2, noise=0.01, server=server).smoothed
    again = stellate.reconstruct(noisy * units, 2, noise=0.01, scale=units, server=server)
    assert np.array_equal(again.smoothed, smooth * units)


def test_tangents_are_scaled_with_their_points(server, rng):
    circle = np.linspace(0, 2 * np.pi, 100, endpoint=False)
    points = np.stack([np.cos(circle), 1000 * np.sin(circle)], axis=1)
    tangents = np.stack([-np.sin(circle), 1000 * np.cos(circle)], axis=1)[:, :, None]
    mesh = stellate.reconstruct(points, 1, tangents, scale=[1, 1000], server=server)
    assert mesh.certified and mesh.points.tobytes() == points.tobytes()
    for wrong in ([1, 2, 3], [1, 0], [1, -1], "x"):
        with pytest.raises(stellate.InvalidArgument, match="scale has to be 2 positive"):
            stellate.reconstruct(points, 1, scale=wrong, server=server)
    with pytest.raises(stellate.InvalidArgument, match="not finite"):
        stellate.reconstruct(points * 1e200, 1, scale=1e-200, server=server)


def test_a_mesh_that_stays_on_its_server_is_in_own_coordinates(server, tmp_path):
    mesh = stellate.mesh(ellipsoid(), 0.35, server=server, scale=SCALE, keep_on_server=True)
    assert np.abs(mesh.points[:, 1]).max() > 400
    again = stellate.download(mesh.name, server=server)
    assert again.points.tobytes() == mesh.points.tobytes()
    assert str(again.report) == str(mesh.report)
    assert again.scale == mesh.scale == tuple(SCALE)
    assert mesh.slice(0).scale == mesh.scale
    saved = stellate.download(mesh.name, server=server, to=tmp_path / "python.txt")
    assert saved.vertices == len(mesh.points)
    program = [viewer_module.find_stellate(), "download", mesh.name, "--server", server.address]
    subprocess.run([*program, "-q", "-o", "program.txt"], cwd=tmp_path, check=True)
    mesh.save(tmp_path / "mesh.txt")
    texts = {(tmp_path / f"{by}.txt").read_text() for by in ("python", "program", "mesh")}
    assert len(texts) == 1
    with stellate.Client(server) as client:
        assert list(client.get_spec(mesh.name).scale) == SCALE.tolist()
        client.delete(mesh.name)


def test_an_oracle_that_was_scaled_before_is_no_other(server):
    by_option = stellate.mesh(ellipsoid(), 0.35, server=server, scale=SCALE)
    by_hand = stellate.mesh(oracles.in_units(ellipsoid(), SCALE), 0.35, server=server)
    assert by_hand.points.tobytes() == by_option.points.tobytes()
    assert by_hand.report.certificate == by_option.report.certificate


def test_the_program_stellate_takes_a_scale(tmp_path):
    def run(*words):
        program = viewer_module.find_stellate()
        return subprocess.run(
            [program, "mesh", *words], cwd=tmp_path, capture_output=True, text=True
        )

    body = ["--solid", "box((-.01, -500, -1), (.01, 500, 1))", "-e", "0.7"]
    done = run(*body, "--scale", ".01,500,1", "-o", "box.txt")
    assert done.returncode == 0, done.stderr
    assert "coordinates were divided by 0.01, 500, 1, and" in " ".join(done.stdout.split())
    mesh = stellate.load_txt(tmp_path / "box.txt")
    np.testing.assert_allclose(np.abs(mesh.points).max(axis=0), SCALE, rtol=1e-12)
    assert mesh.volume == pytest.approx(8 * SCALE.prod(), rel=1e-7)
    for scale, why in (("1,2", "3 positive numbers"), ("1,2,0", "3 positive numbers")):
        refused = run(*body, "--scale", scale)
        assert refused.returncode == 2 and why in refused.stderr
    refused = run("torus", "-e", ".2", "--scale", "1,2,3")
    assert refused.returncode == 2 and "what is nearest in its own" in refused.stderr
