"""Replies that are lost on the way, a client's first among them."""

from __future__ import annotations

import pytest
import stellate
from lossy_proxy import LossyProxy
from stellate import manifolds


@pytest.mark.parametrize("every", [2, 3])
def test_a_reply_that_is_lost_costs_nothing(every):
    with stellate.Server(listen="127.0.0.1:0") as server, LossyProxy(server.address, every) as way:
        names = set()
        for _ in range(6):
            # A client each: the first call that it makes may be the one whose reply is lost.
            with stellate.Client(way.address, reconnect_seconds=0) as client:
                names.add(client.create(manifolds.Torus(), 0.2, worker_wait_seconds=600).name)
        with stellate.Client(server.address) as client:
            assert {mesh.name for mesh in client.list()} == names
            name = names.pop()
            client.serve(manifolds.Torus(), name)
        assert len(names) == 5 and way.lost >= 2
        before = way.lost
        for _ in range(every):
            with stellate.Client(way.address, reconnect_seconds=0) as client:
                assert stellate.download(name, server=client).certified
        assert way.lost > before
