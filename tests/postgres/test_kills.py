"""Servers that are killed, stopped and frozen: their meshes end elsewhere, as they would have there."""

from __future__ import annotations

import os
import signal

import cases
import pytest
import stellate
from servers import (
    EPSILON,
    PATIENCE,
    Made,
    are_same,
    finish,
    holding,
    owner,
    running,
    sql,
    wait_for,
)
from stellate import manifolds


def test_a_server_killed_and_started_again_needs_no_directory(cluster, undisturbed):
    (server,) = cluster.ready("only")
    with stellate.Client(server.address) as client:
        finished = client.create(manifolds.Torus(), EPSILON)
        client.serve(manifolds.Torus(), finished.name)
    made = Made(server.address)
    made.reach()
    server.end()
    server.start()
    finish([made], undisturbed)
    with stellate.Client(server.address) as client:  # no worker, no replay
        kept = stellate.download(finished.name, server=client)
        assert are_same(kept, undisturbed)
        assert client.get(finished.name).state == "SUCCEEDED"


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_another_server_ends_the_meshes_of_one_that_goes(cluster, undisturbed, how):
    assert len(cases.take_over(cluster, undisturbed, 3, how).gaps) == 3


def test_servers_that_come_and_go_lose_no_mesh(cluster, undisturbed):
    """Whichever it is may have a mesh, or lead to it, or neither."""
    cases.come_and_go(cluster, undisturbed, 4, seed=20)


def test_a_stopped_server_hands_its_meshes_over(cluster, undisturbed):
    first, second = cluster.ready("first", "second")
    made = Made(second.address)  # through the other, where it is not its own
    made.reach()
    with stellate.Client(first.address) as client:
        finished = client.create(manifolds.Torus(), EPSILON).name
        client.serve(manifolds.Torus(), finished)
    assert first.end(signal.SIGTERM) == 0
    with stellate.Client(second.address, reconnect_seconds=PATIENCE) as client:
        kept = stellate.download(finished, server=client)
    assert are_same(kept, undisturbed)
    finish([made], undisturbed)
    assert sql(cluster.database, "SELECT count(*) FROM stellate.servers") == "1"


def test_a_frozen_server_changes_nothing_once_another_took_over(cluster, undisturbed):
    pair = cluster.ready("first", "second")
    made = Made(cluster.front(*pair))
    made.reach()
    frozen = owner(pair, cluster.database)
    other = next(server for server in pair if server is not frozen)
    frozen.process.send_signal(signal.SIGSTOP)
    wait_for(lambda: running(cluster.database) == [other.address])
    finish([made], undisturbed)
    with stellate.Client(other.address) as client:
        kept = client.create(manifolds.Torus(), EPSILON).name
        client.serve(manifolds.Torus(), kept)
    rounds = "SELECT count(*) FROM stellate.records WHERE kind IN (3, 4)"
    wait_for(lambda: sql(cluster.database, rounds) == "0")  # the last that is removed
    records = sql(cluster.database, "SELECT count(*), sum(seal) FROM stellate.records")
    frozen.process.send_signal(signal.SIGCONT)
    wait_for(lambda: "is back" in frozen.log())
    wait_for(lambda: "goes on in another server" in frozen.log())
    assert sql(cluster.database, "SELECT count(*), sum(seal) FROM stellate.records") == records
    with stellate.Client(frozen.address, reconnect_seconds=PATIENCE) as client:
        assert [mesh.state for mesh in client.list()] == ["SUCCEEDED"]


def test_a_write_that_comes_after_a_takeover_does_nothing(cluster, undisturbed):
    """A server is frozen while it waits for a write, and that write until another has the mesh."""
    pair = cluster.ready("first", "second")
    made = Made(cluster.front(*pair))
    made.reach()
    frozen = owner(pair, cluster.database)
    other = next(server for server in pair if server is not frozen)
    writes = (
        "SELECT pid FROM pg_stat_activity WHERE pid <> pg_backend_pid() "
        "AND datname = current_database() "
        "AND query LIKE '%INSERT INTO stellate.records%' AND state = 'active'"
    )
    with holding(cluster.database, "SELECT id FROM stellate.meshes WHERE NOT ended"):
        made.oracle.go.set()
        wait_for(lambda: sql(cluster.database, writes + " AND wait_event_type = 'Lock'"))
        frozen.process.send_signal(signal.SIGSTOP)
        late = [int(pid) for pid in sql(cluster.database, writes).split()]
        for pid in late:
            os.kill(pid, signal.SIGSTOP)
    try:
        wait_for(lambda: running(cluster.database) == [other.address])
        assert {str(pid) for pid in late} <= set(sql(cluster.database, writes).split())
        finish([made], undisturbed)
        rounds = "SELECT count(*) FROM stellate.records WHERE kind IN (3, 4)"
        wait_for(lambda: sql(cluster.database, rounds) == "0")  # the last that is removed
        there = "SELECT count(*), sum(seal) FROM stellate.records"
        records = sql(cluster.database, there)
    finally:
        for pid in late:
            os.kill(pid, signal.SIGCONT)
    wait_for(lambda: not sql(cluster.database, writes))  # it was let go, and has been run
    assert sql(cluster.database, there) == records
    frozen.process.send_signal(signal.SIGCONT)
    wait_for(lambda: "goes on in another server" in frozen.log())
    assert sql(cluster.database, there) == records
