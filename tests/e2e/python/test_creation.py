"""CreateMesh through a proxy that loses replies: as many meshes as were asked for.

$STELLATE_CREATIONS: how many (30).
"""

import itertools
import logging
import os
import threading
from concurrent import futures

import grpc
import pytest
import stellate
from stellate import manifolds

CREATIONS = int(os.environ.get("STELLATE_CREATIONS", "30"))


class Lossy(grpc.GenericRpcHandler):
    """Hands calls of one request on to a server, and loses every third reply to CreateMesh."""

    def __init__(self, channel: grpc.Channel) -> None:
        self._channel, self._turns, self.lost = channel, itertools.count(1), 0

    def service(self, details):
        hand_on = self._channel.unary_unary(details.method)  # bytes in, bytes out

        def answer(request: bytes, context: grpc.ServicerContext) -> bytes:
            try:
                reply = hand_on(request)
            except grpc.RpcError as error:
                context.abort(error.code(), error.details())
            if details.method.endswith("/CreateMesh") and next(self._turns) % 3 == 0:
                self.lost += 1
                context.abort(grpc.StatusCode.UNAVAILABLE, "the proxy lost the reply")
            return reply

        return grpc.unary_unary_rpc_method_handler(answer)


@pytest.fixture(params=["in memory", "recorded"])
def server(request, tmp_path):
    flags = ["--max-meshes", str(2 * CREATIONS)]
    if request.param == "recorded":
        flags += ["--data-dir", str(tmp_path / "data")]
    with stellate.Server(*flags) as running:
        yield running


@pytest.fixture
def lossy(server):
    with grpc.insecure_channel(server.address) as channel:
        handler = Lossy(channel)
        proxy = grpc.server(futures.ThreadPoolExecutor(8), handlers=[handler])
        handler.address = f"127.0.0.1:{proxy.add_insecure_port('127.0.0.1:0')}"
        proxy.start()
        yield handler
        proxy.stop(None).wait()


def test_lost_replies_make_no_second_mesh(server, lossy, caplog):
    caplog.set_level(logging.ERROR, logger="stellate")  # not a warning each
    names, workers = [], 4
    with stellate.Client(lossy.address) as client:
        client.info()  # a server that was never there is not waited for

        def declare(count: int) -> None:
            for _ in range(count):
                names.append(client.create(manifolds.Torus(), 0.5).name)

        shares = [CREATIONS // workers + (i < CREATIONS % workers) for i in range(workers)]
        threads = [threading.Thread(target=declare, args=(share,)) for share in shares]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert lossy.lost >= CREATIONS // 3
    assert len(set(names)) == CREATIONS
    with stellate.Client(server) as client:
        assert sorted(info.name for info in client.list()) == sorted(names)
