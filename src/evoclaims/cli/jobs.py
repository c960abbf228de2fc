"""`evoclaims jobs`: what has become of the jobs that were submitted for this store."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from evoclaims.cli.project import Project, open_project
from evoclaims.cluster.submissions import (
    GONE,
    Seen,
    State,
    Submission,
    SubmittedBatch,
    SubmittedJob,
    load_all,
    log_of,
    states,
)
from evoclaims.core.errors import UserError
from evoclaims.core.files import open_file
from evoclaims.trials.batches import StoredTrials
from evoclaims.trials.lease import is_announced

TAIL: Final = 20_000
"""Bytes at the end of a log in which a reason is looked for."""


class Place(NamedTuple):
    """Where a batch was submitted last: the submission with its name, and of it the job and the batch."""

    name: str
    submission: Submission
    job: SubmittedJob
    batch: SubmittedBatch


def main(options: argparse.Namespace) -> int:
    """List the batches that were submitted, each where it was submitted last; 1 when one has failed."""
    project = open_project(options.storage)
    rows = list(_rows(project))
    if not rows:
        print(f"No job was submitted for {project.store.root}: `evoclaims submit{project.store.option}` does.")
        return 0
    for place, state, reason, log in rows:
        more = f": {reason}" * bool(reason) + f" ({log})" * log.exists()
        print(f"{state:8} {place.job.id}  {place.batch.label}, {place.submission.tier_and_variant}{more}")
    known = ("queued", "running", "ended", "done", "failed")
    counts = {name: sum(state == name for _, state, *_ in rows) for name in known}
    print(", ".join(f"{count} {state}" for state, count in counts.items() if count))
    if counts["failed"]:
        asked = any(state == "failed" and place.submission.trials for place, state, *_ in rows)
        same = f"{project.store.option}`{', with the same --trials,' * asked}"
        print(f"`evoclaims submit{same} submits what has failed again; it goes on from its checkpoints.")
    return int(counts["failed"] > 0)


def active(project: Project) -> dict[str, str]:
    """Return the conditions whose batch is queued or running, with a sentence that says so."""
    return {
        place.batch.condition: f"{state} already, as job {place.job.id}"
        for place, state, *_ in _rows(project)
        if state in ("queued", "running")
    }


def _rows(project: Project) -> Iterator[tuple[Place, str, str, Path]]:
    """Yield of each batch its place, its state, such as "queued" or "failed", why, if that is known, and its output."""
    latest: dict[tuple[str, str, str], Place] = {}  # two tiers may share a condition, and look at other seeds of it
    for name, submission in load_all(project.store.root).items():
        for job in submission.jobs:
            for batch in job.batches:
                key = submission.tier, submission.variant, batch.condition
                latest[key] = Place(name, submission, job, batch)
    owed = {key for key, place in latest.items() if _lacks(project, place) is not False}
    seen: dict[tuple[str, str], Seen] = {}
    for name, submission in {place.name: place.submission for place in latest.values()}.items():
        asked = {place.job.id for key, place in latest.items() if place.name == name and key in owed}
        if asked:
            seen |= {(name, job): one for job, one in states(submission, asked).items()}
    for key, place in latest.items():
        log, found = log_of(project.store.root, place.name, place.job), seen.get((place.name, place.job.id), GONE)
        lacks = _lacks(project, place) if key in owed else False
        if lacks is False and (key not in owed or found.state is State.ENDED):  # it may have ended meanwhile
            yield place, "done", _timeouts(project, place), log
        elif lacks is None and found.state is State.ENDED:
            yield place, "ended", "the paper has no such condition any more: it was edited or taken out", log
        else:
            yield place, *_state_and_reason(project, place, found, log), log


def _asked(project: Project, place: Place) -> tuple[StoredTrials, Sequence[int]] | None:
    """Return the stored trials of a batch, and the seeds that it is to have; None if the paper no longer has it."""
    try:
        tier = project.reproduction.tier(place.submission.tier, place.submission.variant)
        condition = tier.condition(place.batch.method, place.batch.task)
    except UserError:
        return None
    if condition.id != place.batch.condition:
        return None
    stored = StoredTrials(project.store, condition, time_limit=project.config.seconds(None))
    return stored, tier.design.seeds(place.submission.trials or tier.design.last.n)


def _lacks(project: Project, place: Place) -> bool | None:
    """Whether trials of a batch are missing; None if the paper no longer has it, so that nobody knows."""
    asked = _asked(project, place)
    return bool(asked[0].missing(asked[1])) if asked else None


def _timeouts(project: Project, place: Place) -> str:
    """Say how many trials of a batch ran out of time, which decide nothing."""
    asked = _asked(project, place)
    ends = [trial.status for trial in asked[0].sound(asked[1])] if asked else []
    late = ends.count("timeout")
    return f"{late} of {len(ends)} trials ran out of time (evoclaims run --retry goes on with them)" if late else ""


def _state_and_reason(project: Project, place: Place, seen: Seen, log: Path) -> tuple[str, str]:
    if seen.state is State.ENDED:
        words = "; ".join(filter(None, [seen.reason, last_words(log)]))
        gone = "it is no longer queued and has printed nothing" if seen == GONE else "it ended without a word"
        return "failed", words or gone
    elsewhere = len(place.job.batches) > 1 and not is_announced(project.store.root, place.batch.condition)
    if seen.state is State.RUNNING and elsewhere:
        return "queued", f"{seen.reason} runs other batches now"
    return str(seen.state), seen.reason


def last_words(log: Path) -> str:
    """Return evoclaims' last sentence in a job's output, else its last line; empty without any."""
    try:
        with open_file(log) as file:
            file.seek(max(0, file.seek(0, os.SEEK_END) - TAIL))
            lines = file.read().decode(errors="replace").splitlines()
    except OSError:
        return ""
    ours = [line for line in lines if line.startswith("evoclaims: ")]
    printed = [line for line in lines if line.strip()]
    return ours[-1].removeprefix("evoclaims: ") if ours else printed[-1].strip() if printed else ""
