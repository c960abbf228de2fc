"""What trials cost: how long missing ones will take, by earlier ones, and what committed ones have taken.

Every estimate of the program is made here: for the order of a run, the time that is left, a plan, a job.
"""

from __future__ import annotations

import itertools
import math
import statistics
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from typing import Final, Literal, TypeVar

import jax
import numpy as np

from evoclaims.core.errors import UserError
from evoclaims.core.provenance import machine_class
from evoclaims.paper import references
from evoclaims.paper.reproduction import Names, Reproduction
from evoclaims.trials.batches import StoredTrials
from evoclaims.trials.devices import usable_cores
from evoclaims.trials.lanes import Lanes
from evoclaims.trials.layout import Layout, layout_on
from evoclaims.trials.result import COMPLETE, TrialResult
from evoclaims.trials.spec import Condition
from evoclaims.trials.store import Store

Key = TypeVar("Key")

Basis = Literal["here", "elsewhere", "budget"]
"""What an estimate is by: trials of this machine, or of others that were compared with it; of others; no trial."""

Committed = Callable[[tuple[str, ...], str, str], tuple[TrialResult, ...]]
"""Reads the committed trials of tiers, a method and a task."""

COMPILE_SECONDS: Final = 10.0
"""To compile a condition, where nothing is known: between a gate's and a robot's, on a processor."""

STEP_SECONDS: Final = 1e-5
"""An environment step, where no trial of any condition has run: it orders budgets and no more."""


SEEDS_LOOKED_AT: Final = 10
"""Stored trials of the first seeds say how long others take, whichever are asked for."""


@dataclass(frozen=True)
class Batch:
    """Trials that ran together, as their records say.

    Attributes:
        trials: at least one, each once.
        compile, run: seconds, until the last trial had ended.
        layout: of the trials on their devices.
        processor: seconds of a processor's cores that running took; None where the records do not say.
    """

    trials: Sequence[TrialResult]
    compile: float
    run: float
    layout: Layout
    processor: float | None

    def work(self, condition: Condition, trials: int) -> float:
        """Return seconds of running for so many trials of a condition: of one core if each is a call of its own.

        Trials of the batch's own condition end as these did; those of another one spend their whole budgets.
        """
        same = self.trials[0].condition == condition.id
        steps = [max(float(trial.metrics.get("environment_steps", 0.0)), 1.0) for trial in self.trials]
        calls, wanted = self.layout.calls(len(steps)), self.layout.calls(trials)
        used = self.processor or self.run * min(usable_cores(), calls)  # not recorded: as if here
        longest = sorted(steps)[-calls:]  # trials of one call take as long as the longest
        return used * wanted / calls if same else used / sum(longest) * condition.environment_steps * wanted


@dataclass(frozen=True)
class Cost:
    """How long a batch of trials takes.

    Attributes:
        compile: seconds.
        work: seconds of running: of one core if each trial is a call of its own, else of the device.
        trials: how many.
        layout: of the trials on their devices.
        basis: what it is estimated by.
    """

    compile: float
    work: float
    trials: int
    layout: Layout
    basis: Basis = "here"

    def seconds(self, cores: int = 1) -> float:
        """Return the time that the batch takes in a process with so many cores."""
        return self.compile + self.work / min(self.layout.calls(self.trials), cores)


@dataclass(frozen=True)
class Wanted:
    """Trials of a condition that a run asks for, under the names by which claims ask for it."""

    names: Names
    condition: Condition
    seeds: Sequence[int]


@dataclass(frozen=True)
class Owed:
    """The seeds of wanted trials that must be run, and what they cost; or what all cost where none is missing."""

    seeds: tuple[int, ...]
    cost: Cost


@dataclass(frozen=True)
class Estimator:
    """Estimates by the trials of a store and the committed ones.

    Attributes:
        store: where trials are kept.
        reproduction: has the committed trials.
        tier: whose committed trials come before those of other tiers.
        platform: where the missing trials will run: "cpu" or "gpu".
        kind: of device, such as "NVIDIA H200": only trials that were made on such devices count; empty for any.
        time_limit: seconds that a batch may take; trials that ran out of less time are missing, too.
        any_version: accept stored trials made with any versions.
    """

    store: Store
    reproduction: Reproduction
    tier: str
    platform: str
    kind: str = ""
    time_limit: float = math.inf
    any_version: bool = False

    def owed(self, wanted: Mapping[Key, Wanted]) -> dict[Key, Owed]:
        """Return what is missing of each condition, and its cost.

        Trials of this machine come first, then those of others, by how much longer conditions take here where that is
        known. Trials of another condition of the same names count by their pace, and what has never run on such a
        device by its budget, at the median pace of the others: of the same method's, if any of these has run.
        """
        layout = layout_on(self.platform)
        lacking = {
            key: tuple(StoredTrials(self.store, one.condition, self.any_version, self.time_limit).missing(one.seeds))
            for key, one in wanted.items()
        }
        counts = {key: len(lacking[key]) or len(one.seeds) for key, one in wanted.items()}
        read = cache(self._committed)  # many conditions may have the same names: faults planted in one
        found = {key: self._by_earlier(one, counts[key], read) for key, one in wanted.items()}
        both = [(one.here.seconds(), one.elsewhere.seconds()) for one in found.values() if one.here and one.elsewhere]
        scale = sum(here for here, _ in both) / sum(there for _, there in both) if both else None
        known = {key: one.at(scale) for key, one in found.items()}
        steps = {key: one.condition.environment_steps * layout.calls(counts[key]) for key, one in wanted.items()}
        paces = [(wanted[key].names[0], one.work / max(steps[key], 1)) for key, one in known.items() if one]
        compiling = statistics.median(one.compile for one in known.values() if one) if paces else COMPILE_SECONDS

        def unknown(key: Key) -> Cost:
            own = [pace for method, pace in paces if method == wanted[key].names[0]]
            pace = statistics.median(own or [pace for _, pace in paces] or [STEP_SECONDS])
            return Cost(compiling, pace * steps[key], counts[key], layout, "budget")

        return {key: Owed(lacking[key], one or unknown(key)) for key, one in known.items()}

    def _by_earlier(self, one: Wanted, trials: int, read: Committed) -> _Known:
        """Return what so many trials cost by earlier ones: of the condition itself, or else of its names."""
        mine = machine_class()
        for earlier in self._earlier(one, read):
            sides: dict[bool, list[TrialResult]] = {True: [], False: []}
            for trial in earlier:
                if trial.status in COMPLETE and self._is_fitting(trial):
                    sides[trial.provenance.get("machine", mine) == mine].append(trial)
            here, elsewhere = (_best(by_batch(sides[side]), one.condition) for side in (True, False))
            if here or elsewhere:
                return _Known(
                    _cost(here, one.condition, trials, "here") if here else None,
                    _cost(elsewhere, one.condition, trials, "elsewhere") if elsewhere else None,
                )
        return _Known(None, None)

    def _earlier(self, one: Wanted, read: Committed) -> Iterator[Sequence[TrialResult]]:
        """Yield earlier trials: of the condition itself, then of its names, as long as the first say nothing."""
        seeds = sorted({*range(SEEDS_LOOKED_AT), *one.seeds})
        stored = StoredTrials(self.store, one.condition, any_version=True).sound(seeds)
        committed = (trial for trial in read((self.tier,), *one.names) if trial.condition == one.condition.id)
        yield [*stored, *committed]
        yield read(tuple(sorted(self.reproduction.tiers, key=lambda name: name != self.tier)), *one.names)

    def _committed(self, tiers: tuple[str, ...], method: str, task: str) -> tuple[TrialResult, ...]:
        """Return committed trials; none where a file cannot be read, which whoever compares with it reports."""
        with suppress(UserError):
            return of_names(self.reproduction, tiers, method, task)
        return ()

    def _is_fitting(self, trial: TrialResult) -> bool:
        device = trial.device
        return device.get("platform") == self.platform and self.kind in ("", device.get("kind"))


@dataclass(frozen=True)
class _Known:
    """The cost of trials by those that ran on this machine, and by those that ran on others."""

    here: Cost | None
    elsewhere: Cost | None

    def at(self, scale: float | None) -> Cost | None:
        """Return the better of both: by others only where there is no other, and slower by `scale` if that is known."""
        there = self.elsewhere
        if self.here or there is None or scale is None:
            return self.here or there
        return replace(there, compile=there.compile * scale, work=there.work * scale, basis="here")


def of_names(reproduction: Reproduction, tiers: Sequence[str], method: str, task: str) -> tuple[TrialResult, ...]:
    """Return the committed trials of a method on a task: the protocol's by `tiers`, then its variants'."""
    folders = map(reproduction.references_of, ("", *reproduction.variants))
    files = (references.committed(folder, name, method, task) for folder in folders for name in tiers)
    return tuple(itertools.chain.from_iterable(files))


def by_batch(trials: Iterable[TrialResult]) -> list[Batch]:
    """Return trials by batch, in the order of the first of each; a trial that is given twice counts once."""
    batches: dict[tuple[str, str], dict[str, TrialResult]] = defaultdict(dict)
    for trial in trials:
        batches[str(trial.timing["started"]), str(trial.device.get("kind"))][trial.id] = trial
    found = []
    for each in batches.values():
        together = list(each.values())
        compiling, running = (max(float(trial.timing[name]) for trial in together) for name in ("compile", "run"))
        layout = layout_on(str(together[0].device["platform"]))
        measured = [float(trial.timing["processor"]) for trial in together if "processor" in trial.timing]
        found.append(Batch(together, compiling, running, layout, max(measured, default=None)))
    return found


def took(trials: Iterable[TrialResult]) -> dict[str, float]:
    """Return the seconds of one accelerator that trials have taken, with compiling, by its kind; CPUs do not count."""
    seconds: dict[str, float] = defaultdict(float)
    for batch in by_batch(trial for trial in trials if trial.status == "done" and trial.device):
        if not batch.layout.alone:
            seconds[str(batch.trials[0].device["kind"])] += batch.run + batch.compile
    return dict(seconds)


def measured(condition: Condition, devices: Sequence[jax.Device], trials: int) -> Cost:
    """Compile, and time a few steps of one trial per core or device: what so many whole budgets would take."""
    lanes = Lanes(condition, devices)
    width = lanes.layout.threads(len(devices))
    state = lanes.start(list(range(width)), width)
    state, _ = lanes.advance(state, 1, width)
    until = min(4, condition.steps)
    began = time.perf_counter()
    _, report = lanes.advance(state, until, width)
    spent = time.perf_counter() - began
    per_step = spent / max(int(np.max(report.steps)) - 1, 1)
    return Cost(lanes.seconds, per_step * condition.steps * lanes.layout.calls(trials), trials, lanes.layout)


def _best(batches: Sequence[Batch], condition: Condition) -> Batch | None:
    """Return the largest batch of a condition; without one, of the first condition that there is."""
    same = [batch for batch in batches if batch.trials[0].condition == condition.id]
    return max(same or batches[:1], key=lambda batch: len(batch.trials), default=None)


def _cost(batch: Batch, condition: Condition, trials: int, basis: Basis) -> Cost:
    return Cost(batch.compile, batch.work(condition, trials), trials, batch.layout, basis)
