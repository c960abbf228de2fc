"""The conditions that are run to try mutants: those of a tier, with one fault planted at a time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from evoclaims.mutants.mutant import Mutant
from evoclaims.paper.variant import Conditions, Names
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
