"""A worker, and an upload, in bare gRPC, with the fault that its argument names: what `stellate conform` must find.

faulty_client.py FAULT ADDRESS
"""

import hashlib
import sys
import threading
import time

import grpc
import numpy as np
import stellate
from python_client import named
from stellate._generated import mesh_pb2, stellate_pb2
from stellate._generated import oracle_pb2 as pb
from stellate._generated import stellate_pb2_grpc as rpc
from stellate._wire.arrays import from_wire, to_wire

FAULT = sys.argv[1]


def answers(oracle, chunk):
    x = from_wire(chunk.points, -1, oracle.ambient_dimension)
    face = tuple(chunk.face)
    try:
        points = oracle.face_point(x, face) if face else oracle.closest_point(x)
        found = np.ones(len(x), bool)
    except stellate.NotConverged as partly:
        points, found = np.where(partly.converged[:, None], partly.points, np.nan), partly.converged
    if FAULT == "finds-all":
        found = np.ones(len(x), bool)
    reply = pb.AnswerChunk(lease=chunk.lease, points=to_wire(points))
    if not found.all():
        reply.found = found.astype("u1").tobytes()
    if chunk.want_tangents:
        bases = oracle.tangent_basis(np.where(found[:, None], points, 1.0))
        if FAULT == "columns-first":
            bases = bases.transpose(0, 2, 1).reshape(bases.shape)
        reply.tangents.CopyFrom(to_wire(bases))
    if chunk.want_clearances:
        clearances = oracle.clearances(np.where(found[:, None], points, 0.0))
        reply.clearances.CopyFrom(to_wire(abs(clearances) if FAULT == "no-sign" else clearances))
        if face:
            order = face[::-1] if FAULT == "walls-descend" else face
            normals = oracle.conormals(points, order)
            reply.conormals.CopyFrom(to_wire(-normals if FAULT == "inwards" else normals))
    if FAULT == "no-lease":
        reply.lease = 0
    return reply


class Stream:
    """One stream; run() is over with it."""

    def __init__(self, stub, oracle, mesh):
        self.oracle, self.mesh = oracle, mesh
        self.out, self.ready = [], threading.Condition()
        self.busy = threading.Event()
        if FAULT != "no-hello":
            self.say(hello=pb.Hello(mesh=mesh if FAULT != "other-mesh" else "meshes/other"))
        self.call = stub.ServeOracle(self.requests())

    def requests(self):
        while True:
            with self.ready:
                self.ready.wait_for(lambda: self.out)
                request = self.out.pop(0)
            if request is None:
                return
            yield request

    def say(self, **kind):
        with self.ready:
            self.out.append(pb.ServeOracleRequest(**kind) if kind else None)
            self.ready.notify()

    def tell_busy(self, lease, every):
        while not self.busy.wait(every):
            self.say(busy=pb.Busy(lease=lease))

    def run(self):
        every, ended = 0.0, "over -"
        for said in self.call:
            kind = said.WhichOneof("message")
            if kind == "welcome":
                if said.welcome.walls != getattr(self.oracle, "walls", 0) and FAULT != "any-walls":
                    self.say()
                    return "error request INVALID_ARGUMENT other walls"
                every = said.welcome.answer_seconds / 4
                if FAULT == "always-busy":
                    every = 0.25
            elif kind == "over":
                ended = f"over {said.over.state.removeprefix('MESH_STATE_')}"
                if FAULT != "keeps-its-half":
                    self.say()
            elif kind == "queries":
                self.reply(said.queries, every)
        return ended

    def reply(self, chunk, every):
        self.busy.clear()
        if every and FAULT != "silent":
            threading.Thread(target=self.tell_busy, args=(chunk.lease, every), daemon=True).start()
        try:
            reply = answers(self.oracle, chunk)
        except RuntimeError as error:
            if FAULT != "fails-in-silence":
                self.say(failure=pb.OracleFailure(lease=chunk.lease, message=str(error)))
            else:
                self.say()
            return
        finally:
            self.busy.set()
        self.say(answers=reply)
        if FAULT == "answers-twice":
            self.say(answers=reply)


def serve(stub, mesh, manifold):
    oracle, tries = named(manifold), 0
    while True:
        tries += 1
        try:
            return Stream(stub, oracle, mesh).run()
        except grpc.RpcError as error:
            code = error.code()
            lost = code in (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.CANCELLED)
            stubborn = FAULT == "comes-back" and tries < 3
            if (lost and FAULT != "gives-up" and tries < 200) or stubborn:
                time.sleep(0.1)
                continue
            details = dict(error.trailing_metadata()).get("grpc-status-details-bin", b"")
            name = stellate.errors.from_rpc(error).reason if details else "UNAVAILABLE"
            kind = "oracle" if code != grpc.StatusCode.FAILED_PRECONDITION else "request"
            return f"error {kind} {name} {error.details()}"


def chunks(points, name, first):
    yield stellate_pb2.PointsChunk(mesh=name)
    step = 30_000 if FAULT != "one-chunk" else len(points)
    for row in range(first, len(points), step):
        rows = points[row : row + step]
        if FAULT == "single-precision":
            rows = rows.astype("<f4").astype("<f8")
        yield stellate_pb2.PointsChunk(
            points=stellate_pb2.Points(first_row=row, points=to_wire(rows))
        )
    summed = points[first:] if FAULT == "digest-of-the-rest" else points
    digest = hashlib.sha256(np.ascontiguousarray(summed, "<f8").tobytes()).digest()
    yield stellate_pb2.PointsChunk(end=stellate_pb2.PointsEnd(points_sha256=digest))


def reconstruct(stub, path, k, d):
    try:
        points = np.loadtxt(path).reshape(-1, int(d))
    except ValueError as error:
        return f"error invalidargument INVALID_ARGUMENT {error}"
    spec = mesh_pb2.Reconstruction(dimension=int(k), ambient_dimension=int(d), points=len(points))
    name = stub.Reconstruct(iter([stellate_pb2.PointsChunk(spec=spec)])).mesh.name
    for _ in range(9):
        try:
            asked = stub.Reconstruct(iter([stellate_pb2.PointsChunk(mesh=name)]))
            stub.Reconstruct(chunks(points, name, 0 if FAULT == "starts-over" else asked.rows))
        except grpc.RpcError as error:
            if error.code() == grpc.StatusCode.UNAVAILABLE or FAULT == "sends-again":
                continue
            return f"error invalidargument INVALID_ARGUMENT {error.details()}"
        return "mesh - CANCELLED -"
    return "error unavailable UNAVAILABLE"


def main():
    options = [
        ("grpc.keepalive_time_ms", 500),
        ("grpc.keepalive_timeout_ms", 500),
        ("grpc.max_reconnect_backoff_ms", 200),  # by itself gRPC waits longer than the tries last
    ]
    with grpc.insecure_channel(sys.argv[2], options) as channel:
        stub = rpc.StellateStub(channel)
        for line in sys.stdin:
            command, *rest = line.split()
            if command == "reconstruct":
                print(reconstruct(stub, *rest), flush=True)
                continue
            works = command == "serve" and rest[1] != "sphere"
            print(serve(stub, *rest) if works else "unsupported", flush=True)


main()
