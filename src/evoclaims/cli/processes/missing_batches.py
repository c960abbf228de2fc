"""The batches of trials that a store lacks, longest first: what several processes, or a cluster, have to run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from evoclaims.cli.processes.job import Job
from evoclaims.cli.project import Project
from evoclaims.paper.cost import Cost, Estimator, Wanted
from evoclaims.trials.spec import Condition


@dataclass(frozen=True)
class MissingBatch:
    """The missing trials of one condition: no two processes run trials of one condition at a time."""

    job: Job
    seeds: tuple[int, ...]
    cost: Cost


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
    estimator = Estimator(project.store, project.reproduction, tier, platform, time_limit=limit)
    owed = estimator.owed({job: Wanted(job.names, condition, seeds) for job, condition in wanted.items()})
    batches = [MissingBatch(job, one.seeds, one.cost) for job, one in owed.items() if one.seeds]
    return sorted(batches, key=lambda batch: -batch.cost.seconds())
