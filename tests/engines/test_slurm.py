"""Slurm on one node: srun, and a job array with requeue."""

import os
import pathlib
import shlex
import signal
import subprocess

import gated
import pytest
from slurm import Slurm


@pytest.fixture(scope="module")
def slurm():
    with Slurm() as running:
        yield running


def test_srun(slurm):
    with gated.Gate() as gate, gated.declared(gate) as (client, name, undisturbed):
        with subprocess.Popen(
            ["srun", "-n", "3", *gated.pilot(client, name)],
            env=slurm.environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        ) as job:  # fmt: skip
            os.kill(gate.held(), signal.SIGKILL)
            gate.open()
            output, _ = job.communicate(timeout=100)
        assert job.returncode == 137, output  # the step says that a task was killed
        assert output.count("SUCCEEDED") == 2, output  # the other two went on to the end
        assert gated.finished(client, name) == undisturbed


def test_array_with_requeue(slurm):
    with gated.Gate() as gate, gated.declared(gate) as (client, name, undisturbed):
        pilot = shlex.join(gated.pilot(client, name))
        log = f"--output={gate.folder}/pilot-%a.out"
        array = slurm.run(
            "sbatch", "--parsable", "--requeue", "--array=1-2", log, "--wrap", pilot
        ).strip()
        pid = gate.held()
        for task in (1, 2):  # as a preemption would: killed, and queued again
            slurm.run("scontrol", "requeue", f"{array}_{task}")
        gated.until(lambda: not pathlib.Path(f"/proc/{pid}").exists(), "the pilot was not killed")
        assert not client.get(name).over
        gate.open()
        for task in (1, 2):
            gated.until(
                lambda task=task: (
                    "PENDING" in slurm.run("squeue", "-h", "-j", f"{array}_{task}", "-o", "%T")
                ),
                "the task was not queued again",
            )
            slurm.run("scontrol", "update", f"JobId={array}_{task}", "StartTime=now")
        assert gated.finished(client, name) == undisturbed
