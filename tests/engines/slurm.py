"""A Slurm of one node, of its own: key, configuration, ports and state in one folder.

Nothing of a Slurm that the machine may have is read or changed. Any user may start one; jobs are
that user's.
"""

from __future__ import annotations

import contextlib
import getpass
import os
import pathlib
import secrets
import shutil
import socket
import subprocess
import tempfile
from typing import Any

from gated import until

CONFIGURATION = """\
ClusterName=stellate
SlurmctldHost={host}(127.0.0.1)
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SwitchType=switch/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
JobRequeue=1
KillWait=2
ReturnToService=2
CommunicationParameters=NoCtldInAddrAny,NoInAddrAny
SchedulerParameters=sched_interval=1,bf_interval=1
NodeName={host} NodeAddr=127.0.0.1 CPUs=8
SlurmdParameters=config_overrides
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


class Slurm:
    """slurmctld, slurmd and munged, for as long as it is entered."""

    def __init__(self) -> None:
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="slurm-"))
        self.folder.chmod(0o755)  # munge wants every folder above its socket to be passable
        for name in ("state", "spool"):
            (self.folder / name).mkdir()
        self.host = socket.gethostname().partition(".")[0]
        configuration = self.folder / "slurm.conf"
        configuration.write_text(
            CONFIGURATION.format(
                folder=self.folder, host=self.host, ports=_free_ports(2), user=getpass.getuser()
            )
        )
        self._configuration = str(configuration)
        self._daemons: list[subprocess.Popen[bytes]] = []

    @property
    def environment(self) -> dict[str, str]:
        """For Slurm's commands, and what they start."""
        return {**os.environ, "SLURM_CONF": self._configuration}

    def __enter__(self) -> Slurm:
        try:
            self._start_munge()
            self._start("slurmctld", "-D", "-i")
            until(lambda: self.works("scontrol", "ping"), "slurmctld does not answer")
            self._start("slurmd", "-D", "-N", self.host)
            until(lambda: "idle" in self.run("sinfo", "-h", "-o", "%T"), "the node is not idle")
        except BaseException as error:
            words = self._last_words()
            self.__exit__()
            raise AssertionError(f"no Slurm: {error}\n{words}") from error
        return self

    def _start_munge(self) -> None:
        key = self.folder / "munge.key"
        key.write_bytes(secrets.token_bytes(128))
        key.chmod(0o400)
        options = {"key-file": key.name, "socket": "munge.socket", "pid-file": "munge.pid"}
        options |= {"log-file": "munge.log", "seed-file": "munge.seed"}
        flags = [f"--{name}={self.folder}/{file}" for name, file in options.items()]
        self._start("munged", "--foreground", *flags)
        until((self.folder / "munge.socket").exists, "munged does not listen")

    def _start(self, program: str, *arguments: str) -> None:
        path = shutil.which(program, path=os.environ.get("PATH", "") + ":/usr/sbin:/sbin")
        assert path, f"{program} is not installed: docker/install-packages test"
        with open(self.folder / f"{program}.out", "wb") as output:
            self._daemons.append(
                subprocess.Popen(
                    [path, *arguments], env=self.environment, stdout=output, stderr=output
                )
            )

    def run(self, *command: str, **more: Any) -> str:
        """What a command of Slurm's prints. Raises CalledProcessError."""
        done = subprocess.run(
            command, env=self.environment, check=True, capture_output=True, text=True, **more
        )
        return done.stdout

    def works(self, *command: str) -> bool:
        done = subprocess.run(command, env=self.environment, capture_output=True, text=True)
        return done.returncode == 0 and "DOWN" not in done.stdout

    def __exit__(self, *_: object) -> None:
        if len(self._daemons) == 3:
            self._end_jobs()
        for daemon in reversed(self._daemons):
            daemon.terminate()
            try:
                daemon.wait(20)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()
        shutil.rmtree(self.folder, ignore_errors=True)

    def _end_jobs(self) -> None:
        """Before the daemons go: what a job leaves behind would wait for them for ever."""
        with contextlib.suppress(subprocess.CalledProcessError, AssertionError):
            self.run("scancel", f"--user={getpass.getuser()}")
            until(lambda: not self.run("squeue", "-h"), "jobs do not end")

    def _last_words(self) -> str:
        files = [*self.folder.glob("*.out"), *self.folder.glob("*.log")]
        return "\n".join(f"{f.name}: {f.read_text(errors='replace')[-1500:]}" for f in files)


def _free_ports(count: int) -> list[int]:
    """Ports that are free now; held together, so that they differ."""
    sockets = [socket.socket() for _ in range(count)]
    try:
        for each in sockets:
            each.bind(("", 0))
        return [each.getsockname()[1] for each in sockets]
    finally:
        for each in sockets:
            each.close()
