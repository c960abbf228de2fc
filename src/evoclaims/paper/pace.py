"""How fast a condition runs on this machine, by earlier trials on such a device or by a few timed steps."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import jax
import numpy as np

from evoclaims.paper import references
from evoclaims.paper.recorded_batches import largest
from evoclaims.trials.batches import StoredTrials
from evoclaims.trials.devices import usable_cores
from evoclaims.trials.lanes import Lanes
from evoclaims.trials.spec import Condition
from evoclaims.trials.store import Store

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
    trials = list(StoredTrials(store, condition, any_version=True).sound(range(SEEDS_LOOKED_AT)))
    trials += references.of_condition(folder, tier, method, task, condition.id)
    batch = largest(trial for trial in trials if trial.device.get("kind") == kind)
    if batch is None:
        return None
    steps = [trial.metrics["steps"] for trial in batch.trials]
    work = sum(steps) if batch.layout == "alone" else max(steps)
    took = batch.run
    if batch.layout == "alone":  # it may have had more cores than there are here
        took = max(took, (batch.core_seconds or 0.0) / usable_cores())
    return Pace(took / max(work, 1), batch.compile, batch.layout)


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
