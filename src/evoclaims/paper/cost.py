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
    if not batch:
        return None
    took, steps = Took.of(batch), [trial.metrics["steps"] for trial in batch]
    work = sum(steps) if took.layout == "alone" else max(steps)
    return Pace(took.run / max(work, 1), took.compile, took.layout)


@dataclass(frozen=True)
class Took:
    """How long a batch of trials took, as its records say.

    Attributes:
        compile, run: seconds.
        trials: how many there were.
        layout: see `program.over_trials`.
    """

    compile: float
    run: float
    trials: int
    layout: str

    @staticmethod
    def of(batch: Sequence[TrialResult]) -> Took:
        """Read the records of a batch, at least one."""
        compiling, running = (max(float(trial.timing[name]) for trial in batch) for name in ("compile", "run"))
        return Took(compiling, running, len(batch), layout_on(str(batch[0].device["platform"])))

    def seconds(self, trials: int) -> float:
        """Return about how long so many trials of the same condition take."""
        return self.compile + self.run * (trials / self.trials if self.layout == "alone" else 1)


def took(trials: Iterable[TrialResult], platform: str) -> Took | None:
    """Return how long the largest batch among trials of one condition took on a platform; None if there is none."""
    batch = _largest_batch(trial for trial in trials if trial.device.get("platform") == platform)
    return Took.of(batch) if batch else None


def _largest_batch(trials: Iterable[TrialResult]) -> list[TrialResult]:
    """Return the trials of the largest batch that came to an end; none if there is none."""
    return max(by_batch(trial for trial in trials if trial.status in COMPLETE), key=len, default=[])


def by_batch(trials: Iterable[TrialResult]) -> list[list[TrialResult]]:
    """Return trials by batch, which share their times; in the order of the first of each."""
    batches: dict[tuple[str, str], list[TrialResult]] = defaultdict(list)
    for trial in trials:
        batches[str(trial.timing["started"]), str(trial.device.get("kind"))].append(trial)
    return list(batches.values())


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
