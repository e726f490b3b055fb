"""Ray: tasks as pilots; one worker process is killed in mid-run."""

import os
import signal
import tempfile

import gated
import pytest
import stellate

os.environ["RAY_USAGE_STATS_ENABLED"] = "0"  # nothing of a test goes to anybody
os.environ["RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO"] = "0"

import ray  # noqa: E402

_SMALLEST_STORE = 80 << 20  # bytes


@pytest.fixture
def cluster():
    with tempfile.TemporaryDirectory(prefix="ray-") as folder:
        ray.init(
            num_cpus=2,
            include_dashboard=False,
            object_store_memory=_SMALLEST_STORE,
            log_to_driver=False,
            _node_ip_address="127.0.0.1",
            _temp_dir=folder,
        )
        try:
            yield
        finally:
            ray.shutdown()


def test_pilots(cluster):
    @ray.remote(num_cpus=1, max_retries=5)
    def pilot(address, name, gate, number):
        return stellate.serve(gated.Gated(gate), name, server=address, worker=f"ray-{number}")

    with gated.Gate() as gate, gated.declared(gate) as (client, name, undisturbed):
        pilots = [pilot.remote(client.address, name, gate.folder, i) for i in range(2)]
        os.kill(gate.held(), signal.SIGKILL)
        gate.open()
        assert ray.get(pilots) == ["SUCCEEDED"] * 2
        assert gated.finished(client, name) == undisturbed
