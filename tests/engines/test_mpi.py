"""MPI: every rank a pilot, and ranks as an executor's workers."""

import contextlib
import os
import pathlib
import signal
import subprocess
import sys

import gated

HERE = pathlib.Path(__file__).resolve().parent
SETTINGS = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_plm": "isolated",  # this machine alone: no ssh, no batch system
    "OMPI_MCA_btl": "self,tcp",
    "OMPI_MCA_btl_tcp_if_include": "lo",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
}


@contextlib.contextmanager
def mpirun(ranks, command):
    """A job under way; it is over afterwards, whatever happens."""
    with subprocess.Popen(
        ["mpirun", "-n", str(ranks), *command],
        env={**os.environ, **SETTINGS}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    ) as job:  # fmt: skip
        try:
            yield job
        finally:
            job.terminate()


def said_twice(output, word):
    """Whether the word is there twice and nothing else: mpirun may part a rank's line from its end."""
    return output.count(word) == 2 and not output.replace(word, "").strip()


def kill_and_start_again(first, second, command):
    """A rank is killed in mid-run, with which MPI ends all; as many ranks as `second` go on."""
    with gated.Gate() as gate, gated.declared(gate) as (client, name, undisturbed):
        with mpirun(first, command(client, name, gate)) as job:
            os.kill(gate.held(), signal.SIGKILL)
            assert job.wait(100) != 0
        assert not client.get(name).over
        gate.open()
        with mpirun(second, command(client, name, gate)) as job:
            output, _ = job.communicate(timeout=100)
            assert job.returncode == 0 and said_twice(output, "SUCCEEDED"), output
        assert gated.finished(client, name) == undisturbed


def test_pilots():
    kill_and_start_again(3, 2, lambda client, name, gate: gated.pilot(client, name))


def test_executor():
    ranks = [sys.executable, "-m", "mpi4py.futures", str(HERE / "ranks.py")]
    kill_and_start_again(
        3, 3, lambda client, name, gate: [*ranks, client.address, name, gate.folder]
    )
