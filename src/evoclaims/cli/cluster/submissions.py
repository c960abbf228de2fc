"""The jobs that were submitted for a store, as files of it: `jobs/<submission>.json`, beside what submitit writes."""

from __future__ import annotations

import secrets
from dataclasses import dataclass
from datetime import UTC, datetime
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
    """

    schema: Literal[1]
    cluster: Cluster
    host: Name
    tier: Name
    jobs: tuple[SubmittedJob, ...]
    variant: str = ""

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
