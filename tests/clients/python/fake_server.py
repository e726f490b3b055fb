"""A server that says what a test tells it to, for what the real one never does."""

from __future__ import annotations

import contextlib
from concurrent import futures

import grpc
import numpy as np
from stellate._generated import geometry_pb2, mesh_pb2, oracle_pb2, stellate_pb2
from stellate._generated import stellate_pb2_grpc as rpc
from stellate._wire.arrays import to_wire


def indices(rows) -> geometry_pb2.IndexArray:
    rows = np.asarray(rows, dtype="<u4")
    return geometry_pb2.IndexArray(shape=rows.shape, data=rows.tobytes())


def delta(revision, first, points, added, complete=True) -> stellate_pb2.WatchMeshResponse:
    body = mesh_pb2.MeshDelta(
        revision=revision,
        first_vertex=first,
        points=to_wire(np.asarray(points, dtype=float)),
        added=indices(added),
    )
    chunk = stellate_pb2.DeltaChunk(delta=body, complete=complete)
    return stellate_pb2.WatchMeshResponse(delta=chunk)


def final(state=mesh_pb2.MESH_STATE_SUCCEEDED) -> stellate_pb2.WatchMeshResponse:
    mesh = mesh_pb2.Mesh(name="meshes/x", state=state)
    mesh.report.termination = mesh_pb2.TERMINATION_CONVERGED
    mesh.progress.phase = mesh_pb2.PHASE_DONE
    return stellate_pb2.WatchMeshResponse(final=mesh)


class FakeServer(rpc.StellateServicer):
    """`streams`: what each WatchMesh in turn sends; a grpc.StatusCode in it breaks the stream.

    `chunks`: the queries sent to a worker, whose answers land in `answers`.
    """

    def __init__(self, streams=(), chunks=()):
        self.streams, self.chunks = list(streams), list(chunks)
        self.answers, self.watched_from, self.deleted = [], [], []
        self.welcome = oracle_pb2.Welcome(dimension=1, ambient_dimension=2)

    def CreateMesh(self, request, context):
        return mesh_pb2.Mesh(name="meshes/x", spec=request.spec)

    def WatchMesh(self, request, context):
        self.watched_from.append(request.from_revision)
        for event in self.streams.pop(0):
            if isinstance(event, grpc.StatusCode):
                context.abort(event, "broken by the test")
            yield event

    def ServeOracle(self, requests, context):
        hello = next(requests).hello
        self.hello = hello
        yield oracle_pb2.ServeOracleResponse(welcome=self.welcome)
        for chunk in self.chunks:
            yield oracle_pb2.ServeOracleResponse(queries=chunk)
            self.answers.append(next(requests))
        yield oracle_pb2.ServeOracleResponse(over=oracle_pb2.MeshOver(state="MESH_STATE_SUCCEEDED"))

    def DeleteMesh(self, request, context):
        from google.protobuf import empty_pb2

        self.deleted.append(request.name)
        return empty_pb2.Empty()


@contextlib.contextmanager
def serving(fake: FakeServer):
    server = grpc.server(futures.ThreadPoolExecutor(8))
    rpc.add_StellateServicer_to_server(fake, server)
    port = server.add_insecure_port("127.0.0.1:0")
    server.start()
    try:
        yield f"127.0.0.1:{port}"
    finally:
        server.stop(None).wait()
