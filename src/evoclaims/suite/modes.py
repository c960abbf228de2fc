"""How a claim's trials are had: by running them, or from the store alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from evoclaims.core.errors import UserError
from evoclaims.suite.archive import Archive
from evoclaims.trials import devices
from evoclaims.trials.notice import sweep
from evoclaims.trials.progress import Watcher
from evoclaims.trials.result import TrialResult
from evoclaims.trials.runner import run
from evoclaims.trials.spec import Condition
from evoclaims.trials.store import Store


class NotStoredError(Exception):
    """Trials are missing and may not be run; ends a claim as "not run"."""


@dataclass(frozen=True)
class RunMissing:
    """Run what the store lacks.

    Attributes:
        device: "auto", "cpu" or "gpu".
        time_limit: seconds that a batch of trials may take.
    """

    store: Store
    device: str
    watch: Watcher
    time_limit: float = math.inf

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
        chosen = devices.choose(self.device)
        return run(condition, seeds, self.store, chosen, self.watch, time_limit=self.time_limit)


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
