"""Dask: a cluster's workers as pilots, and as an executor; one of them is killed in mid-run."""

import os
import signal

import dask
import gated
import pytest
import stellate
from distributed import Client, LocalCluster


@pytest.fixture
def cluster():
    dask.config.set({"distributed.worker.daemon": True, "distributed.comm.timeouts.connect": "60s"})
    with (
        LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
        ) as running,
        Client(running) as client,
    ):
        yield client


def pilot(address, name, gate, number):
    return stellate.serve(gated.Gated(gate), name, server=address, worker=f"dask-{number}")


def test_pilots(cluster):
    with gated.Gate() as gate, gated.declared(gate) as (client, name, undisturbed):
        pilots = [
            cluster.submit(pilot, client.address, name, gate.folder, i, pure=False, retries=5)
            for i in range(2)
        ]
        os.kill(gate.held(), signal.SIGKILL)
        gate.open()
        assert gated.finished(client, name) == undisturbed
        assert cluster.gather(pilots) == ["SUCCEEDED"] * 2


def test_executor(cluster):
    with gated.Gate() as gate, gated.declared(gate) as (client, name, undisturbed):
        executor = cluster.get_executor(pure=False, retries=5)
        workers = stellate.executors.workers_on(
            executor, gated.Gated(gate.folder), name, 2, server=client
        )
        os.kill(gate.held(), signal.SIGKILL)
        gate.open()
        assert workers.wait() == ["SUCCEEDED"] * 2
        assert gated.finished(client, name) == undisturbed
