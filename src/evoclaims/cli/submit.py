"""`evoclaims submit`: a tier's missing batches as jobs of SLURM, or of this machine, by submitit."""

from __future__ import annotations

import argparse
import math
import os
import shlex
import shutil
import socket
import sys
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from evoclaims.cli.jobs import active
from evoclaims.cli.project import Project, open_project
from evoclaims.cli.running import choose, trials_asked
from evoclaims.cluster.job import SIGNAL_SECONDS, BatchJob, JobRequest, clock, requested
from evoclaims.cluster.submissions import (
    JOB_NAME,
    SCHEMA,
    Submission,
    SubmittedBatch,
    SubmittedJob,
    folder_of,
    new_name,
    save,
)
from evoclaims.core.canonical import content_hash
from evoclaims.core.errors import UserError
from evoclaims.execution.host import gpus
from evoclaims.execution.job import Job, MissingBatch, missing_batches
from evoclaims.report.formatting import plural
from evoclaims.report.live_line import duration
from evoclaims.trials.devices import usable_cores
from evoclaims.trials.lease import announced
from evoclaims.trials.spec import Condition

ONE_AT_A_TIME: Final = content_hash("evoclaims submit")
"""What a call announces, so that two at once do not submit the same."""

MOST_REQUEUES: Final = 1000


def main(options: argparse.Namespace) -> int:
    """Submit what is missing and not submitted yet, and say which jobs that makes."""
    project = open_project(options.storage)
    request = requested(options, project.config.slurm)
    tier, names = choose(project, options)
    by_id = {tier.condition(*pair).id: pair for pair in reversed(names)}  # two names may mean the same trials
    conditions = {Job("", *pair): tier.condition(*pair) for pair in by_id.values()}
    if options.dry_run:
        _plan(project, options, request, conditions)
        return 0
    project.store.check_writable()
    with announced(project.store.root, ONE_AT_A_TIME):
        jobs = _plan(project, options, request, conditions)
        if jobs:
            name = new_name()
            submission = _submitted(project, options, request, name, jobs, conditions)
            save(project.store.root, name, submission)
            _say_what_now(project, options, submission)
    return 0


def _plan(
    project: Project, options: argparse.Namespace, request: JobRequest, conditions: Mapping[Job, Condition]
) -> list[list[MissingBatch]]:
    tier = project.reproduction.tier(options.tier)
    seeds, limit = tier.design.seeds(trials_asked(options, tier)), project.config.seconds(None)
    has_gpu = request.gpus or (request.cluster == "local" and gpus("auto"))  # jobs here see what this process sees
    platform = "gpu" if options.device == "gpu" or (options.device == "auto" and has_gpu) else "cpu"
    lacking = missing_batches(project.store, project.reproduction, options.tier, conditions, seeds, limit, platform)
    busy = active(project)
    for one in lacking:
        if conditions[one.job].id in busy:
            print(f"{one.job.label}: {busy[conditions[one.job].id]}")
    batches = [one for one in lacking if conditions[one.job].id not in busy]
    if not batches:
        print(f"Nothing to submit: no {'other ' * bool(lacking)}batch of the {options.tier} tier is missing.")
        return []
    jobs = dealt(batches, request.together) if request.cluster == "local" else [[one] for one in batches]
    where = "this machine" if request.cluster == "local" else "SLURM"
    asks = request.summary()
    print(
        f"{plural(len(batches), 'batch', 'batches')} of the {options.tier} tier in {plural(len(jobs), 'job')} on "
        f"{where}, at most {min(request.together, len(jobs))} at a time{asks and f', each with {asks}'}:"
    )
    cores = request.cpus or (usable_cores() if request.cluster == "local" else 1)
    for number, job in enumerate(jobs):
        for one in job:
            took = duration(one.cost.seconds(cores))
            print(f"  {number:3}  {one.job.label}: {plural(len(one.seeds), 'trial')}, about {took}")
    print(_cost([one.cost.seconds(cores) for one in batches], request, platform))
    return jobs


def _cost(seconds: Sequence[float], request: JobRequest, platform: str) -> str:
    each = f"{request.gpus} GPUs" if request.gpus > 1 else "a GPU" if platform == "gpu" else "a job"
    hours = max(sum(seconds) / 3600, 0.1)
    sentence = (
        f"About {hours:.1f} hours of {each}, by earlier trials, or by budgets where none has run on such a device."
    )
    if request.cluster == "slurm" and max(seconds) > request.minutes * 60:
        sentence += f" What is not done within {clock(request.minutes)} goes on in another job, from its checkpoint."
    return sentence


def dealt(batches: Sequence[MissingBatch], jobs: int) -> list[list[MissingBatch]]:
    """Deal batches, the longest first, each to the job that has least to do so far."""
    hands: list[list[MissingBatch]] = [[] for _ in range(min(jobs, len(batches)))]
    for one in batches:
        min(hands, key=lambda hand: sum(other.cost.seconds() for other in hand)).append(one)
    return hands


def _submitted(
    project: Project,
    options: argparse.Namespace,
    request: JobRequest,
    name: str,
    jobs: Sequence[Sequence[MissingBatch]],
    conditions: Mapping[Job, Condition],
) -> Submission:
    """Submit jobs.

    Raises:
        UserError: when submitit is not installed, or the cluster refuses.
    """
    root = project.store.root.absolute()
    if "%" in str(root):
        raise UserError(
            f"The name of the store's folder contains %, which SLURM would replace: {root}. Use a folder without %."
        )
    device = "gpu" if options.device == "auto" and request.gpus else options.device

    def command(batch: MissingBatch) -> list[str]:
        chosen = [batch.job.method, f"--on={batch.job.task}", f"--tier={options.tier}", f"--device={device}"]
        chosen += [f"--variant={options.variant}"] * bool(options.variant)
        chosen += [f"--trials={options.trials}"] * bool(options.trials)
        return [sys.executable, "-m", "evoclaims", "run", *chosen, f"--storage={root}"]

    folder = folder_of(root, name)
    limit = project.config.seconds(None)
    requeues = MOST_REQUEUES if math.isinf(limit) else min(math.ceil(limit / (60 * request.minutes)), MOST_REQUEUES)
    work = [BatchJob([command(one) for one in job], str(project.config.root.absolute())) for job in jobs]
    sent = _send(request, folder, requeues, work)
    made = tuple(
        SubmittedJob(id_, tuple(SubmittedBatch(*one.job.names, conditions[one.job].id) for one in job))
        for id_, job in zip(sent, jobs, strict=True)
    )
    here, trials = socket.gethostname(), options.trials or 0
    return Submission(SCHEMA, request.cluster, here, options.tier, made, options.variant, trials)


def _send(request: JobRequest, folder: Path, requeues: int, work: Sequence[BatchJob]) -> list[str]:
    """Hand jobs to submitit, and return their ids."""
    try:
        import submitit
    except ImportError as error:
        raise UserError(
            "Jobs are submitted by submitit, which is not installed. Install it: pip install 'evoclaims[slurm]'."
        ) from error
    timeouts = {f"{request.cluster}_max_num_timeout": requeues}
    settings: dict[str, Any] = {
        "name": JOB_NAME,
        "timeout_min": request.minutes,
        "gpus_per_node": request.gpus or None,
        "cpus_per_task": request.cpus or None,
        "stderr_to_stdout": True,
    }
    if request.cluster == "slurm":
        settings |= {
            "slurm_partition": request.partition or None,
            "slurm_array_parallelism": request.together,
            "slurm_setup": list(request.setup) or None,
            "slurm_signal_delay_s": min(SIGNAL_SECONDS, 15 * request.minutes),
            "slurm_additional_parameters": {"requeue": True, **request.more},  # after a node has failed
        }
    else:
        settings["local_setup"] = _setup_here(request)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ResourceWarning)  # local jobs outlive this process, and are meant to
            executor = submitit.AutoExecutor(folder=folder, cluster=request.cluster, **timeouts)
            executor.update_parameters(**settings)
            return [job.job_id for job in executor.submit_array(work)]
    except (RuntimeError, OSError) as error:
        if request.cluster == "slurm":  # nothing was submitted, since an array is one call
            shutil.rmtree(folder, ignore_errors=True)
        reason = " ".join(str(error).split())
        raise UserError(f"The jobs were not submitted: {reason or type(error).__name__}") from error


def _setup_here(request: JobRequest) -> list[str]:
    """Return the lines of shell that jobs of this machine begin with.

    They let go of the terminal, or of the pipe that would not end before them; and without --gpus they see the GPUs
    that this process sees, all of which submitit would hide.
    """
    lines = ["exec </dev/null >/dev/null 2>&1"]
    if not request.gpus:
        visible = os.environ.get("CUDA_VISIBLE_DEVICES")
        shown = "unset CUDA_VISIBLE_DEVICES"
        lines.append(shown if visible is None else f"export CUDA_VISIBLE_DEVICES={shlex.quote(visible)}")
    return lines


def _say_what_now(project: Project, options: argparse.Namespace, submission: Submission) -> None:
    """Print how to look at the jobs, and how to judge what they store."""
    first = submission.jobs[0].id.partition("_")[0]
    judge = f"pytest -m {options.tier} --claims-stored --claims-storage={shlex.quote(str(project.store.root))}"
    judge += f" --claims-variant={options.variant}" * bool(options.variant)
    counted = plural(len(submission.jobs), "job")
    print(f"Submitted {counted}, from {submission.jobs[0].id} on: `evoclaims jobs` shows them.")
    print(f"Afterwards `{judge}` judges what they have stored", end="")
    if submission.cluster == "slurm":
        print(f"; or as a job of its own: sbatch --dependency=afterany:{first} --wrap={shlex.quote(judge)}", end="")
    print(".", flush=True)
