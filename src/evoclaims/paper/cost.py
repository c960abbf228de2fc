"""The cost of a condition on this machine, from earlier trials on such a device or from a few timed steps."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import jax
import numpy as np

from evoclaims.paper import references
from evoclaims.trials.devices import layout_on, usable_cores
from evoclaims.trials.lanes import Lanes
from evoclaims.trials.result import COMPLETE, TrialResult
from evoclaims.trials.spec import Condition, TrialSpec
from evoclaims.trials.store import Store
from evoclaims.trials.time_limit import is_final

SEEDS_LOOKED_AT = 64


@dataclass(frozen=True)
class Pace:
    """How fast a condition runs.

    Attributes:
        per_step: seconds per step: of one trial if each trial is a separate call, else of the whole batch.
        compile: seconds of compilation.
        layout: see `program.over_trials`.
    """

    per_step: float
    compile: float
    layout: str

    def seconds(self, condition: Condition, trials: int) -> float:
        """Return the time of `trials` trials that spend the whole budget."""
        return self.compile + self.per_step * condition.steps * (trials if self.layout == "alone" else 1)


def known_pace(
    condition: Condition,
    store: Store,
    folder: Path,
    tier: str,
    method: str,
    task: str,
    kind: str,
) -> Pace | None:
    """Return the pace of stored or reference trials of this condition on this kind of device, or None."""
    versions = condition.versions
    stored = (store.get(TrialSpec(condition, seed).id, versions) for seed in range(SEEDS_LOOKED_AT))
    trials = [trial for trial in stored if trial is not None and is_final(trial)]
    committed = references.committed(folder, tier, method, task)
    trials += [trial for trial in committed if trial.condition == condition.id]
    batch = _largest_batch(trial for trial in trials if trial.device.get("kind") == kind)
    if batch is None:
        return None
    steps = [trial.metrics["steps"] for trial in batch.trials]
    work = sum(steps) if batch.layout == "alone" else max(steps)
    return Pace(batch.run / max(work, 1), batch.compile, batch.layout)


@dataclass(frozen=True)
class RecordedBatch:
    """Trials that ran together, as their records say.

    Attributes:
        trials: at least one.
        compile, run: seconds, until the last trial had ended.
        layout: see `program.over_trials`.
    """

    trials: Sequence[TrialResult]
    compile: float
    run: float
    layout: str

    @property
    def core_seconds(self) -> float:
        """Seconds of a CPU's core: a batch takes as many cores as it has trials, if there are."""
        return self.run * min(int(self.trials[0].device.get("count") or 1), len(self.trials))

    def seconds(self, trials: int) -> float:
        """Return about how long so many trials of the same condition take."""
        return self.compile + self.run * (trials / len(self.trials) if self.layout == "alone" else 1)


def took(trials: Iterable[TrialResult], platform: str) -> RecordedBatch | None:
    """Return the largest batch among trials of one condition on a platform; None if there is none."""
    return _largest_batch(trial for trial in trials if trial.device.get("platform") == platform)


def _largest_batch(trials: Iterable[TrialResult]) -> RecordedBatch | None:
    """Return the largest batch of trials that came to an end; None if there is none."""
    ended = by_batch(trial for trial in trials if trial.status in COMPLETE)
    return max(ended, key=lambda batch: len(batch.trials), default=None)


def by_batch(trials: Iterable[TrialResult]) -> list[RecordedBatch]:
    """Return trials by batch, in the order of the first of each."""
    batches: dict[tuple[str, str], list[TrialResult]] = defaultdict(list)
    for trial in trials:
        batches[str(trial.timing["started"]), str(trial.device.get("kind"))].append(trial)
    found = []
    for each in batches.values():
        compiling, running = (max(float(trial.timing[name]) for trial in each) for name in ("compile", "run"))
        found.append(RecordedBatch(each, compiling, running, layout_on(str(each[0].device["platform"]))))
    return found


def measured_pace(condition: Condition, devices: Sequence[jax.Device]) -> Pace:
    """Compile, and time a few steps of one trial per core or device."""
    lanes = Lanes(condition, devices)
    width = usable_cores() if lanes.layout == "alone" else len(lanes.devices)
    state = lanes.start(list(range(width)), width)
    state, _ = lanes.advance(state, 1, width)
    until = min(4, condition.steps)
    began = time.perf_counter()
    _, report = lanes.advance(state, until, width)
    took = time.perf_counter() - began
    steps = max(int(np.max(report.steps)) - 1, 1)
    share = width if lanes.layout == "alone" else 1
    return Pace(took / steps / share, lanes.seconds, lanes.layout)
