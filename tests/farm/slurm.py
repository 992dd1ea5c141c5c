# SPDX-License-Identifier: GPL-3.0-or-later
"""Slurm's own daemons on this machine, with a configuration of their own."""

from __future__ import annotations

import os
import random
import secrets
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from .job import REPOSITORY

PROGRAMS: Final = ("munged", "slurmctld", "slurmd", "sbatch", "squeue", "scontrol")
SCRIPT: Final = REPOSITORY / "octo_motion" / "command_line" / "farm" / "slurm.sh"
_PATH: Final = f"{os.environ.get('PATH', '')}:/usr/sbin"
_CONFIGURATION: Final = """ClusterName=octo
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort=16817
SlurmdPort=16818
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/ctld.pid
SlurmdPidFile={folder}/d.pid
SlurmctldLogFile={folder}/ctld.log
SlurmdLogFile={folder}/d.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
JobRequeue=1
KillWait=5
SlurmdTimeout=20
JobCompType=jobcomp/filetxt
JobCompLoc={folder}/ended.txt
NodeName={host} NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN
PartitionName=farm Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def missing() -> str:
    """What keeps Slurm from running here; "" if nothing does."""
    lacking = [each for each in PROGRAMS if shutil.which(each, path=_PATH) is None]
    if lacking:
        return f"there is no {', '.join(lacking)} (apt-get install slurm-wlm munge)"
    return "" if os.geteuid() == 0 else "its daemons want to be started by root"


@dataclass
class Slurm:
    """A cluster of this one machine."""

    folder: Path
    host: str
    node: int = 0
    """Process of the node's daemon."""

    def run(self, *command: str, **environment: str) -> str:
        """What one of Slurm's programs says."""
        return subprocess.run(
            command,
            env={**self._environment(), **environment},
            cwd=self.folder,
            capture_output=True,
            encoding="utf-8",
            check=True,
        ).stdout

    def is_up(self) -> bool:
        """Whether the daemons have found one another."""
        try:
            return "UP" in self.run("scontrol", "ping") and "idle" in self.run("sinfo")
        except subprocess.CalledProcessError:
            return False

    def submit(self, job: Path, blender: Path, shots: int, chunk: int, *more: str) -> str:
        """Submit the array of a job; its id."""
        words = [f"--array=1-{-(-shots // chunk)}", "--parsable", *more, str(SCRIPT), str(job)]
        given = {"CHUNK": str(chunk), "BLENDER": str(blender)}
        return self.run("sbatch", *words, **given).strip()

    def running(self) -> list[str]:
        """Tasks that run now, each as job_index."""
        words = ("--noheader", "--array", "--states=R", "--format=%F_%K")
        return self.run("squeue", *words).split()

    def wait(self, meanwhile: Iterator[None] | None = None) -> None:
        """Wait until nothing is left in the queue; ``meanwhile`` is gone on with twice a second."""
        while self.run("squeue", "--noheader", "--array").strip():
            if meanwhile is not None:
                next(meanwhile, None)
            time.sleep(0.5)

    def start_node(self) -> None:
        """Start the daemon of the node."""
        self.run("slurmd", "-N", self.host)
        pid = self.folder / "d.pid"
        while not (pid.exists() and pid.read_text(encoding="utf-8").strip()):
            time.sleep(0.1)
        self.node = int(pid.read_text(encoding="utf-8"))

    def kill_node(self) -> None:
        """Kill the daemon of the node, as a fault of the machine does."""
        os.kill(self.node, signal.SIGKILL)
        (self.folder / "d.pid").unlink(missing_ok=True)

    def _environment(self) -> dict[str, str]:
        return {**os.environ, "PATH": _PATH, "SLURM_CONF": str(self.folder / "slurm.conf")}


@contextmanager
def slurm(folder: Path) -> Iterator[Slurm]:
    """The daemons while they run, all files of which are in a folder."""
    host = os.uname().nodename.split(".")[0]
    for name in ("state", "spool"):
        (folder / name).mkdir(parents=True)
    (folder / "slurm.conf").write_text(
        _CONFIGURATION.format(host=host, folder=folder), encoding="utf-8"
    )
    key = folder / "munge.key"
    key.write_bytes(secrets.token_bytes(1024))
    key.chmod(0o600)
    cluster = Slurm(folder, host)
    files = {"key-file": "munge.key", "socket": "munge.socket", "pid-file": "munged.pid"}
    files |= {"log-file": "munged.log", "seed-file": "munged.seed"}
    options = [f"--{option}={folder / name}" for option, name in files.items()]
    cluster.run("munged", "--force", *options)
    try:
        cluster.run("slurmctld")
        cluster.start_node()
        while not cluster.is_up():
            time.sleep(0.5)
        yield cluster
    finally:
        for name in ("d.pid", "ctld.pid", "munged.pid"):
            pid = folder / name
            if pid.exists():
                os.kill(int(pid.read_text(encoding="utf-8")), signal.SIGTERM)


def killer(starts: Path, share: float, seconds: float, seed: int) -> Iterator[None]:
    """Kill a share of the processes that are noted in a file, each at a moment of its own within
    the seconds that it takes.
    """
    chance = random.Random(seed)  # noqa: S311 - no secret
    seen: set[int] = set()
    due: list[tuple[float, int]] = []
    while True:
        text = starts.read_text(encoding="utf-8") if starts.exists() else ""
        for number, pid in enumerate(map(int, text.split())):
            if number not in seen:
                seen.add(number)
                if chance.random() < share:
                    due.append((time.monotonic() + chance.uniform(0.0, seconds), pid))
        now = time.monotonic()
        for moment, pid in [each for each in due if each[0] <= now]:
            due.remove((moment, pid))
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                continue
            with starts.with_name("killed").open("a", encoding="utf-8") as file:
                file.write(f"{pid}\n")
        yield
