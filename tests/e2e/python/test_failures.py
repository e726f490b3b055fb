"""Bad oracles and bad requests: each with its reason, and nothing lost for others."""

import threading

import numpy as np
import pytest
import stellate
from stellate import manifolds


@pytest.fixture(scope="module")
def undisturbed(server):
    mesh = stellate.mesh(manifolds.ProductOfCircles(), 0.3, server=server)
    assert mesh.certified, mesh.report
    return mesh


@pytest.fixture(autouse=True)
def nothing_lost_for_others(undisturbed, client):
    """A mesh that is half done goes on as if nothing had happened, whatever a test does."""
    watch = stellate.watch(manifolds.ProductOfCircles(), 0.3, server=client)
    next(watch)
    yield
    *_, last = watch
    assert last.certified, last.report
    assert last.points.tobytes() == undisturbed.points.tobytes()
    assert last.simplices.tobytes() == undisturbed.simplices.tobytes()
    assert [info.name for info in client.list()] == []  # and every mesh was tidied away


class Torus(manifolds.Torus):
    """A torus whose methods can be replaced, from the n-th call on."""

    def __init__(self, after=3, **methods):
        super().__init__()
        self.calls = 0
        for name, bad in methods.items():
            setattr(self, name, self._turning(getattr(self, name, None), bad, after))

    def _turning(self, good, bad, after):
        def method(*arguments):
            self.calls += 1
            return good(*arguments) if good and self.calls <= after else bad(*arguments)

        return method


class WithFlats(Torus):
    """Flats solved by equations."""

    _equations = stellate.ImplicitManifold(
        lambda x: ((np.hypot(x[:, 0], x[:, 1]) - 1) ** 2 + x[:, 2] ** 2 - 0.16)[:, None],
        ambient_dimension=3,
        dimension=2,
        bounding_box=manifolds.Torus().bounding_box,
    )

    def intersect_flat(self, centers, bases, radii):
        return self._equations.intersect_flat(centers, bases, radii)


def test_flats_without_fault(server):
    assert stellate.mesh(WithFlats(), 0.15, server=server).certified


@pytest.mark.parametrize("workers", [1, 3])
@pytest.mark.parametrize("method", ["closest_point", "tangent_basis"])
def test_an_exception_reaches_the_caller_as_itself(method, workers, server, client):
    class Unlucky(Exception):
        pass

    thrown = Unlucky("of the oracle's own")

    def fail(*arguments):
        raise thrown

    with pytest.raises(Unlucky) as caught:
        stellate.mesh(Torus(**{method: fail}), 0.1, server=server, workers=workers)
    assert caught.value is thrown


@pytest.mark.parametrize("kind", [KeyboardInterrupt, SystemExit, GeneratorExit])
def test_a_mesh_ends_at_once_whose_oracle_wants_the_program_to_end(kind, server, client):
    """Not after the seconds that a worker is waited for."""

    def leave(x):
        raise kind("of the oracle's own")

    with pytest.raises(kind):
        stellate.mesh(Torus(closest_point=leave), 0.1, server=server, label="that leaves")
    assert "that leaves" not in [info.label for info in client.list()]


def test_the_server_hears_of_the_exception(server, client):
    def fail(x):
        raise RuntimeError("the sensor is off")

    oracle = Torus(closest_point=fail)
    info = client.create(oracle, 0.1)
    with pytest.raises(RuntimeError, match="the sensor is off"):
        stellate.serve(oracle, info.name, server=server)
    with pytest.raises(stellate.OracleError, match="RuntimeError: the sensor is off") as caught:
        list(stellate.watch(info.name, server=server))
    assert caught.value.reason == "ORACLE_FAILED"
    over = client.get(info.name)
    assert over.state == "FAILED" and over.report.termination == "ORACLE_FAILED"
    assert "the sensor is off" in over.report.failure.message
    client.delete(info.name)


def twice(column):
    """Tangents of the torus, one of them in the place of both."""
    good = manifolds.Torus().tangent_basis
    return lambda p: good(p)[:, :, [column, column]]


@pytest.mark.parametrize(
    "methods, reason, words",
    [
        ({"closest_point": lambda x: x[:-1]}, "ORACLE_SHAPE", "closest_point.*shape"),
        ({"closest_point": lambda x: x * np.nan}, "ORACLE_NOT_FINITE", "nan"),
        ({"closest_point": lambda x: x / 0.0}, "ORACLE_NOT_FINITE", "inf"),
        ({"tangent_basis": lambda p: np.ones((len(p), 3, 2))}, "ORACLE_BAD_TANGENT", "orthonormal"),
        ({"tangent_basis": lambda p: np.ones((len(p), 2, 3))}, "ORACLE_SHAPE", "tangent_basis"),
        ({"tangent_basis": lambda p: np.full((len(p), 3, 2), np.nan)}, "ORACLE_NOT_FINITE", "nan"),
        ({"tangent_basis": twice(0)}, "ORACLE_BAD_TANGENT", "orthonormal"),
        ({"closest_point": lambda x: x + 0.3}, "ORACLE_NOT_IDEMPOTENT", "closest"),
    ],
)
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_answers_that_break_a_rule(methods, reason, words, server):
    with pytest.raises(stellate.OracleError, match=words) as caught:
        stellate.mesh(Torus(**methods), 0.1, server=server)
    assert caught.value.reason == reason


@pytest.mark.parametrize(
    "move, reason",
    [
        (lambda q, c, t, r: q + 0.05 * t[:, :, 0], "ORACLE_OFF_FLAT"),
        (
            lambda q, c, t, r: c + 3 * r[:, None] * np.cross(t[:, :, 0], t[:, :, 1]),
            "ORACLE_OUTSIDE_RADIUS",
        ),
    ],
)
def test_intersections_that_break_a_rule(move, reason, server):
    class Wrong(WithFlats):
        def intersect_flat(self, centers, bases, radii):
            points, _ = super().intersect_flat(centers, bases, radii)
            return move(points, centers, bases, radii), np.ones(len(points), dtype=bool)

    with pytest.raises(stellate.OracleError) as caught:
        stellate.mesh(Wrong(), 0.15, server=server)
    assert caught.value.reason == reason
    assert caught.value.mesh is not None


def test_seeds_that_no_closest_point_is_found_for(server):
    def nowhere(x):
        raise stellate.NotConverged(x, np.zeros(len(x), dtype=bool))

    with pytest.raises(stellate.OracleError) as caught:
        stellate.mesh(Torus(after=0, closest_point=nowhere), 0.1, server=server)
    assert caught.value.reason == "NO_SEEDS"


def test_a_closest_point_that_is_missing_now_and_then_is_no_failure(server):
    class Flaky(manifolds.Torus):
        def closest_point(self, x):
            p = super().closest_point(x)
            lost = np.abs(x).sum(axis=1) > 2.2  # far corners of the box
            raise stellate.NotConverged(p, ~lost)

    mesh = stellate.mesh(Flaky(), 0.15, server=server)
    assert mesh.certified, mesh.report


def test_an_oracle_that_never_answers_is_given_up(server):
    never = threading.Event()

    def hang(x):
        never.wait()
        return x

    try:
        with pytest.raises(stellate.OracleError) as caught:
            stellate.mesh(
                Torus(closest_point=hang), 0.1, server=server, answer_seconds=0.2, busy_seconds=0.5
            )
    finally:
        never.set()
    assert caught.value.reason == "ANSWER_TIMEOUT"


def test_a_mesh_that_nobody_serves_is_given_up(client):
    info = client.create(manifolds.Torus(), 0.1, worker_wait_seconds=0.1)
    with pytest.raises(stellate.OracleError) as caught:
        list(stellate.watch(info.name, server=client))
    assert caught.value.reason == "NO_WORKER"
    client.delete(info.name)


def box(lower, upper):
    return {"bounding_box": (lower, upper)}


@pytest.mark.parametrize(
    "changed, keywords, words",
    [
        ({"dimension": 0}, {}, "dimension"),
        ({"dimension": 3}, {}, "dimension"),
        ({}, {"epsilon": 0.0}, "epsilon.* 0"),
        ({}, {"epsilon": -0.5}, "epsilon.*-0.5"),
        ({}, {"epsilon": float("nan")}, "epsilon.*(?i:nan)"),
        ({}, {"epsilon": float("inf")}, "epsilon.*inf"),
        (box([1, 1, 1], [-1, -1, -1]), {}, "bounding_box"),
        (box([0, 0, 0], [1, 0, 1]), {}, "bounding_box"),
        (box([0, 0], [1, 1]), {}, "bounding_box"),
        (box([0, 0, float("nan")], [1, 1, 1]), {}, "bounding_box"),
        ({"bounding_box": None}, {}, "seeds"),
        ({"bounding_box": None, "seeds": np.zeros((4, 2))}, {}, "seeds"),
        ({"bounding_box": None, "seeds": np.full((4, 3), np.inf)}, {}, "seeds"),
        ({}, {"radius_edge_bound": 0.5}, "radius_edge_bound"),
        ({}, {"sliver_bound": 0.9}, "sliver_bound"),
        ({}, {"picking_radius": 1.5}, "picking_radius"),
        ({}, {"candidates": 0}, "candidates"),
        ({}, {"label": "x" * 200}, "label"),
    ],
)
def test_requests_that_make_no_sense(changed, keywords, words, server):
    oracle = manifolds.Torus()
    for name, value in changed.items():
        setattr(oracle, name, value)
    with pytest.raises(stellate.InvalidArgument, match=words) as caught:
        stellate.mesh(oracle, server=server, **{"epsilon": 0.1, **keywords})
    assert caught.value.reason == "INVALID_ARGUMENT"
    assert isinstance(caught.value, ValueError)


@pytest.mark.parametrize("k, d", [(60, 61), (2, 100_000)])
def test_requests_beyond_the_limits(k, d, client):
    limits = client.info()
    assert k > limits.max_dimension or d > limits.max_ambient_dimension
    oracle = manifolds.Sphere(k, d)
    with pytest.raises(stellate.LimitExceeded) as caught:
        stellate.mesh(oracle, 0.1, server=client)
    assert caught.value.reason == "LIMIT_EXCEEDED"


@pytest.mark.parametrize("call", ["get", "cancel", "delete"])
def test_a_mesh_that_is_not_there(call, client):
    with pytest.raises(stellate.MeshNotFound) as caught:
        getattr(client, call)("meshes/0123456789abcdef0123456789abcdef")
    assert caught.value.reason == "MESH_NOT_FOUND"
    with pytest.raises(stellate.MeshNotFound):
        stellate.serve(manifolds.Torus(), "meshes/0123456789abcdef0123456789abcdef", server=client)


def test_a_name_that_is_none(client):
    with pytest.raises(stellate.InvalidArgument):
        client.get("torus")


def test_serving_with_another_kind_of_manifold_is_refused(client):
    info = client.create(manifolds.Torus(), 0.2)
    try:
        with pytest.raises(stellate.InvalidArgument, match="dimension 2 in R.3"):
            client.serve(manifolds.ProductOfCircles((1, 1, 1)), info.name)
    finally:
        client.delete(info.name)
