"""How far a run of claims is: read from the store, whichever processes run its trials."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from evoclaims.claims.workload import Workload
from evoclaims.trials.devices import usable_cores
from evoclaims.trials.shared_progress import Running, running
from evoclaims.trials.store import DamagedFileError, Store


@dataclass(frozen=True)
class Overview:
    """How far a run of claims is.

    Attributes:
        judged: claims, of `claims`.
        done: trials in the store, of the `trials` that the claims need at most.
        running: the batches under way.
        seconds_left: about how long the run will still take; None without a timing from this machine.
    """

    judged: int
    claims: int
    done: int
    trials: int
    running: Sequence[Running]
    seconds_left: float | None


class Watching:
    """Looks now and then how far a run is."""

    def __init__(self, load: Workload, workers: int) -> None:
        """Begin with what was known before the run."""
        self._load = load
        self._workers = workers
        self._store = Store(Path(load.storage))
        self._waiting = set(load.claims)
        self._missing = {name: list(work.missing) for name, work in load.conditions.items()}
        share = max(usable_cores() // workers, 1)
        self._seconds = {name: work.cost.seconds(share) for name, work in load.conditions.items()}
        self._took: dict[str, float] = {}

    def judged(self, claim: str) -> None:
        """Note that a claim has been judged."""
        self._waiting.discard(claim)

    def look(self) -> Overview:
        """Look into the store."""
        conditions = self._load.conditions
        for name, files in self._missing.items():
            left = [file for file in files if not (self._store.root / file).exists()]
            if files and not left:
                self._learn(name)
            self._missing[name] = left
        owed = {name for claim in self._waiting for name in self._load.claims[claim] if self._missing[name]}
        done = sum(work.stored + len(work.missing) - len(self._missing[name]) for name, work in conditions.items())
        now = [self._named(one) for one in running(self._store.root)]
        return Overview(
            judged=len(self._load.claims) - len(self._waiting),
            claims=len(self._load.claims),
            done=done,
            trials=done + sum(len(self._missing[name]) for name in owed),
            running=now,
            seconds_left=self._seconds_left(owed, {one.condition: one for one in now}),
        )

    def _named(self, one: Running) -> Running:
        """Return a batch under the name that claims have for its condition."""
        work = self._load.conditions.get(one.condition)
        return one if work is None else replace(one, progress=replace(one.progress, condition=work.label))

    def _learn(self, name: str) -> None:
        """Note how long a condition took, whose last trial has been stored."""
        with suppress(DamagedFileError):
            record = self._store.read(self._store.root / self._load.conditions[name].missing[-1])
            if record is not None:
                self._took[name] = float(record.timing["compile"]) + float(record.timing["run"])

    def _seconds_left(self, owed: Iterable[str], now: Mapping[str, Running]) -> float | None:
        """Return how long the workers will still take; None if a missing condition has no timing.

        Timings of other machines count as soon as a condition that they are of has ended here.
        """
        bases = {name: work.cost.basis for name, work in self._load.conditions.items()}
        compared = [name for name in self._took if bases[name] == "elsewhere"]
        whole = sum(self._seconds[name] for name in compared)
        scale = {"here": 1.0, "elsewhere": sum(self._took[name] for name in compared) / whole if whole else None}
        left: list[float] = []
        for name in owed:
            one = remaining(self._seconds[name], scale.get(bases[name]), now.get(name))
            if one is None:
                return None
            left.append(one)
        return max(sum(left) / min(self._workers, len(left)), *left) if left else None


def remaining(seconds: float, scale: float | None, now: Running | None) -> float | None:
    """Return about how many seconds a condition will still take; None without a timing from this machine.

    Args:
        seconds: the estimate for the whole.
        scale: how many times as long it takes here; None while unknown.
        now: the batch, if it is running: its own speed is the best estimate.
    """
    if now is not None and now.progress.seconds_left is not None:
        return now.progress.seconds_left
    if scale is None:
        return None
    return seconds * scale if now is None else max(seconds * scale - (time.time() - now.since), 0.0)
