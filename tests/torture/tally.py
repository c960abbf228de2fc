"""What an attack has done, and what it has found."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field


@dataclass
class Tally:
    """One attack's row in the table.

    Attributes:
        attack: what was done, in words.
        done: how often, by what.
        violations: what must not be, one sentence each.
        notes: what a reader should know, such as what this machine does not allow.
    """

    attack: str
    done: Counter[str] = field(default_factory=Counter)
    violations: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def demand(self, fact: bool, otherwise: str) -> None:
        """Note a violation unless something holds."""
        if not fact:
            self.violations.append(otherwise)

    def __str__(self) -> str:
        did = ", ".join(f"{count} {what}" for what, count in self.done.items()) or "nothing"
        lines = [f"{self.attack}: {did}; {len(self.violations)} violations"]
        return "\n  ".join([*lines, *(f"note: {note}" for note in self.notes), *self.violations])
