"""Where a claim's trials come from: they are run when they are missing, or only read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from evoclaims.core.errors import UserError
from evoclaims.paper.archive import Archive
from evoclaims.trials import devices
from evoclaims.trials.notice import sweep
from evoclaims.trials.progress import Watcher
from evoclaims.trials.result import TrialResult
from evoclaims.trials.runner import run
from evoclaims.trials.spec import Condition, TrialSpec
from evoclaims.trials.store import Store


class NotStoredError(Exception):
    """Trials are missing and may not be run; ends a claim as "not run"."""


@dataclass(frozen=True)
class RunMissing:
    """Run what the store lacks.

    Attributes:
        store: where trials are kept.
        device: "auto", "cpu" or "gpu".
        watch: who is told.
        time_limit: seconds that a batch of trials may take.
        any_version: take a stored trial whatever versions it was made with; else one made with other versions than this
            environment's is run again.
        again: seeds that were run again for their versions, by the condition's id; filled in as trials are fetched.
    """

    store: Store
    device: str
    watch: Watcher
    time_limit: float = math.inf
    any_version: bool = False
    again: dict[str, set[int]] = field(default_factory=dict, compare=False)

    def check(self) -> None:
        """Find out before the first trial whether the store can be written and the device is there.

        A store with trials that cannot be written may have all that is asked for; where it does not, the first
        condition that lacks a trial says so.
        """
        try:
            self.store.check_writable()
        except UserError:
            self.store.check()
            if not self.store.ids():
                raise
        devices.choose(self.device)
        sweep(self.store.root)

    def __call__(self, condition: Condition, seeds: Sequence[int]) -> Sequence[TrialResult]:
        """Return one trial per seed."""
        chosen, again = devices.choose(self.device), set[int]()
        if not self.any_version:
            again = {seed for seed in seeds if self._is_outdated(TrialSpec(condition, seed))}
        results = run(
            condition,
            seeds,
            self.store,
            chosen,
            self.watch,
            time_limit=self.time_limit,
            any_version=self.any_version,
        )
        if again:
            self.again.setdefault(condition.id, set()).update(again)
        return results

    def _is_outdated(self, spec: TrialSpec) -> bool:
        """Whether every record of a trial was made with other versions than this environment's."""
        versions = spec.condition.versions
        if self.store.record_path(spec.id, versions).exists():  # without reading it: the usual case
            return False
        return bool(self.store.others(spec.id, versions)) and self.store.made_with(spec.id, versions) is None


@dataclass(frozen=True)
class StoredOnly:
    """Read the trials at hand and run nothing."""

    archive: Archive

    def check(self) -> None:
        """What is no store cannot be read."""
        self.archive.store.check()

    def __call__(self, condition: Condition, seeds: Sequence[int]) -> Sequence[TrialResult]:
        """Return one trial per seed, or raise `NotStoredError`."""
        results = [result for result in self.archive.trials(condition, seeds) if result is not None]
        if len(results) < len(seeds):
            raise NotStoredError(f"{len(seeds) - len(results)} of {len(seeds)} trials of {condition.label} are missing")
        return results
