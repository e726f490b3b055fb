"""Oracles that pull their questions, on the caller's own thread."""

import threading

import numpy as np
import pytest
import stellate
from stellate import manifolds, oracles
from stellate.oracle import CheckedOracle

TORUS = manifolds.Torus()
WHERE = {"bounding_box": TORUS.bounding_box}


def closest(points):
    """As Torus has it, with where there is none."""
    try:
        answer = TORUS.closest_point(points)
        return answer, np.ones(len(points), dtype=bool)
    except stellate.NotConverged as error:
        return error.points, error.converged


def answer(chunk):
    points, found = closest(chunk.points)
    tangents = TORUS.tangent_basis(np.where(found[:, None], points, 1.4))
    chunk.answer(points, tangents if chunk.wants_tangents else None, found=found)


def test_the_mesh_is_that_of_an_oracle_that_is_called(server):
    threads = set()
    with stellate.pulling.pull(2, 3, 0.1, server, tangent_basis=True, **WHERE) as worker:
        for chunk in worker:
            threads.add(threading.current_thread())
            assert chunk.kind == "closest_point" and len(chunk) == len(chunk.points)
            answer(chunk)
    called = stellate.mesh(TORUS, 0.1, server)
    assert np.array_equal(worker.mesh.points, called.points)
    assert np.array_equal(worker.mesh.simplices, called.simplices)
    assert worker.mesh.certified and worker.progress.phase == "DONE"
    assert threads == {threading.current_thread()}


def test_arrays_of_column_major_languages_will_do(server):
    with stellate.pulling.pull(2, 3, 0.2, server, tangent_basis=True, **WHERE) as worker:
        for chunk in worker:
            points, found = closest(chunk.points)
            tangents = TORUS.tangent_basis(np.where(found[:, None], points, 1.4))
            # R sends a single flag as no array at all.
            flags = bool(found[0]) if len(found) == 1 else found
            chunk.answer(np.asfortranarray(points), np.asfortranarray(tangents), found=flags)
    assert np.array_equal(worker.mesh.points, stellate.mesh(TORUS, 0.2, server).points)


def test_intersections_and_sizes(server):
    sphere = manifolds.Sphere()
    kinds = set()
    box = {"bounding_box": sphere.bounding_box}
    with stellate.pulling.pull(
        2, 3, 0.4, server, intersect_flat=True, local_size=True, size_rate=0.3, **box
    ) as worker:
        for chunk in worker:
            kinds.add(chunk.kind)
            points, found = chunk.points, np.ones(len(chunk), dtype=bool)
            if chunk.kind == "intersect_flat":
                normals = np.cross(chunk.bases[:, :, 0], chunk.bases[:, :, 1])
                along = (points * normals).sum(axis=1)
                root = along**2 - (points**2).sum(axis=1) + 1
                step = np.copysign(np.sqrt(np.maximum(root, 0)), along) - along
                found = (root >= 0) & (np.abs(step) <= chunk.radii)
                points = points + step[:, None] * normals
            else:
                points = points / np.linalg.norm(points, axis=1, keepdims=True)
            chunk.answer(points, sizes=np.ones(len(chunk)), found=found)
    assert kinds == {"closest_point", "intersect_flat"}
    assert worker.mesh.report.certificate.euler_characteristic == 2
    assert worker.mesh.report.certificate.max_circumradius <= 0.3


def test_a_wrong_answer_is_refused_at_once_and_may_be_mended(server):
    with stellate.pulling.pull(2, 3, 0.2, server, tangent_basis=True, **WHERE) as worker:
        for chunk in worker:
            with pytest.raises(stellate.OracleError, match="shape"):
                chunk.answer(chunk.points[:, :2])
            with pytest.raises(stellate.OracleError, match="not finite"):
                chunk.answer(np.full(chunk.points.shape, np.nan))
            with pytest.raises(stellate.OracleError, match="found"):
                chunk.answer(chunk.points, found=[True, False, True])
            if chunk.wants_tangents:
                with pytest.raises(stellate.OracleError, match="tangents"):
                    chunk.answer(TORUS.closest_point(chunk.points + 1e-3))
            answer(chunk)
            with pytest.raises(stellate.FailedPrecondition):
                answer(chunk)
    assert worker.mesh.certified


def test_a_chunk_has_to_be_answered_before_the_next(server):
    with stellate.pulling.pull(2, 3, 0.2, server, **WHERE) as worker:
        next(worker)
        with pytest.raises(stellate.FailedPrecondition):
            next(worker)


def test_failing_and_what_the_server_refuses(server):
    with stellate.pulling.pull(2, 3, 0.2, server, **WHERE) as worker:
        chunk = next(worker)
        chunk.fail("no such surface")
        with pytest.raises(stellate.OracleError, match="no such surface"):
            next(worker)
        assert list(worker) == []
    with pytest.raises(stellate.InvalidArgument, match="epsilon"):
        stellate.pulling.pull(2, 3, -1.0, server, **WHERE)


def test_leaving_early_cancels_the_mesh(server, client):
    before = {info.name for info in client.list()}
    with pytest.raises(ZeroDivisionError):
        with stellate.pulling.pull(2, 3, 0.05, server, label="left", **WHERE) as worker:
            for i, chunk in enumerate(worker):
                chunk.answer(closest(chunk.points)[0])
                1 / (5 - i)
    assert {info.name for info in client.list()} == before
    assert worker.mesh is None


def test_a_mesh_of_others_is_served_by_name(client):
    info = client.create(TORUS, 0.1)
    with client.pull(info.name, worker="puller") as leaver:
        answer(next(leaver))
        next(leaver)  # left with a chunk in hand: another worker has it
    with client.pull(info.name) as worker:
        for chunk in worker:
            answer(chunk)
    assert worker.state == "SUCCEEDED" and worker.mesh is None
    with pytest.raises(stellate.MeshNotFound):
        client.pull("meshes/" + "0" * 32)


LUNE = oracles.Clipped(manifolds.Sphere(2), [lambda x: x[:, 2], lambda x: x[:, 1]])


def answer_with(oracle, chunk):
    """All that a chunk may want, at all its points."""
    checked = CheckedOracle(oracle)
    if chunk.face:
        points, found = checked.face_points(chunk.points, chunk.face)
    else:
        points, found = checked.closest_points(chunk.points)
    more = {}
    if chunk.wants_tangents:
        more["tangents"] = checked.tangents(points, found)
    if chunk.wants_clearances:
        more["clearances"] = checked.clearances(points, found)
        if chunk.face:
            more["conormals"] = checked.conormals(points, found, chunk.face)
    chunk.answer(points, found=found, **more)


LUNE_CAN = {"bounding_box": LUNE.bounding_box, "tangent_basis": True, "walls": 2}


def test_manifolds_with_boundary(server, client):
    faces = set()
    with stellate.pulling.pull(2, 3, 0.3, server, **LUNE_CAN) as worker:
        for chunk in worker:
            faces.add(chunk.face)
            answer_with(LUNE, chunk)
    called = stellate.mesh(LUNE, 0.3, server)
    assert np.array_equal(worker.mesh.points, called.points)
    assert np.array_equal(worker.mesh.walls, called.walls) and called.walls.max() == 3
    assert {(), (0,), (1,), (0, 1)} <= faces
    info = client.create(LUNE, 0.3)
    with client.pull(info.name, tangent_basis=True) as other:
        with pytest.raises(stellate.InvalidArgument, match="2 walls, and this oracle's manifold 0"):
            next(other)
    with client.pull(info.name) as other:
        for chunk in other:
            answer_with(LUNE, chunk)
    assert other.state == "SUCCEEDED"


@pytest.mark.parametrize("oracle, can", [
    (TORUS, {"tangent_basis": True, **WHERE}), (LUNE, LUNE_CAN),
])  # fmt: skip
def test_a_doctor_says_what_it_says_of_an_oracle_that_is_called(oracle, can):
    with stellate.pulling.pull_check(2, 3, 0.1, **can) as worker:
        for chunk in worker:
            answer_with(oracle, chunk)
    called = stellate.check(oracle, 0.1)
    passing = {"SPEED", "SLOW"}  # by the clock
    assert worker.report.ok
    assert set(worker.report.codes) - passing == set(called.codes) - passing
    assert worker.report.reach == pytest.approx(called.reach, rel=1e-6)


def test_a_doctor_finds_what_is_wrong_with_answers():
    def codes(do):
        with stellate.pulling.pull_check(2, 3, **WHERE) as worker:
            for chunk in worker:
                do(chunk)
        return worker.report.codes

    assert "WRONG_SHAPE" in codes(lambda chunk: chunk.answer(chunk.points[:, :2]))
    assert "NOT_FINITE" in codes(lambda chunk: chunk.answer(chunk.points * np.nan))
    assert "RAISED" in codes(lambda chunk: chunk.fail("no such surface"))
    assert "NOT_IDEMPOTENT" in codes(lambda chunk: chunk.answer(chunk.points * 0.9))
    with stellate.pulling.pull_check(2, 3, **WHERE) as worker:
        next(worker)  # and no more
    with pytest.raises(stellate.InvalidArgument, match="length"):
        stellate.pulling.pull_check(2, 3, "small", **WHERE)


def test_automatic_sizes(server):
    with stellate.pulling.pull(2, 3, "auto", server, tangent_basis=True, **WHERE) as worker:
        for chunk in worker:
            answer_with(TORUS, chunk)
    assert worker.mesh.report.epsilon == pytest.approx(0.1, rel=0.2)
    assert "a quarter of the reach" in worker.mesh.report.epsilon_reason
    with pytest.raises(stellate.OracleError, match="NOT_IDEMPOTENT"):
        with stellate.pulling.pull(2, 3, "auto", server, **WHERE) as worker:
            for chunk in worker:
                chunk.answer(chunk.points * 0.9)


def test_a_checkpoint_goes_on_where_the_loop_was_left(tmp_path, server):
    def grow(limit):
        asked = 0
        with stellate.pulling.pull(
            2, 3, 0.15, tangent_basis=True, checkpoint=tmp_path, **WHERE
        ) as worker:
            for chunk in worker:
                asked += len(chunk)
                if asked > limit:
                    break
                answer(chunk)
        return asked, worker.mesh

    first, left = grow(800)
    assert left is None
    second, mesh = grow(np.inf)
    assert mesh.certified
    assert grow(0)[0] == 0
    whole = stellate.mesh(TORUS, 0.15, server)
    assert np.array_equal(mesh.points, whole.points)
    with pytest.raises(stellate.InvalidArgument, match="private server"):
        stellate.pulling.pull(2, 3, 0.15, server, checkpoint=tmp_path, **WHERE)
