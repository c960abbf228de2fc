"""Where a claim's trials come from: missing ones are run, or stored ones are only read."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from evoclaims.core.errors import UserError
from evoclaims.paper.archive import Archive
from evoclaims.trials import devices
from evoclaims.trials.lease import sweep
from evoclaims.trials.progress import Watcher
from evoclaims.trials.result import TrialResult
from evoclaims.trials.runner import run
from evoclaims.trials.spec import Condition, TrialSpec
from evoclaims.trials.store import DamagedFileError, Store


class NotStoredError(Exception):
    """Trials are missing and may not be run; the claim is then "not run"."""

    def __init__(self, reason: str, condition: str = "") -> None:
        """Say why; `condition` is the id of that whose trials are missing, which readers name before the reason."""
        super().__init__(reason)
        self.condition = condition


def more_for_drift(
    known: Mapping[str, range], condition: str, seeds: Sequence[int], time_limit: float, platform: str
) -> Sequence[int]:
    """Return the seeds for the drift check that follow on `seeds`, the last that claims read.

    None under a time limit of minutes, which they would use up, and none but on CPUs, where a trial has the same bits
    in any batch.

    Args:
        known: these seeds, by the condition's id.
        condition: its id.
        seeds: that are asked for.
        time_limit: seconds that a batch of trials may take.
        platform: where they will run: "cpu" or "gpu".
    """
    more = known.get(condition, range(0))
    if not more or more[0] - 1 not in seeds or not _has_time(time_limit, platform):
        return ()
    return [seed for seed in more if seed not in seeds]


def _has_time(time_limit: float, platform: str) -> bool:
    """Whether trials that no claim reads are made; their bits must not depend on what else is in a batch."""
    return time_limit >= 3600 and platform == "cpu"


@dataclass(frozen=True)
class RunMissing:
    """Run what the store lacks.

    Attributes:
        store: where trials are kept.
        device: "auto", "cpu" or "gpu".
        watch: receives the progress.
        time_limit: seconds that a batch of trials may take.
        any_version: accept a stored trial made with any versions; else one made with versions other than this
            environment's is run again.
        wait: waits until other processes have run the trials that they run ahead.
        again: seeds run again because of their versions, by the condition's id; filled in as trials are fetched.
        for_drift: seeds of more trials, by the condition's id, that only the drift check reads; each is made once, with
            the claims' own (see `more`).
        unmade: why those of a condition could not be made, by its id; filled in as trials are fetched.
    """

    store: Store
    device: str
    watch: Watcher
    time_limit: float = math.inf
    any_version: bool = False
    wait: Callable[[Condition, Sequence[int]], None] = lambda condition, seeds: None
    again: dict[str, set[int]] = field(default_factory=dict, compare=False)
    for_drift: Mapping[str, range] = field(default_factory=dict, compare=False)
    unmade: dict[str, str] = field(default_factory=dict, init=False, compare=False)
    _made: set[str] = field(default_factory=set, init=False, compare=False, repr=False)

    def check(self) -> None:
        """Check before the first trial that the store can be written and the device exists.

        A read-only store with trials passes, since it may hold all that is needed; if not, the first condition that
        lacks a trial raises the error.
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
        self.note_outdated(condition, seeds)
        more = () if condition.id in self._made else self.more(condition, seeds)
        if more:
            self._made.add(condition.id)
            try:
                return [result for result in self._results(condition, [*seeds, *more]) if result.seed not in more]
            except UserError as error:  # in a store that cannot be written, say: the claims' own may all be there
                results = self._results(condition, seeds)
                if not isinstance(error, DamagedFileError):  # the drift check itself reads that file
                    self.unmade[condition.id] = str(error)
                return results
        return self._results(condition, seeds)

    def _results(self, condition: Condition, seeds: Sequence[int]) -> Sequence[TrialResult]:
        chosen = devices.choose(self.device)
        self.wait(condition, seeds)
        return run(
            condition,
            seeds,
            self.store,
            chosen,
            self.watch,
            time_limit=self.time_limit,
            any_version=self.any_version,
        )

    @property
    def has_time_for_drift(self) -> bool:
        """Whether trials are made that only the drift check reads."""
        return _has_time(self.time_limit, devices.choose(self.device)[0].platform)

    def more(self, condition: Condition, seeds: Sequence[int]) -> Sequence[int]:
        """Return the seeds for the drift check that are made with `seeds` (see `more_for_drift`)."""
        platform = devices.choose(self.device)[0].platform
        return more_for_drift(self.for_drift, condition.id, seeds, self.time_limit, platform)

    def note_outdated(self, condition: Condition, seeds: Sequence[int]) -> None:
        """Note which trials are about to be run again because of their versions."""
        again = {seed for seed in seeds if not self.any_version and self._is_outdated(TrialSpec(condition, seed))}
        if again:
            self.again.setdefault(condition.id, set()).update(again)

    def _is_outdated(self, spec: TrialSpec) -> bool:
        """Whether every record of a trial was made with versions other than this environment's."""
        versions = spec.condition.versions
        if os.path.exists(self.store.record_path(spec.id, versions)):  # without reading it: the usual case
            return False
        return bool(self.store.others(spec.id, versions)) and self.store.made_with(spec.id, versions) is None


@dataclass(frozen=True)
class StoredOnly:
    """Read the trials at hand and run nothing; each is read once, since many assertions ask for the same ones.

    Attributes:
        archive: where they are.
        known: what has been read, by the condition's id and the seed; filled in as trials are fetched.
    """

    archive: Archive
    known: dict[str, dict[int, TrialResult]] = field(default_factory=dict, compare=False, repr=False)

    def check(self) -> None:
        """Check that the store and the committed reference trials can be read."""
        self.archive.check()

    def __call__(self, condition: Condition, seeds: Sequence[int]) -> Sequence[TrialResult]:
        """Return one trial per seed, or raise `NotStoredError`."""
        known = self.known.setdefault(condition.id, {})
        new = [seed for seed in seeds if seed not in known]
        found = zip(new, self.archive.trials(condition, new), strict=True)
        known.update((seed, result) for seed, result in found if result is not None)
        results = [known[seed] for seed in seeds if seed in known]
        if len(results) < len(seeds):
            lacking = f"{len(seeds) - len(results)} of {len(seeds)} trials are missing"
            raise NotStoredError(lacking, condition.id)
        return results
