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


# An oracle command that does something else in rank 1, once it has said some bytes.
_IN_RANK_1 = """#!/bin/sh
RANK=$PPID  # or that of a shell of its own
grep -q stellate-mpi /proc/$RANK/comm || RANK=$(cut -d " " -f 4 /proc/$RANK/stat)
SCRIPT=$$
export RANK SCRIPT
perl {root}/clients/pipe/torus.pl | if [ "$OMPI_COMM_WORLD_RANK" = 1 ]; then
  perl -e 'while (sysread STDIN, $said, 4096) {{
    syswrite STDOUT, $said;
    $bytes += length $said;
    if ($bytes > {bytes}) {{ {what} }}
  }}'
else
  cat
fi
"""


def oracle(folder: Path, count: int, what: str) -> str:
    """Its path in that folder; `what`: to do, in Perl."""
    script = folder / "oracle"
    script.write_text(_IN_RANK_1.format(root=ROOT, bytes=count, what=what))
    script.chmod(0o755)
    return str(script)


def refused(done: subprocess.CompletedProcess[str], status: int, *words: str) -> None:
    """Whether it ended with that status, and one error with those words."""
    assert done.returncode == status, (done.stdout, done.stderr)
    ours = [line for line in done.stderr.splitlines() if line.startswith("stellate: ")]
    assert len(ours) == 1, done.stderr
    for word in words:
        assert word in ours[0]
