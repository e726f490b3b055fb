"""What the server says of orientations is what the client finds by itself."""

import numpy as np
import pytest
import ready_shapes
import stellate
from stellate import manifolds


def own(mesh):
    """As this client orients a mesh of which it is told nothing."""
    return stellate.Mesh(mesh.points, mesh.simplices).oriented_simplices()


def expect_told(mesh):
    assert mesh.orientation is not None
    assert np.array_equal(mesh.oriented_simplices(), own(mesh))


@pytest.mark.parametrize(
    "oracle, epsilon",
    [
        (manifolds.Torus(), 0.2),
        (manifolds.Sphere(1), 0.2),
        (manifolds.Sphere(3), 0.6),
        (manifolds.ProductOfCircles(), 0.4),
        (manifolds.SpecialOrthogonal3(), 0.8),
    ],
    ids=["torus", "circle", "sphere-3", "clifford", "so3"],
)
def test_finished_meshes_are_oriented_by_the_server(client, oracle, epsilon):
    name = client.create(oracle, epsilon).name
    client.serve(oracle, name)
    *_, watched = stellate.watch(name, server=client)
    expect_told(watched)
    expect_told(stellate.download(name, server=client))


def test_stopped_and_cancelled_meshes_are_oriented_too(client):
    torus = manifolds.Torus()
    stopped = stellate.mesh(torus, 0.1, server=client, max_vertices=300)
    assert not stopped.certified and len(stopped.simplices)
    expect_told(stopped)
    with pytest.raises(stellate.Cancelled) as caught:
        for mesh in stellate.watch(torus, 0.02, server=client):
            assert mesh.orientation is None, "it grows"
            if len(mesh.points) > 100:
                client.cancel(list(client.list())[-1].name)
    expect_told(caught.value.mesh)


def test_a_mesh_that_has_no_orientation_says_so(client):
    plane = ready_shapes.ALL["projective_plane"][0]()
    mesh = stellate.mesh(plane, 0.3, server=client)
    assert mesh.orientation is not None and not mesh.orientation.orientable
    assert mesh.oriented_simplices() is None


def test_an_orientation_outlives_the_server(tmp_path):
    torus = manifolds.Torus()
    flags = "--data-dir", str(tmp_path / "data")
    with stellate.Server(*flags) as server, stellate.Client(server) as client:
        name = client.create(torus, 0.2).name
        client.serve(torus, name)
        before = stellate.download(name, server=client, unfinished="wait")
    with stellate.Server(*flags) as server, stellate.Client(server) as client:
        *_, after = stellate.watch(name, server=client)
        expect_told(after)
        assert after.orientation.turned == before.orientation.turned
        expect_told(stellate.download(name, server=client))
