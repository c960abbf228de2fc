"""The conditions that a command runs, sound or with a fault planted, and their missing batches, longest first."""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from evoclaims.cli.project import Project
from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.mutants.mutant import Planted
from evoclaims.paper.cost import Cost, Estimator, Wanted
from evoclaims.paper.reproduction import Conditions, Names, Reproduction, Tier
from evoclaims.trials.spec import Condition


@dataclass(frozen=True)
class Job:
    """One condition that a command runs: sound, or with a fault planted.

    Attributes:
        fault: name of what is planted, such as "cma_es: minimizes"; empty for the sound condition.
        method, task: its names.
    """

    fault: str
    method: str
    task: str

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


def choose(reproduction: Reproduction, options: argparse.Namespace) -> tuple[Tier, list[Names]]:
    """Return the tier that options name, and which of its conditions they select; of a variant, what it changes.

    Raises:
        UserError: for an unknown name, and for conditions that the variant leaves as they are; it lists the known ones.
    """
    tier = reproduction.tier(options.tier, options.variant)
    chosen = named(tier, options.method, options.on)
    if not options.variant:
        return tier, chosen
    touched = reproduction.changed_by(options.variant, options.tier)
    chosen = [names for names in chosen if names in touched]
    if not chosen:
        raise UserError(
            f"The variant {options.variant} changes none of these conditions at the {options.tier} tier; it changes: "
            f"{', '.join(sorted(' on '.join(names) for names in touched)) or 'none'}."
        )
    return tier, chosen


def named(tier: Tier, method: str | None, task: str | None) -> list[Names]:
    """Return the conditions that a method and a task select; an error for an unknown name lists the known ones.

    An `optional` method, which needs packages that may not be installed, runs only when it is named.
    """
    if method is not None and task is not None:
        tier.condition(method, task)
    known = list(tier.conditions)
    for name, position, kind in ((method, 0, "method"), (task, 1, "task")):
        if name is not None and name not in {names[position] for names in known}:
            raise UnknownNameError(kind, name, {names[position] for names in known})
    if method is None:
        known = [names for names in known if not getattr(tier.conditions[names].method, "optional", False)]
    return [names for names in known if method in (None, names[0]) and task in (None, names[1])]
