"""What a newer server says that this version has no name for, and every field that there is."""

import dataclasses

import pytest
import stellate
from fake_server import FakeServer, delta, final, serving
from stellate import manifolds
from stellate._generated import mesh_pb2, oracle_pb2, stellate_pb2

NEW = 99


def test_enum_values_without_a_name_are_unknown():
    mesh = mesh_pb2.Mesh(state=NEW)
    mesh.progress.phase = NEW
    mesh.report.termination = NEW
    mesh.report.certificate.level = NEW
    info = stellate.client.MeshInfo.from_wire(mesh)
    assert info.state == "UNKNOWN" and info.over
    assert info.progress.phase == "UNKNOWN"
    assert info.report.termination == "UNKNOWN"
    assert info.report.certificate.level == "UNKNOWN"
    assert info.report.to_dict()["termination"] == "UNKNOWN"
    stellate.progress.ProgressBar()(info.progress)


def fields(message):
    return {field.name for field in message.DESCRIPTOR.fields}


@pytest.mark.parametrize(
    ("ours", "message", "elsewhere"),
    [
        (stellate.client.ServerInfo, stellate_pb2.ServerInfo, set()),
        (stellate.report.Counts, mesh_pb2.Counts, set()),
        (stellate.report.Certificate, mesh_pb2.Certificate, set()),
        (stellate.Progress, mesh_pb2.Progress, set()),
        (stellate.report.Failure, mesh_pb2.Failure, set()),
        (stellate.Report, mesh_pb2.Report, set()),
        # The last two come only where they are asked for, as the viewer does.
        (stellate.client.MeshInfo, mesh_pb2.Mesh, {"spec", "worker_stats", "past_progress"}),
    ],
)
def test_every_field_of_the_protocol_is_there(ours, message, elsewhere):
    assert fields(message) - elsewhere <= {field.name for field in dataclasses.fields(ours)}


class Newer(FakeServer):
    """A mesh that ends in a state that is new."""

    def ServeOracle(self, requests, context):
        next(requests)
        yield oracle_pb2.ServeOracleResponse(welcome=self.welcome)
        yield oracle_pb2.ServeOracleResponse(over=oracle_pb2.MeshOver(state="MESH_STATE_SPLENDID"))


def test_a_worker_takes_an_end_without_a_name():
    with serving(Newer()) as address:
        assert stellate.serve(manifolds.Sphere(1), "meshes/x", server=address) == "UNKNOWN"


def test_a_mesh_may_end_in_a_state_without_a_name():
    points = [[1.0, 0], [-0.5, 0.8], [-0.5, -0.8]]
    edges = [[0, 1], [0, 2], [1, 2]]
    empty = stellate_pb2.WatchMeshResponse()  # an event that this version does not know
    fake = FakeServer([[empty, delta(1, 0, points, edges), final(NEW)]])
    with serving(fake) as address:
        mesh = stellate.mesh(manifolds.Sphere(1), 0.1, server=address)
    assert mesh.simplices.tolist() == edges


def test_a_question_of_an_unknown_kind_is_left_to_newer_workers():
    """The oracle is not asked, and the server not told that it failed: the mesh goes on."""
    fake = FakeServer(chunks=[oracle_pb2.QueryChunk(lease=1, kind=NEW)])
    with serving(fake) as address:
        with pytest.raises(stellate.StellateError, match="kind 99") as caught:
            stellate.serve(manifolds.Sphere(1), "meshes/x", server=address)
    assert caught.value.reason == "PROTOCOL"
    assert not any(answer.HasField("failure") for answer in fake.answers)
