"""A null agent: trials of something that has learnt nothing, to which a paper's assertions are put."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from evoclaims.core.errors import UserError
from evoclaims.trials.spec import Condition

Numbers = Mapping[str, Mapping[str, Any]]
"""What a record has in each of its parts (metrics, levels, curves), by name."""


@dataclass(frozen=True)
class NullAgent:
    """Something that has not learnt what claims are about, such as a robot that takes no action.

    An assertion that its trials satisfy is vacuous. It has numbers of its own, or the trials of a method.

    Attributes:
        says: what it is, in a few words.
        numbers: returns the numbers of its trials of a condition; None where it cannot stand for one.
        method: a method of the same tier whose committed trials on the same task are its trials.
        everywhere: it stands for every condition of an assertion at once, as a counter at its limit does; else also for
            the claimed ones alone (see `claims.null_agents`).

    Raises:
        UserError: when it has both or neither.
    """

    says: str
    numbers: Callable[[Condition], Numbers | None] | None = None
    method: str = ""
    everywhere: bool = False

    def __post_init__(self) -> None:
        """Check that it has trials of one kind."""
        if (self.numbers is None) == (not self.method):
            raise UserError(f"The null agent {self.says!r} needs either numbers=... or method=..., and not both.")
