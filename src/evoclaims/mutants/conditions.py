"""The conditions that are run to try mutants: those of a tier, with one fault planted at a time."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from evoclaims.mutants.mutant import Mutant
from evoclaims.paper.variant import Conditions, Names
from evoclaims.trials.spec import Condition
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.mutation_matrix import Part


@dataclass(frozen=True)
class Planted:
    """A fault in one method, or one task, of a tier, with the faulty conditions."""

    mutant: str
    part: Part
    target: str
    conditions: Conditions

    @property
    def name(self) -> str:
        """A name such as "cma_es: minimizes"."""
        return f"{self.target}: {self.mutant}"

    def touching(self, report: ClaimReport) -> tuple[Names, ...]:
        """Return the faulty conditions that a claim is about, by the names under which it asks for them."""
        asked = {(source.method, source.task) for source in report.sources}
        return tuple(names for names in self.conditions if names in asked)


def plantings(sound: Conditions, mutants: Mapping[str, Mutant]) -> tuple[Planted, ...]:
    """Return every fault in every method or task that it can be planted in."""
    return tuple(
        Planted(name, mutant.part, target, mutant.conditions(sound, target))
        for name, mutant in mutants.items()
        for target in mutant.targets(sound)
    )


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
