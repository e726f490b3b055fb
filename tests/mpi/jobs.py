"""Jobs of stellate-mpi on this machine, and what stellate makes of the same."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

# More ranks than processors, as root too, and without a word about what the kernel forbids in a container.
_ENVIRONMENT = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "OMPI_MCA_hwloc_base_binding_policy": "none",
    "OMPI_MCA_btl_vader_single_copy_mechanism": "none",
    "OMPI_MCA_mpi_yield_when_idle": "1",
}


def run(words: Sequence[str | Path]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(word) for word in words],
        env=os.environ | _ENVIRONMENT,
        capture_output=True,
        text=True,
        check=False,
    )


def mesh(*words: str | Path) -> subprocess.CompletedProcess[str]:
    return run([os.environ["STELLATE"], "mesh", "-q", *words])


def ranks(count: int, *words: str | Path) -> list[str | Path]:
    """So many ranks of a job, as mpirun takes them."""
    return ["-n", str(count), os.environ["STELLATE_MPI"], "mesh", "-q", *words]


def job(count: int, *words: str | Path) -> subprocess.CompletedProcess[str]:
    return run(["mpirun", *ranks(count, *words)])
