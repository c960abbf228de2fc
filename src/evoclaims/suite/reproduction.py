"""What a paper's reproduction consists of: which trials each tier runs, and how many decide."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from evoclaims.core.errors import UnknownNameError
from evoclaims.judging.protocol import Protocol
from evoclaims.trials.spec import Condition


@dataclass(frozen=True)
class Tier:
    """One size at which the paper's claims are run.

    Attributes:
        conditions: by method and task, as claims name them: `{("ppo", "n_parity"): Condition(...)}`.
        protocol: how many trials are looked at, with which error rates.
    """

    conditions: Mapping[tuple[str, str], Condition]
    protocol: Protocol

    def condition(self, method: str, task: str) -> Condition:
        """Return the condition of a method on a task; an `UnknownNameError` lists the known ones."""
        methods = {m for m, _ in self.conditions}
        if method not in methods:
            raise UnknownNameError("method", method, methods)
        tasks = {t for m, t in self.conditions if m == method}
        if task not in tasks:
            raise UnknownNameError(f"task for {method}", task, tasks)
        return self.conditions[method, task]


@dataclass(frozen=True)
class Reproduction:
    """A paper under test.

    Attributes:
        name: a short name, such as "nisioti2025".
        title: the paper's title.
        folder: where the reproduction lies; its reference trials are in folder/reference.
        tiers: by name; "smoke" and "full".
    """

    name: str
    title: str
    folder: Path
    tiers: Mapping[str, Tier]

    def tier(self, name: str) -> Tier:
        """Return a tier; an `UnknownNameError` lists the known ones."""
        if name not in self.tiers:
            raise UnknownNameError("tier", name, self.tiers)
        return self.tiers[name]

    @property
    def references(self) -> Path:
        """The folder of committed reference trials."""
        return self.folder / "reference"
