"""Named variants of the protocol: where paper and published code differ, or the paper says too little."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from evoclaims.trials.spec import Condition

Names = tuple[str, str]
"""A method and a task, as claims name them."""

Conditions = Mapping[Names, Condition]


@dataclass(frozen=True)
class Variant:
    """The same claims, judged from trials that differ in one detail.

    Attributes:
        says: the detail, in a sentence.
        conditions: by tier, the conditions that the detail changes; all others stay as they are.
    """

    says: str
    conditions: Mapping[str, Conditions]


def changed(conditions: Conditions, change: Callable[[str, str, Condition], Any]) -> dict[Names, Condition]:
    """Return the new conditions where `change(method, task, condition)` returns a different one.

    `change` returns a condition, or None where the detail does not matter.
    """
    found = {names: change(*names, condition) for names, condition in conditions.items()}
    return {names: new for names, new in found.items() if new is not None and new.id != conditions[names].id}
