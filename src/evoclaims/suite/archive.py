"""All trials at hand: those of the store, and the committed reference trials of a reproduction."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from evoclaims.suite import references
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition, TrialSpec
from evoclaims.trials.store import Store
from evoclaims.trials.time_limit import is_final


@dataclass(frozen=True)
class Archive:
    """Trials by id, wherever they are kept; a trial's id is the hash of its specification, so either copy will do.

    Attributes:
        store: looked into first; what ran out of time there may still be among the reference trials.
        references: folder of the committed reference trials; None for none.
    """

    store: Store
    references: Path | None = None

    def get(self, trial: str) -> TrialResult | None:
        """Return the trial with this id, or None.

        Raises:
            UserError: when its record, or a file of reference trials, is torn or edited.
        """
        found = self.store.get(trial)
        return found if is_final(found) else self._committed.get(trial, found)

    def trials(self, condition: Condition, seeds: Sequence[int]) -> tuple[TrialResult | None, ...]:
        """Return a condition's trial for each seed, None where there is none."""
        return tuple(self.get(TrialSpec(condition, seed).id) for seed in seeds)

    @cached_property
    def _committed(self) -> dict[str, TrialResult]:
        """Reference trials by id."""
        return {trial.id: trial for trial in self._read()}

    def _read(self) -> Iterator[TrialResult]:
        """Read every file of reference trials."""
        for path in sorted(self.references.rglob("*.jsonl")) if self.references is not None else ():
            yield from references.load(path)
