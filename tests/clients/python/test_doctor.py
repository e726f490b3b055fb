"""Client.check: each broken oracle is found out by the finding that names it."""

import pathlib
import re
import subprocess
import sys

import numpy as np
import pytest
import stellate
from shapes import equation
from stellate import manifolds, oracles
from stellate._command_line import main

PACKAGE = str(pathlib.Path(stellate.__file__).parents[1])
WORDS = pathlib.Path(stellate.__file__).parents[3] / "core" / "examination" / "words.cc"
# All findings of the server, and ours, with their severities.
SEVERITIES = {
    code: severity.lower()
    for code, severity in re.findall(r'\{"([A-Z_]+)", Severity::k(\w+)', WORDS.read_text())
} | {"SINGULAR": "error"}


@pytest.fixture(scope="module")
def client():
    with stellate.Client() as client:
        yield client


class Torus(manifolds.Torus):
    """A torus that intersects flats too, and whose methods can be replaced."""

    equations = stellate.ImplicitManifold(
        lambda x: ((np.hypot(x[:, 0], x[:, 1]) - 1) ** 2 + x[:, 2] ** 2 - 0.16)[:, None],
        ambient_dimension=3,
        dimension=2,
        bounding_box=manifolds.Torus().bounding_box,
    )

    def __init__(self, **attributes):
        super().__init__()
        vars(self).update(attributes)

    def intersect_flat(self, centers, bases, radii):
        return self.equations.intersect_flat(centers, bases, radii)


GOOD = Torus()


def project(x):
    return manifolds.Torus().closest_point(x)


def away_from(x):
    """The point of the torus's tube across from the closest one: farther away."""
    ring = x * [1, 1, 0]
    ring = ring / np.linalg.norm(ring, axis=1, keepdims=True)
    return 2 * ring - project(x)


def on_the_ring(x):
    """The torus, approached by way of a point beside the right one: idempotent all the same."""
    p = project(x)
    t = manifolds.Torus().tangent_basis(p)[:, :, 1]
    return project(p + 0.3 * np.linalg.norm(x - p, axis=1, keepdims=True) * t)


class Drifting:
    def __init__(self):
        self.calls = 0

    def __call__(self, x):
        self.calls += 1
        return project(x + 1e-3 * self.calls)


def crossed(x):
    """Answers that depend on the number of their companions."""
    return project(x + 1e-3 / len(x))


def cube(x):
    """The surface of [-1, 1]^3."""
    p = np.clip(x, -1, 1)
    inside = np.abs(x).max(axis=1) < 1
    axis = np.abs(x[inside]).argmax(axis=1)
    rows = np.flatnonzero(inside)
    p[rows, axis] = np.where(x[rows, axis] >= 0, 1, -1)
    return p


def turned(points):
    """Bases that lean out of the tangent plane by a tenth."""
    basis = manifolds.Torus().tangent_basis(points)
    normal = np.cross(basis[:, :, 0], basis[:, :, 1])
    basis[:, :, 0] = (basis[:, :, 0] + 0.1 * normal) / np.sqrt(1.01)
    return basis


def flats(change):
    def intersect(centers, bases, radii):
        points, found = GOOD.intersect_flat(centers, bases, radii)
        return change(points.copy(), found.copy(), centers, bases, radii)

    return intersect


def fail(*arguments):
    raise ZeroDivisionError("on purpose")


def nowhere(x):
    raise stellate.NotConverged(x, np.zeros(len(x), dtype=bool))


def hardly_anywhere(x):
    raise stellate.NotConverged(project(x), np.abs(x).max(axis=1) < 0.7)


def normal_of(bases):
    return np.cross(bases[:, :, 0], bases[:, :, 1])


class Cut(oracles.Clipped):
    """A sphere that walls cut, whose methods can be replaced."""

    def __init__(self, *walls, sphere=None, **attributes):
        walls = walls or (lambda x: x[:, 2] + 0.1,)
        super().__init__(sphere or manifolds.Sphere(2), list(walls))
        vars(self).update(attributes)


CUT = Cut()


def conormals(change):
    """The right ones, changed; `across` is along the face."""

    def answer(points, face):
        right = CUT.conormals(points, face)[:, 0]
        return change(right, np.cross(points, right), points)[:, None, :]

    return answer


def across_the_equator(x, face):
    """The farthest point of the face, not the nearest."""
    y = CUT.face_point(x, face)
    return y * [-1, -1, 1]


def on_the_face_alone(x, face):
    """Nothing from a little above the sphere."""
    y = CUT.face_point(x, face)
    near = np.linalg.norm(x, axis=1) > 1.001
    raise_for = near & (np.linalg.norm(x - y, axis=1) < 0.1)
    if raise_for.any():
        raise stellate.NotConverged(y, ~raise_for)
    return y


OF_WALLS = {
    "NOTHING_LEFT": Cut(lambda x: x[:, 2] - 5),
    "FACE_OFF_MANIFOLD": Cut(face_point=lambda x, face: CUT.face_point(x, face) + 0.01),
    "FACE_CLEARANCE": Cut(clearances=lambda p: p[:, 2:] + 0.15),
    "FACE_NOT_CLOSEST": Cut(face_point=across_the_equator),
    "FACE_MISSED": Cut(face_point=on_the_face_alone),
    "FACE_NOT_FOUND": Cut(lambda x: (x[:, 2] + 0.1) ** 3),
    "CONORMAL_NOT_UNIT": Cut(conormals=conormals(lambda n, along, p: 2 * n)),
    "CONORMAL_NOT_TANGENT": Cut(conormals=conormals(lambda n, along, p: 0.96 * n + 0.28 * p)),
    "CONORMAL_INWARD": Cut(conormals=conormals(lambda n, along, p: -n)),
    "CONORMAL_WRONG": Cut(conormals=conormals(lambda n, along, p: 0.8 * n + 0.6 * along)),
    "WALL_TOUCHES": oracles.Clipped(
        manifolds.Torus(), [lambda x: x[:, 0] - 0.6], seeds=[[0.6, 0, 0.01], [0.6, 1, 0]]
    ),
    "WALLS_TANGENTIAL": Cut(lambda x: x[:, 2] + 0.1, lambda x: x[:, 2] + 0.1 + 0.05 * x[:, 0]),
    "ACUTE_EDGE": oracles.Solid(
        [oracles.HalfSpace([0, 1, 0]), oracles.HalfSpace([1, -2, 0])], ball=([0] * 3, 1)
    ),
    "WALL_CUTS_NOTHING": Cut(lambda x: x[:, 2] + 0.1, lambda x: x[:, 2] + 5),
}

BROKEN = {
    **OF_WALLS,
    "BAD_DIMENSIONS": Torus(dimension=3),
    "NO_WHEREABOUTS": Torus(bounding_box=None),
    "RAISED": Torus(closest_point=fail),
    "WRONG_SHAPE": Torus(closest_point=lambda x: x[:, :2]),
    "INEXACT": equation(lambda x: np.linalg.norm(x.astype(np.float32), axis=1) - 1.0),
    "NOT_FINITE": Torus(closest_point=lambda x: x * np.nan),
    "NOTHING_FOUND": Torus(closest_point=nowhere),
    "MOSTLY_NOT_FOUND": Torus(closest_point=hardly_anywhere),
    "OUTSIDE_BOX": Torus(bounding_box=(np.full(3, -1.0), np.full(3, 1.0))),
    "NOT_DETERMINISTIC": Torus(closest_point=Drifting()),
    "BATCH_DEPENDENT": Torus(closest_point=crossed),
    "NOT_IDEMPOTENT": Torus(closest_point=lambda x: (x + project(x)) / 2),
    "NOISY": Torus(closest_point=lambda x: project(x) + 1e-8 * np.sin(1e6 * x)),
    "NOT_CLOSEST": Torus(
        closest_point=lambda x: np.where(
            (np.linalg.norm(x - project(x), axis=1) > 0.02)[:, None], away_from(x), project(x)
        )
    ),
    "NOT_NORMAL": Torus(closest_point=on_the_ring),
    "WRONG_DIMENSION": Torus(dimension=1, tangent_basis=None),
    "TANGENT_NOT_ORTHONORMAL": Torus(tangent_basis=lambda p: 1.01 * GOOD.tangent_basis(p)),
    "TANGENT_WRONG": Torus(tangent_basis=turned),
    "SIZE_WRONG": Torus(local_size=lambda p: np.where(p[:, 0] > 0, 0.4, -0.4)),
    "SIZE_CHANGES": Torus(local_size=lambda p: 0.4 + 0.001 / np.full(len(p), len(p))),
    "TOUCHES_ZERO": equation(lambda x: ((x * x).sum(axis=1) - 1) ** 2),
    "WRONG_DERIVATIVE": equation(lambda x: (x * x).sum(axis=1) - 1, lambda x: -2 * x),
    "SINGULAR": equation(
        lambda x: (x * x).sum(axis=1) ** 2 - x[:, 0] ** 2 + x[:, 1] ** 2 + x[:, 2] ** 2
    ),
    "ROUGH": Torus(
        closest_point=cube,
        tangent_basis=None,
        intersect_flat=None,
        bounding_box=(np.full(3, -1.1), np.full(3, 1.1)),
    ),
    "FLAT_MISSED": Torus(intersect_flat=flats(lambda p, f, c, t, r: (p, f & False))),
    "FLAT_OFF": Torus(intersect_flat=flats(lambda p, f, c, t, r: (project(p + 0.01), f))),
    "FLAT_OUTSIDE_RADIUS": Torus(
        intersect_flat=flats(lambda p, f, c, t, r: GOOD.intersect_flat(c, t, np.full(len(c), 10.0)))
    ),
    "FLAT_OFF_MANIFOLD": Torus(
        intersect_flat=flats(lambda p, f, c, t, r: (p + 0.01 * normal_of(t), f))
    ),
    "FLAT_NOT_NEAREST": Torus(
        intersect_flat=flats(lambda p, f, c, t, r: (p + 2 * (c - p) + 0.2 * (c - p), f))
    ),
}


@pytest.mark.parametrize("code", BROKEN)
def test_a_broken_oracle_is_found_out(client, code):
    report = client.check(BROKEN[code])
    assert code in report.codes, report
    assert report.ok == all(f.severity != "error" for f in report.findings)
    (finding,) = [f for f in report.findings if f.code == code]
    assert finding.advice or finding.severity == "note"
    assert code in str(report)
    assert finding.severity == SEVERITIES[code]


@pytest.mark.parametrize(
    "oracle",
    [
        GOOD,
        manifolds.Torus(2, 0.3),
        manifolds.Sphere(1),
        manifolds.Sphere(2, 30),
        manifolds.Sphere(3),
        manifolds.ProductOfCircles(),
        manifolds.ProductOfCircles((1, 0.7, 0.5)),
        manifolds.SpecialOrthogonal3(),
        manifolds.ellipsoid(),
        manifolds.tanglecube(),
    ],
    ids=lambda oracle: f"{type(oracle).__name__}-{oracle.dimension}-{oracle.ambient_dimension}",
)
def test_a_good_oracle_passes(client, oracle):
    report = client.check(oracle)
    assert report.ok, report
    assert report.pieces == 1
    assert report.best_batch in report.rates and min(report.rates.values()) > 0
    assert set(report.codes) <= {
        "REACH", "PIECES", "SPEED", "SLOW", "NO_TANGENTS", "NOT_CLOSEST_FAR",
    }  # fmt: skip


@pytest.mark.parametrize(
    "oracle",
    [
        CUT,
        oracles.Clipped(manifolds.Torus(), [lambda x: x[:, 0] + 0.1 * x[:, 1]]),
        oracles.Clipped(manifolds.Sphere(2), box=([0] * 3, [np.inf] * 3)),
        oracles.Clipped(manifolds.ProductOfCircles((1, 0.7, 0.5)), [lambda x: x[:, 0]]),
        oracles.Clipped(manifolds.SpecialOrthogonal3(), [lambda x: x[:, 0] + x[:, 4] + x[:, 8]]),
        oracles.Clipped(manifolds.Sphere(1), [lambda x: x[:, 0]]),
        oracles.Solid(ball=([0] * 3, 1)),
        oracles.Solid(box=([0, 0], [1, 2])),
    ],
)
def test_good_walls_pass(client, oracle):
    report = client.check(oracle)
    assert report.ok, report
    assert set(report.codes) <= {"REACH", "PIECES", "SPEED", "SLOW", "NOT_CLOSEST_FAR"}, report


def test_the_reach_of_a_boundary_counts(client):
    ball = client.check(oracles.Solid(ball=([0] * 3, 0.7)))
    assert ball.reach == pytest.approx(0.7, rel=1e-6)
    assert client.check(CUT).reach == pytest.approx(0.99**0.5, rel=1e-6)
    cube = client.check(oracles.Solid(box=([0] * 3, [1] * 3)))
    assert 0.5 < cube.reach < 2  # nothing bends there


def test_a_corner_does_not_hide_behind_tangents_of_its_own(client):
    """A can: smooth except at two rims, and with tangent bases that are right everywhere else."""

    def can(x):
        r = np.hypot(x[:, 0], x[:, 1])[:, None]
        side = np.concatenate([x[:, :2] / r, np.clip(x[:, 2:], -1, 1)], axis=1)
        lid = np.concatenate(
            [x[:, :2] * np.minimum(1, 1 / r), np.where(x[:, 2:] > 0, 1.0, -1.0)], axis=1
        )
        nearer = np.linalg.norm(x - side, axis=1) <= np.linalg.norm(x - lid, axis=1)
        return np.where(nearer[:, None], side, lid)

    box = np.full(3, -1.3), np.full(3, 1.3)
    oracle = Torus(closest_point=can, tangent_basis=None, intersect_flat=None, bounding_box=box)
    assert "ROUGH" in client.check(oracle).codes


def test_the_reach_and_what_epsilon_suits_it(client):
    report = client.check(GOOD, epsilon=0.3)
    assert report.ok and "COARSE_EPSILON" in report.codes
    assert report.reach == pytest.approx(0.4, rel=0.05)
    assert "COARSE_EPSILON" not in client.check(GOOD, epsilon=0.1).codes


def test_pieces_are_counted(client):
    def two_spheres(x):
        centre = np.where(x[:, :1] > 0, 1.5, -1.5) * [1.0, 0.0, 0.0]
        away = x - centre
        return centre + away / np.linalg.norm(away, axis=1, keepdims=True)

    box = np.array([-2.6, -1.1, -1.1]), np.array([2.6, 1.1, 1.1])
    oracle = Torus(
        closest_point=two_spheres, tangent_basis=None, intersect_flat=None, bounding_box=box
    )
    report = client.check(oracle)
    assert report.ok and report.pieces == 2, report


def test_seeds_alone_will_do(client):
    report = client.check(Torus(bounding_box=None, seeds=np.array([[1.4, 0, 0]])))
    assert report.ok and report.samples > 100, report


def test_the_same_questions_find_the_same(client):
    codes = [client.check(BROKEN["NOT_NORMAL"], seed=7).findings[0] for _ in range(2)]
    assert codes[0].message == codes[1].message


def doctor(*arguments, cwd):
    return subprocess.run(
        [sys.executable, "-m", "stellate", "doctor", *arguments],
        cwd=cwd,
        env={"PYTHONPATH": PACKAGE, "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
    )


def test_from_the_shell(tmp_path):
    (tmp_path / "mine.py").write_text(
        "from stellate import manifolds\n"
        "class Bad(manifolds.Torus):\n"
        "    def closest_point(self, x):\n"
        "        return x * 0.5\n"
    )
    good = doctor("stellate.manifolds:Torus", "--epsilon", "0.1", cwd=tmp_path)
    assert good.returncode == 0 and "keeps its contract" in good.stdout, good
    bad = doctor("mine:Bad", cwd=tmp_path)
    assert bad.returncode == 1 and "NOT_IDEMPOTENT" in bad.stdout, bad
    assert doctor("mine:Absent", cwd=tmp_path).returncode == 2


@pytest.mark.parametrize("name", ["stellate.manifolds", "stellate.manifolds:Absent", "absent:Bad"])
def test_what_is_no_oracle_is_refused(name, capsys):
    assert main(["doctor", name]) == 2
    assert "stellate: " in capsys.readouterr().err


def test_all_words_are_put_to_use():
    """Whatever the server has words for is tested above, or a plain measure."""
    untested = set(SEVERITIES) - set(BROKEN)
    assert untested == {
        "COARSE_EPSILON", "NOT_CLOSEST_FAR", "NO_TANGENTS", "PIECES", "REACH", "SLOW", "SPEED",
    }  # fmt: skip
