"""What has become of jobs, as SLURM or this machine's list of processes says."""

from __future__ import annotations

import shutil
import socket
import subprocess
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Final

from evoclaims.cli.cluster.submissions import Submission
from evoclaims.core.errors import UserError

JOB_NAME: Final = "evoclaims"
"""All jobs are called so, which is how SLURM is asked about them."""

ANSWER_SECONDS: Final = 60


class State(StrEnum):
    """What a job does."""

    QUEUED = "queued"
    RUNNING = "running"
    ENDED = "ended"


WAITING: Final = frozenset(
    {"PENDING", "CONFIGURING", "REQUEUED", "REQUEUE_FED", "REQUEUE_HOLD", "RESV_DEL_HOLD", "SPECIAL_EXIT"}
)
AT_WORK: Final = frozenset({"RUNNING", "COMPLETING", "SUSPENDED", "STOPPED", "RESIZING", "SIGNALING", "STAGE_OUT"})


@dataclass(frozen=True)
class Seen:
    """A job as the cluster shows it.

    Attributes:
        state: what it does.
        reason: why it waits or has ended, or where it runs; may be empty.
    """

    state: State
    reason: str = ""


GONE: Final = Seen(State.ENDED)


def states(submission: Submission, jobs: Collection[str]) -> dict[str, Seen]:
    """Return what has become of some jobs of a submission.

    Raises:
        UserError: when SLURM does not answer.
    """
    if submission.cluster == "local":
        return {job: _local(submission.host, job) for job in jobs}
    queue = _queue()
    seen = {job: queue[job] for job in jobs if job in queue}
    rest = [job for job in jobs if job not in queue]
    return {**dict.fromkeys(rest, GONE), **(_accounts(rest) if rest else {}), **seen}


def _local(host: str, job: str) -> Seen:
    """Return what a process of this machine does; nothing is known of another machine's, which may be running."""
    if host != socket.gethostname():
        return Seen(State.RUNNING, f"on {host}, which alone knows")
    try:
        command = Path(f"/proc/{job}/cmdline").read_bytes()  # empty for a zombie
    except OSError:
        return GONE
    return Seen(State.RUNNING, f"process {job}") if b"submitit.local" in command else GONE


def _queue() -> dict[str, Seen]:
    """Return the jobs that SLURM's controller knows, those of the last minutes that have ended among them."""
    command = ["squeue", "--noheader", "--array", "--states=all", f"--name={JOB_NAME}", "--format=%i|%T|%r|%N"]
    if shutil.which(command[0]) is None:
        raise UserError(
            "This store has SLURM jobs, and there is no squeue here to ask about them. Run this on a "
            "machine of the cluster."
        )
    status, out, err = _answer(command)
    if status:
        raise UserError(f"SLURM does not say which jobs are queued (squeue: {' '.join(err.split())}); try again later.")
    lines = (line.split("|", 3) for line in out.splitlines())
    return {job: _seen(state, reason, nodes) for job, state, reason, nodes in lines}


def _accounts(jobs: Sequence[str]) -> dict[str, Seen]:
    """Return what SLURM's accounts say about jobs that its controller has forgotten; many sites keep none."""
    if shutil.which("sacct") is None:
        return {}
    fields = "--format=JobID,State,NodeList"
    command = ["sacct", "--noheader", "--array", "--allocations", "--parsable2", fields, f"--jobs={','.join(jobs)}"]
    status, out, _ = _answer(command)
    lines = [] if status else [line.split("|") for line in out.splitlines()]
    return {line[0]: _seen(line[1].split()[0], "None", line[2]) for line in lines if len(line) == 3 and line[0] in jobs}


def _seen(state: str, reason: str, nodes: str) -> Seen:
    """Return what SLURM's words mean."""
    if state in WAITING:
        return Seen(State.QUEUED, reason)
    if state in AT_WORK:
        return Seen(State.RUNNING, f"on {nodes}" if nodes else "")
    detail = "" if state in ("COMPLETED", "FAILED") else state.lower().replace("_", " ")
    return Seen(State.ENDED, f"{detail} on {nodes}" if detail and nodes else detail)


def _answer(command: Sequence[str]) -> tuple[int, str, str]:
    """Return status, output and errors of a command."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=ANSWER_SECONDS)
    except subprocess.TimeoutExpired:
        return 1, "", f"no answer in {ANSWER_SECONDS} s"
    return done.returncode, done.stdout, done.stderr
