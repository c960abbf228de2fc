"""A condition that a command runs, sound or with a fault planted, and which of them one process runs."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from evoclaims.mutants.conditions import Planted
from evoclaims.paper.variant import Conditions, Names
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
