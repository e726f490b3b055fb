"""Points that tests send by hand."""

from __future__ import annotations

import hashlib

import grpc
import numpy as np
import pytest
import stellate
from stellate._generated import stellate_pb2 as pb
from stellate._points import CheckedPoints
from stellate._wire.arrays import to_wire


def same(a, b):
    assert a.points.tobytes() == b.points.tobytes()
    assert a.simplices.tobytes() == b.simplices.tobytes()
    assert a.places.tolist() == b.places.tolist()


def declared(points, dimension=2, **options):
    given = dict(tangents=None, noise="auto", reach=None, drop=0.001, closed=True, limits={})
    return CheckedPoints(points, dimension, label=None, **{**given, **options})


def upload(client, checked, rows):
    info = client.declare_points(checked)
    try:
        client.upload(info.name, checked, rows).run()
        return stellate.download(info.name, server=client, unfinished="wait")
    finally:
        client.delete(info.name)


class Talk:
    """Messages by hand, on one stream."""

    def __init__(self, client):
        self._stub = client._stub

    def say(self, *chunks, **how):
        return self._stub.Reconstruct(iter(chunks), timeout=60, **how)

    def say_to_another_server(self, chunk):
        """As say. The connection to the killed one may break under the first attempt."""
        while True:
            try:
                return self.say(chunk, wait_for_ready=True)
            except grpc.RpcError as error:
                if error.code() != grpc.StatusCode.UNAVAILABLE:
                    raise

    def refused(self, *chunks):
        with pytest.raises(grpc.RpcError) as refused:
            self.say(*chunks)
        return refused.value


def rows(first, points, tangents=None):
    chunk = pb.PointsChunk()
    chunk.points.first_row = first
    chunk.points.points.CopyFrom(to_wire(np.asarray(points, float)))
    if tangents is not None:
        chunk.points.tangents.CopyFrom(to_wire(np.asarray(tangents, float)))
    return chunk


def end(points):
    digest = hashlib.sha256(np.ascontiguousarray(points).tobytes()).digest()
    return pb.PointsChunk(end=pb.PointsEnd(points_sha256=digest))
