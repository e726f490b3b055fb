"""Numbers on the wire, and the client's copy of a growing mesh."""

import numpy as np
import pytest
import shapes
import stellate
from stellate._generated import geometry_pb2, mesh_pb2, stellate_pb2
from stellate._wire.arrays import from_wire, indices_from_wire, to_wire
from stellate._wire.delta_mesh import DeltaMesh, lexicographic


def test_round_trip_keeps_every_bit(rng):
    values = rng.normal(size=(5, 3, 2))
    values[0, 0] = [np.inf, -0.0]
    values[1, 1, 1] = np.nan
    message = geometry_pb2.Array.FromString(to_wire(values).SerializeToString())
    assert from_wire(message, -1, 3, 2).tobytes() == values.tobytes()


def test_any_layout_and_type_is_sent_as_c_ordered_float64():
    values = np.arange(12, dtype=np.int32).reshape(3, 4).T[::2]
    message = to_wire(values)
    assert list(message.shape) == [2, 3]
    assert message.data == np.array(values, dtype="<f8", order="C").tobytes()


def test_reading_makes_no_copy():
    message = to_wire(np.ones((4, 3)))
    view = from_wire(message, 4, 3)
    assert not view.flags.owndata and not view.flags.writeable


@pytest.mark.parametrize("shape, data", [([2, 3], 5 * 8), ([3, 2], 6 * 8), ([6], 6 * 8), ([], 8)])
def test_what_does_not_fit_is_refused(shape, data):
    with pytest.raises(ValueError):
        from_wire(geometry_pb2.Array(shape=shape, data=bytes(data)), -1, 3)


def test_an_absent_array_is_empty():
    assert from_wire(geometry_pb2.Array(), -1, 3).shape == (0, 3)
    assert indices_from_wire(geometry_pb2.IndexArray(), -1, 4).shape == (0, 4)
    with pytest.raises(ValueError, match="missing"):
        from_wire(geometry_pb2.Array(), 5, 3)


def delta(revision, first, points, added, removed, complete=True):
    def indices(rows):
        rows = np.array(rows, dtype="<u4").reshape(-1, 3)
        return geometry_pb2.IndexArray(shape=rows.shape, data=rows.tobytes())

    body = mesh_pb2.MeshDelta(
        revision=revision,
        first_vertex=first,
        points=to_wire(np.asarray(points, dtype=float).reshape(-1, 3)),
        added=indices(added),
        removed=indices(removed),
    )
    return stellate_pb2.DeltaChunk(delta=body, complete=complete)


@pytest.mark.parametrize("step", [1, 4, 100])
def test_deltas_add_up(rng, step):
    """Random additions and removals, in chunks, against a set kept by hand."""
    growth, expected, points = DeltaMesh(2, 3), set(), np.empty((0, 3))
    for revision in range(1, 20):
        block = rng.normal(size=(rng.integers(3, 300), 3))
        first, points = len(points), np.vstack([points, block])
        fresh = {
            tuple(sorted(rng.choice(len(points), 3, replace=False).tolist())) for _ in range(200)
        }
        fresh -= expected
        gone = {row for row in expected if rng.random() < 0.3}
        half = len(block) // 2
        assert not growth.absorb(delta(revision, first, block[:half], [], sorted(gone), False))
        assert growth.absorb(delta(revision, first + half, block[half:], sorted(fresh), []))
        expected = (expected - gone) | fresh
        assert growth.revision == revision
        assert np.array_equal(growth.points(), points)
        if revision % step == 0:  # several are settled at once
            assert np.array_equal(growth.simplices(), sorted(expected))
    assert np.array_equal(growth.simplices(), sorted(expected))


def test_earlier_snapshots_stay_true():
    growth = DeltaMesh(2, 3)
    growth.absorb(delta(1, 0, np.zeros((3, 3)), [[0, 1, 2]], []))
    early = growth.points()
    growth.absorb(delta(2, 3, np.ones((5000, 3)), [], [[0, 1, 2]]))
    assert early.shape == (3, 3) and not early.any()
    with pytest.raises(ValueError, match="read-only"):
        early[0] = 1


def test_a_revision_cut_short_is_forgotten():
    growth = DeltaMesh(2, 3)
    growth.absorb(delta(1, 0, np.zeros((2, 3)), [], [], False))
    growth.forget_pending()
    assert growth.absorb(delta(1, 0, np.eye(3), [[0, 1, 2]], []))
    assert np.array_equal(growth.points(), np.eye(3))


def test_rows_of_any_size_are_put_in_order(rng):
    """Ids that fill 32 bits, and rows too long for one number."""
    rows = rng.integers(0, 3, size=(500, 8)).astype(np.uint32) * np.uint32(2**31 - 1)
    assert np.array_equal(rows[lexicographic(rows)], sorted(rows.tolist()))
    assert lexicographic(rows[:0]).shape == (0,)


def test_a_simplex_that_comes_twice_is_refused():
    growth = DeltaMesh(2, 3)
    growth.absorb(delta(1, 0, np.eye(3), [[0, 1, 2]], []))
    growth.absorb(delta(2, 3, np.empty((0, 3)), [[0, 1, 2]], []))
    with pytest.raises(ValueError, match="already"):
        growth.simplices()


@pytest.mark.parametrize(
    "chunk, words",
    [
        (delta(1, 7, np.eye(3), [], []), "starts at vertex 7"),
        (delta(1, 0, np.eye(3), [[0, 1, 3]], []), "vertex 3 of 3"),
        (delta(1, 0, np.eye(3), [], [[0, 1, 2]]), "not there"),
    ],
)
def test_deltas_that_do_not_fit_are_refused(chunk, words):
    with pytest.raises(ValueError, match=words):
        growth = DeltaMesh(2, 3)
        growth.absorb(chunk)
        growth.simplices()


def test_mesh_describes_itself():
    mesh = shapes.torus()
    assert (mesh.dimension, mesh.ambient_dimension, mesh.certified) == (2, 3, False)
    assert "k=2 d=3 84 points, 168 simplices, no report" in repr(mesh)
    assert isinstance(mesh, stellate.Mesh)


def labelled(chunk, labels):
    chunk.delta.added_labels = bytes(labels)
    return chunk


def test_the_boundary_alone_has_two_labels_a_simplex_and_plain_meshes_have_not():
    growth = DeltaMesh(2, 3, boundary_only=True)
    rows = [[0, 1, 2], [0, 1, 3]]
    growth.absorb(labelled(delta(1, 0, np.ones((4, 3)), rows, []), [1, 0, 0, 2]))
    assert growth.labels().tolist() == [[1, 0], [0, 2]]
    for wrong in ([], [1, 2], [1, 2, 3, 4, 5, 6]):
        with pytest.raises(ValueError, match="do not fit 2 simplices"):
            growth = DeltaMesh(2, 3, boundary_only=True)
            growth.absorb(labelled(delta(1, 0, np.ones((4, 3)), rows, []), wrong))
    with pytest.raises(ValueError, match="4 labels do not fit 2 simplices"):
        DeltaMesh(2, 3).absorb(labelled(delta(1, 0, np.ones((4, 3)), rows, []), [1, 0, 0, 2]))
