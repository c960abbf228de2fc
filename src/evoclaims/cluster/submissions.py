"""The jobs that were submitted for a store, as files of it (`jobs/<submission>.json`), and what has become of them."""

from __future__ import annotations

import secrets
import shutil
import socket
import subprocess
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Final, Literal

import msgspec
from msgspec import Meta

from evoclaims.core.errors import UserError
from evoclaims.core.files import read_file, write_once

FOLDER: Final = "jobs"
SCHEMA: Final = 1

Cluster = Literal["slurm", "local"]
Name = Annotated[str, Meta(min_length=1, max_length=1000)]
JobId = Annotated[str, Meta(pattern=r"\A[0-9]{1,19}(_[0-9]{1,19})?\Z")]


@dataclass(frozen=True)
class SubmittedBatch:
    """A condition's missing trials, as one process runs them; `condition` is its id."""

    method: Name
    task: Name
    condition: Annotated[str, Meta(pattern=r"\A[0-9a-f]{64}\Z")]

    @property
    def label(self) -> str:
        """How the batch is called in a line."""
        return f"{self.method} on {self.task}"


@dataclass(frozen=True)
class SubmittedJob:
    """A job of a cluster.

    Attributes:
        id: as the cluster calls it: a number, with "_" and an index in an array; of a local job the process's.
        batches: what it runs, in this order.
    """

    id: JobId
    batches: tuple[SubmittedBatch, ...]


@dataclass(frozen=True)
class Submission:
    """The jobs of one call of `evoclaims submit`.

    Attributes:
        schema: of this file.
        cluster: where they run.
        host: the machine that the call was made on.
        tier: of their conditions.
        jobs: all of them.
        variant: of the protocol; empty for itself.
        trials: per condition; 0 for the tier's number.
    """

    schema: Literal[1]
    cluster: Cluster
    host: Name
    tier: Name
    jobs: tuple[SubmittedJob, ...]
    variant: str = ""
    trials: Annotated[int, Meta(ge=0)] = 0

    @property
    def tier_and_variant(self) -> str:
        """How both are called in a line."""
        return f"{self.tier}, {self.variant}" if self.variant else self.tier


def new_name() -> str:
    """Return the name of a new submission; later ones sort behind earlier ones."""
    return f"{datetime.now(UTC):%Y%m%d-%H%M%S-%f}-{secrets.token_hex(2)}"


def folder_of(store_root: Path, name: str) -> Path:
    """Return the folder of a submission, where submitit writes."""
    return store_root / FOLDER / name


def log_of(store_root: Path, name: str, job: SubmittedJob) -> Path:
    """Return the file that a job's output goes to; it begins when the job does."""
    return folder_of(store_root, name) / f"{job.id}_0_log.out"


def save(store_root: Path, name: str, submission: Submission) -> None:
    """Write down a submission."""
    text = msgspec.json.format(msgspec.json.encode(submission), indent=1) + b"\n"
    write_once(folder_of(store_root, name).with_suffix(".json"), text)


def load_all(store_root: Path) -> dict[str, Submission]:
    """Return all submissions by name, the first one first.

    Raises:
        UserError: for a file that is not one.
    """
    found = {}
    for path in sorted((store_root / FOLDER).glob("*.json")):
        try:
            found[path.stem] = msgspec.json.decode(read_file(path), type=Submission)
        except (OSError, msgspec.MsgspecError, RecursionError) as error:
            raise UserError(
                f"Cannot read the list of submitted jobs, {path}: {error}. Move the file away; its jobs "
                "that still run are then unknown."
            ) from error
    return found


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
    lines = (line.split("|", 3) for line in out.splitlines())  # a site's own words may be among them
    return {line[0]: _seen(*line[1:]) for line in lines if len(line) == 4}


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
    if state in WAITING:
        return Seen(State.QUEUED, reason)
    if state in AT_WORK:
        return Seen(State.RUNNING, f"on {nodes}" if nodes else "")
    detail = "" if state in ("COMPLETED", "FAILED") else state.lower().replace("_", " ")
    return Seen(State.ENDED, f"{detail} on {nodes}" if detail and nodes else detail)


def _answer(command: Sequence[str]) -> tuple[int, str, str]:
    try:
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=ANSWER_SECONDS)
    except subprocess.TimeoutExpired:
        return 1, "", f"no answer in {ANSWER_SECONDS} s"
    return done.returncode, done.stdout, done.stderr
