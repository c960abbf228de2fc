"""A real SLURM on this machine, in a folder: a controller, several nodes, and the munge by which they trust each other.

Wanted: Debian's slurm-wlm and munge, and root, as in a container.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
import signal
import socket
import subprocess
import time
from pathlib import Path
from typing import Final

PROGRAMS: Final = ("munged", "slurmctld", "slurmd", "sbatch", "srun", "squeue", "scontrol", "scancel")

CONFIGURATION: Final = """
ClusterName=scratch
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket,cred_expire=30
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool.%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.%n.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.%n.log
SlurmctldPort={port}
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SwitchType=switch/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SchedulerType=sched/backfill
SchedulerParameters=batch_sched_delay=1,sched_interval=2,bf_interval=2
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
PreemptType=preempt/partition_prio
PreemptMode=REQUEUE
JobRequeue=1
KillWait=5
SlurmdTimeout=10
SlurmctldTimeout=30
ReturnToService=2
MinJobAge=300
{nodes}
PartitionName=work Nodes=ALL Default=YES MaxTime=INFINITE State=UP OverSubscribe=NO PriorityTier=1
PartitionName=urgent Nodes=ALL MaxTime=INFINITE State=UP PriorityTier=9 PreemptMode=OFF
"""


def lacks() -> str:
    """Return what this machine lacks to start one; empty if nothing."""
    missing = [program for program in PROGRAMS if _program(program) is None]
    if missing:
        return f"{', '.join(missing)} (Debian: slurm-wlm, munge)"
    return "" if os.geteuid() == 0 else "root"


class Cluster:
    """A controller and nodes, started by `start` and ended by `stop`."""

    def __init__(self, folder: Path, nodes: int = 2) -> None:
        """Write the configuration into an empty folder, whose path must be short: it holds a socket."""
        folder.chmod(0o755)  # munge wants that all can reach its socket
        self.folder, self.nodes = folder, [f"node{number}" for number in range(nodes)]
        self._daemons: dict[str, subprocess.Popen[bytes]] = {}
        for name in ("state", *(f"spool.{node}" for node in self.nodes)):
            (folder / name).mkdir()
        (folder / "munge.key").write_bytes(secrets.token_bytes(128))
        (folder / "munge.key").chmod(0o600)
        host, ports = socket.gethostname(), _free_ports(nodes + 1)
        lines = [
            f"NodeName={node} NodeHostname={host} NodeAddr=127.0.0.1 Port={port} CPUs=1 State=UNKNOWN"
            for node, port in zip(self.nodes, ports[1:], strict=True)
        ]
        text = CONFIGURATION.format(folder=folder, host=host, port=ports[0], nodes="\n".join(lines))
        (folder / "slurm.conf").write_text(text)
        self.environment = {"SLURM_CONF": str(folder / "slurm.conf")}

    def start(self) -> None:
        """Start all daemons and wait until every node is idle."""
        folder = self.folder
        munge = ["munged", "--foreground", "--force", f"--key-file={folder / 'munge.key'}", "--num-threads=2"]
        munge += [f"--{name}-file={folder / f'munge.{name}'}" for name in ("log", "pid", "seed")]
        self._spawn("munged", [*munge, f"--socket={folder / 'munge.socket'}"])
        _wait_for(lambda: (folder / "munge.socket").exists(), "munged does not answer")
        self._spawn("slurmctld", ["slurmctld", "-D", "-c"])
        for node in self.nodes:
            self.start_node(node)
        _wait_for(lambda: self.states() == dict.fromkeys(self.nodes, "idle"), "the nodes are not idle")

    def start_node(self, node: str) -> None:
        """Start a node's daemon."""
        self._spawn(node, ["slurmd", "-D", "-N", node])

    def kill_node(self, node: str) -> None:
        """Kill a node's daemon, and all that runs on the node, as a power failure does."""
        daemon = self._daemons.pop(node)
        daemon.kill()
        daemon.wait()
        for process in _processes_of(node):
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)

    def states(self) -> dict[str, str]:
        """Return the nodes' states as SLURM names them, such as idle, mixed, down."""
        lines = self.ask("sinfo", "-h", "-N", "-p", "work", "-o", "%N %T").splitlines()
        return dict(line.split() for line in lines)

    def ask(self, *command: str) -> str:
        """Return what one of SLURM's commands answers; empty where it fails."""
        environment = {**os.environ, **self.environment}
        return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60).stdout

    def stop(self) -> None:
        """End all jobs and daemons."""
        self.ask("scancel", "--user=root")
        for node in self.nodes:
            if node in self._daemons:
                self.kill_node(node)
        for name in ("slurmctld", "munged"):
            if name in self._daemons:
                self._daemons[name].kill()
        for process in self._daemons.values():
            process.wait()

    def _spawn(self, name: str, command: list[str]) -> None:
        program = _program(command[0])
        assert program is not None
        with open(self.folder / f"{name}.said", "ab") as said:
            self._daemons[name] = subprocess.Popen(
                [program, *command[1:]],
                env={**os.environ, **self.environment},
                stdin=subprocess.DEVNULL,
                stdout=said,
                stderr=said,
                start_new_session=True,
            )


def _program(name: str) -> str | None:
    """Return the path of a program, also of a daemon outside of a user's path."""
    return shutil.which(name, path=f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin")


def _free_ports(count: int) -> list[int]:
    """Return ports that nobody listens on."""
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports


def _processes_of(node: str) -> list[int]:
    """Return the processes of a node's jobs, and the daemons that watch them, which come first."""
    setting, watching, watched = f"SLURMD_NODENAME={node}".encode(), set[int](), []
    for entry in Path("/proc").iterdir():
        try:
            if not entry.name.isdecimal() or setting not in (entry / "environ").read_bytes().split(b"\0"):
                continue
            watched.append(int(entry.name))
            parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            if Path(f"/proc/{parent}/comm").read_text().startswith("slurmstepd"):
                watching.add(parent)
        except OSError:
            continue
    return [*watching, *watched]


def _wait_for(condition, what: str, seconds: float = 60.0) -> None:  # type: ignore[no-untyped-def]
    """Wait until a condition holds."""
    until = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > until:
            raise RuntimeError(f"{what} after {seconds:g} s")
        time.sleep(0.2)
