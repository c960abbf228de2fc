"""A cluster's job: what it asks for (options of `evoclaims submit` or `[tool.evoclaims.slurm]`), and what it does.

submitit pickles a `BatchJob`, which holds text alone, and loads it where the job runs: this module imports neither jax
nor the project.
"""

from __future__ import annotations

import argparse
import contextlib
import math
import os
import re
import shlex
import shutil
import signal
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from msgspec import ValidationError, convert

from evoclaims.cluster.submissions import Cluster
from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.trials.failed import seconds_of

DEFAULT_MINUTES: Final = 120
"""A job that runs out of time goes on later, so that any time will do; a short one is scheduled sooner."""

LOCAL_MINUTES: Final = 365 * 24 * 60
"""On this machine nobody else waits for the end of a job."""

MOST_TOGETHER: Final = {"slurm": 256, "local": 1}
"""Jobs at a time: SLURM decides; here one batch uses all cores."""

_ALWAYS_SET: Final = (
    *("job_name", "output", "error", "open_mode", "signal", "requeue", "no_requeue"),
    *("wrap", "nodes", "ntasks", "ntasks_per_node"),
)

OURS: Final = {
    "array": "--array",
    "time": "--time",
    "partition": "--partition",
    "gpus": "--gpus",
    "gpus_per_node": "--gpus",
    "cpus_per_task": "--cpus",
    **dict.fromkeys(_ALWAYS_SET, ""),
}
"""Options of sbatch that are ours to set, and the options of `evoclaims submit` that they are set by, if any."""


@dataclass(frozen=True)
class JobRequest:
    """What each job asks for.

    Attributes:
        cluster: "slurm" or "local".
        partition: SLURM's partition; empty for the cluster's default.
        gpus, cpus: how many a job gets; 0 for what the cluster gives without asking.
        minutes: of a job; it goes on in a new one where it is not done by then.
        together: how many jobs run at a time.
        setup: lines of shell that a job begins with.
        more: further options of sbatch; a flag's value is True.
    """

    cluster: Cluster
    partition: str
    gpus: int
    cpus: int
    minutes: int
    together: int
    setup: tuple[str, ...]
    more: Mapping[str, Any]

    def summary(self) -> str:
        """Return what a job asks for, as part of a sentence."""
        asks = [f"{self.gpus} GPU{'s' * (self.gpus > 1)}"] * (self.gpus > 0)
        asks += [f"{self.cpus} CPU core{'s' * (self.cpus > 1)}"] * (self.cpus > 0)
        if self.cluster == "slurm":
            asks += [f"partition {self.partition}"] * bool(self.partition) + [f"{clock(self.minutes)} of time"]
            asks += [key.replace("_", "-") + ("" if value is True else f"={value}") for key, value in self.more.items()]
        return ", ".join(asks)


@dataclass(frozen=True)
class _Table:
    """The keys of `[tool.evoclaims.slurm]` that are not simply options of sbatch."""

    partition: str = ""
    gpus: int = 0
    cpus: int = 0
    time: str = ""
    array: int = MOST_TOGETHER["slurm"]
    setup: tuple[str, ...] = ()


def requested(options: argparse.Namespace, table: Mapping[str, object]) -> JobRequest:
    """Return what the jobs of a call ask for.

    Args:
        options: of the call; None where they were not given.
        table: the site's defaults, for SLURM alone.

    Raises:
        UserError: for a value that means nothing, or where this machine has no SLURM.
    """
    if options.cluster not in MOST_TOGETHER:
        raise UnknownNameError("cluster", options.cluster, MOST_TOGETHER)
    local = options.cluster == "local"
    if not local and not options.dry_run and shutil.which("sbatch") is None:
        raise UserError("There is no SLURM here (no sbatch): --cluster local runs the same jobs on this machine.")
    if local and options.slurm:
        raise UserError("--slurm is only for SLURM jobs, and --cluster is local. Leave one of them out.")
    site = _Table(array=MOST_TOGETHER["local"]) if local else _site(table)
    own = {key: value for key, value in table.items() if key not in _Table.__dataclass_fields__ and not local}
    more = {**dict(_option(key, value) for key, value in own.items()), **dict(map(_given, options.slurm))}
    time = options.time or site.time
    return JobRequest(
        cluster=options.cluster,
        partition=site.partition if options.partition is None else options.partition,
        gpus=_count("--gpus", site.gpus if options.gpus is None else options.gpus, 0),
        cpus=_count("--cpus", site.cpus if options.cpus is None else options.cpus, 0),
        minutes=minutes_of(time) if time else LOCAL_MINUTES if local else DEFAULT_MINUTES,
        together=_count("--array", site.array if options.array is None else options.array, 1),
        setup=site.setup,
        more=more,
    )


def minutes_of(text: str) -> int:
    """Return the minutes, rounded up, of a time as SLURM writes it ("30", "2:00:00", "1-12") or we do ("90min", "2h").

    Raises:
        UserError: for any other text, or no time.
    """
    found = re.fullmatch(r"(?:(\d{1,4})-)?(\d{1,5})(?::(\d{1,2}))?(?::(\d{1,2}))?", text.strip(), re.ASCII)
    if found is None:
        try:
            seconds = seconds_of(text)
        except UserError:  # which names no time as SLURM writes it
            seconds = math.inf
        if math.isinf(seconds):
            raise UserError(f"A job's time is a length of time such as 2:00:00 or 2h, not {text!r}.")
    else:
        days, *parts = (None if part is None else int(part) for part in found.groups())
        given = [part for part in parts if part is not None]
        in_hours = days is not None or len(given) == 3  # else minutes, or minutes:seconds
        units = (3600, 60, 1) if in_hours else (60, 1, 0)
        seconds = float((days or 0) * 86400 + sum(part * unit for part, unit in zip(given, units, strict=False)))
    if seconds <= 0:
        raise UserError(f"A job's time must be above 0, not {text!r}. Write a time such as 2:00:00 or 2h.")
    return math.ceil(seconds / 60)


def clock(minutes: int) -> str:
    """Return minutes as SLURM writes a time: 2:00:00."""
    return f"{minutes // 60}:{minutes % 60:02}:00"


def _site(table: Mapping[str, object]) -> _Table:
    try:
        return convert({key: table[key] for key in _Table.__dataclass_fields__ if key in table}, _Table)
    except ValidationError as error:
        raise UserError(f"In pyproject.toml, [tool.evoclaims.slurm]: {error}.") from error


def _given(text: str) -> tuple[str, Any]:
    """Return key and value of `--slurm KEY=VALUE`, or of a flag, `--slurm KEY`."""
    key, equals, value = text.partition("=")
    return _option(key.strip(), value if equals else True)


def _option(key: str, value: object) -> tuple[str, Any]:
    """Return an option of sbatch as submitit takes it."""
    name = key.removeprefix("--").replace("-", "_")
    if not re.fullmatch(r"[a-z][a-z_]*", name) or not isinstance(value, str | int) or "\n" in str(value):
        raise UserError(
            f"An option of sbatch is a name and a text or a number, such as account=lab, not {key!r}: {value!r}."
        )
    if name in OURS:
        instead = f"use {OURS[name]}" if OURS[name] else "evoclaims sets it"
        raise UserError(f"The option {key} of sbatch cannot be passed through: {instead}.")
    return name, value


def _count(option: str, value: int, least: int) -> int:
    if value < least:
        raise UserError(f"{option} takes a number from {least} up, not {value}.")
    return value


INTERRUPTED: Final = 130
"""What `evoclaims run` ends with when it was interrupted."""

PATIENCE: Final = 40.0
"""Seconds that a batch is given to write its checkpoint before it is killed; it is asked `SIGNAL_SECONDS` before."""

SIGNAL_SECONDS: Final = 90
"""How long before its time limit a job is warned; a job of a few minutes is warned later."""

POLL_SECONDS: Final = 0.1


class BatchJob:
    """Batches that one job runs, one after the other."""

    def __init__(self, commands: Sequence[Sequence[str]], folder: str) -> None:
        """Run nothing yet: `commands`, one for each batch, will run in `folder`."""
        self.commands = [list(command) for command in commands]
        self.folder = folder
        self.process = 0

    def __call__(self) -> None:
        """Run all batches; a process that fails or dies does not stop the others.

        Raises:
            RuntimeError: at the end, when a batch has failed: the scheduler shows the job as failed then.
        """
        os.chdir(self.folder)
        failed = 0
        for command in self.commands:
            status = self._run(command)
            if status == INTERRUPTED:
                # The scheduler has warned all processes of the job that it takes the machine back. It warns this one
                # whether the job goes on later (see `checkpoint`), or kills it.
                time.sleep(PATIENCE)
                raise RuntimeError("The job was interrupted.")
            if status < 0:
                print(f"evoclaims: the process died of {signal.Signals(-status).name}.", flush=True)
            failed += status != 0
        if failed:
            raise RuntimeError(f"{failed} of {len(self.commands)} batches failed; the lines above say why.")

    def checkpoint(self) -> Any:
        """End the running batch with a checkpoint, and return what submitit is to start again: this job."""
        from submitit.helpers import DelayedSubmission

        if self.process:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.process, signal.SIGTERM)
            until = time.monotonic() + PATIENCE
            while _status(self.process, os.WNOHANG) is None:
                if time.monotonic() > until:
                    os.kill(self.process, signal.SIGKILL)
                    _status(self.process)
                    break
                time.sleep(POLL_SECONDS)
        self.process = 0
        return DelayedSubmission(self)

    def _run(self, command: list[str]) -> int:
        print(f"$ {shlex.join(command)}", flush=True)
        # SLURM signals all processes of a job shortly before its time limit. The batch would die of that signal: it is
        # blocked there, and `checkpoint` alone passes it on. (A `subprocess.Popen` has locks, and may not be waited for
        # in a signal's handler while it is waited for outside.)
        self.process = os.posix_spawn(command[0], command, os.environ, setsigmask=[signal.SIGUSR2])
        status = _status(self.process)
        self.process = 0
        return status or 0


def _status(process: int, flags: int = 0) -> int | None:
    """Return the status of a child process, minus a signal's number if it died of one; None while it runs (WNOHANG)."""
    try:
        ended, status = os.waitpid(process, flags)
    except ChildProcessError:
        return 0
    return os.waitstatus_to_exitcode(status) if ended else None
