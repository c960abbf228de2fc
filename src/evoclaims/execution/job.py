"""The conditions that are to be run, sound or with a fault planted, and their missing batches, longest first."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from evoclaims.mutants.mutant import Planted
from evoclaims.paper.cost import Cost, Estimator, Wanted
from evoclaims.paper.reproduction import Conditions, Names, Reproduction
from evoclaims.trials.spec import Condition
from evoclaims.trials.store import Store


@dataclass(frozen=True)
class Job:
    """One condition that is to be run: sound, or with a fault planted.

    Attributes:
        fault: name of what is planted, such as "cma_es: minimizes"; empty for the sound condition.
        method, task: its names.
        seeds: if not those of the order.
    """

    fault: str
    method: str
    task: str
    seeds: tuple[int, ...] = ()

    @property
    def names(self) -> Names:
        """The names under which claims ask for the condition."""
        return self.method, self.task

    @property
    def label(self) -> str:
        """A name such as "cma_es on n_parity, cma_es: minimizes"."""
        return f"{self.method} on {self.task}" + f", {self.fault}" * bool(self.fault)


def jobs(sound: Conditions, planted: Sequence[Planted]) -> dict[Job, Condition]:
    """Return all sound and all faulty conditions."""
    found = {Job("", *names): condition for names, condition in sound.items()}
    return found | {Job(one.name, *names): condition for one in planted for names, condition in one.conditions.items()}


def sharing_programs(asked: Iterable[Job], sound: Conditions) -> list[list[Job]]:
    """Return conditions in groups that probably share compiled programs: the same fault in tasks of one kind and size.

    One process runs a group, so that no two compile the same program at the same time.
    """
    groups: dict[tuple[str, str], list[Job]] = defaultdict(list)
    for one in asked:
        groups[one.fault.rpartition(": ")[2], sound[one.names].programs].append(one)
    return list(groups.values())


@dataclass(frozen=True)
class MissingBatch:
    """The missing trials of one condition: no two processes run trials of one condition at a time."""

    job: Job
    seeds: tuple[int, ...]
    cost: Cost


def missing_batches(
    store: Store,
    reproduction: Reproduction,
    tier: str,
    wanted: Mapping[Job, Condition],
    seeds: Sequence[int],
    limit: float,
    platform: str,
) -> list[MissingBatch]:
    """List the batches of these conditions and seeds that the store lacks, the longest first.

    Args:
        store: where trials are kept.
        reproduction: has the reference trials.
        tier: whose reference trials say how long a condition takes, those of other tiers after them.
        wanted: the conditions.
        seeds: of each condition.
        limit: seconds that a batch may take; trials that ran out of less time are missing, too.
        platform: where they will run: "cpu" or "gpu".
    """
    estimator = Estimator(store, reproduction, tier, platform, time_limit=limit)
    owed = estimator.owed({job: Wanted(job.names, condition, seeds) for job, condition in wanted.items()})
    batches = [MissingBatch(job, one.seeds, one.cost) for job, one in owed.items() if one.seeds]
    return sorted(batches, key=lambda batch: -batch.cost.seconds())
