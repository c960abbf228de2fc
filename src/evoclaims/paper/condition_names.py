"""The names that a reproduction has for the conditions of stored trials."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from evoclaims.paper.reproduction import Reproduction
from evoclaims.trials.spec import Condition


@dataclass(frozen=True)
class Name:
    """A name of a condition.

    Attributes:
        tier: "smoke" or "full".
        variant: its name; empty for the protocol itself.
        method, task: as claims name them.
    """

    tier: str
    variant: str
    method: str
    task: str


def names_of(reproduction: Reproduction) -> dict[str, tuple[Name, ...]]:
    """Return the names of every condition by its id; several if tiers or methods share it.

    A variant names only conditions that the protocol itself does not have; shared ones keep the protocol's name.
    """
    found: dict[str, tuple[Name, ...]] = {}

    def note(tier: str, variant: str, conditions: Mapping[tuple[str, str], Condition]) -> None:
        for (method, task), condition in conditions.items():
            found[condition.id] = (*found.get(condition.id, ()), Name(tier, variant, method, task))

    for tier, plan in reproduction.tiers.items():
        note(tier, "", plan.conditions)
    plain = set(found)
    for variant, changes in reproduction.variants.items():
        for tier, conditions in changes.conditions.items():
            note(tier, variant, {names: one for names, one in conditions.items() if one.id not in plain})
    return found
