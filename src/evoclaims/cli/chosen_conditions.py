"""The conditions that a command's options name: a tier's, or what a variant changes, by method and task."""

from __future__ import annotations

import argparse

from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.paper.reproduction import Reproduction, Tier
from evoclaims.paper.variant import Names


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
