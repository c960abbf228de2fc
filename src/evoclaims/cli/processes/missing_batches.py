"""The batches of trials that a store lacks, longest first: what several processes, or a cluster, have to run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from evoclaims.cli.processes.job import Job
from evoclaims.cli.project import Project
from evoclaims.paper.estimates import Estimate, Missing, committed, estimates
from evoclaims.paper.variant import Names
from evoclaims.trials.batches import StoredTrials
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition


@dataclass(frozen=True)
class MissingBatch:
    """The missing trials of one condition: no two processes run trials of one condition at a time."""

    job: Job
    seeds: tuple[int, ...]
    estimate: Estimate


def missing_batches(
    project: Project, tier: str, wanted: Mapping[Job, Condition], seeds: Sequence[int], limit: float, platform: str
) -> list[MissingBatch]:
    """List the batches of these conditions and seeds that the store lacks, the longest first.

    Args:
        project: has store and reference trials.
        tier: whose reference trials say how long a condition takes, those of other tiers after them.
        wanted: the conditions.
        seeds: of each condition.
        limit: seconds that a batch may take; trials that ran out of less time are missing, too.
        platform: where they will run: "cpu" or "gpu".
    """
    owed: dict[Job, tuple[int, ...]] = {}
    known: dict[Job, Missing] = {}
    reference: dict[Names, tuple[TrialResult, ...]] = {}
    for job, condition in wanted.items():
        if condition.existing is not None:
            continue
        owed[job] = tuple(StoredTrials(project.store, condition, time_limit=limit).missing(seeds))
        if owed[job]:
            earlier = list(StoredTrials(project.store, condition, any_version=True).sound(seeds))
            if job.names not in reference:  # a condition may have many faults
                reference[job.names] = committed(project.reproduction, tier, *job.names)
            known[job] = Missing(condition, len(owed[job]), [*earlier, *reference[job.names]])
    batches = [MissingBatch(job, owed[job], found) for job, found in estimates(known, platform).items()]
    return sorted(batches, key=lambda batch: -batch.estimate.seconds())
