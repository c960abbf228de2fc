"""About how long missing trials of a condition will take: by earlier trials, or by their budget."""

from __future__ import annotations

import itertools
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, TypeVar

from evoclaims.paper import references
from evoclaims.paper.recorded_batches import by_batch
from evoclaims.paper.reproduction import Reproduction
from evoclaims.trials.devices import layout_on, usable_cores
from evoclaims.trials.result import COMPLETE, TrialResult
from evoclaims.trials.spec import Condition

Key = TypeVar("Key")

COMPILE_SECONDS: Final = 10.0
"""To compile a condition, where nothing is known: between a gate's and a robot's, on a processor."""

STEP_SECONDS: Final = 1e-5
"""An environment step, where no trial of any condition has run: it orders budgets and no more."""


@dataclass(frozen=True)
class Estimate:
    """How long a batch of trials takes.

    Attributes:
        compile: seconds.
        work: seconds of running: of one core if each trial is a call of its own, else of the device.
        trials: how many are missing.
        layout: see `program.over_trials`.
    """

    compile: float
    work: float
    trials: int
    layout: str

    def seconds(self, cores: int = 1) -> float:
        """Return the time that the batch takes in a process with so many cores."""
        return self.compile + self.work / (min(self.trials, cores) if self.layout == "alone" else 1)


@dataclass(frozen=True)
class Missing:
    """What is known of the missing trials of a condition.

    Attributes:
        condition: what has to run.
        trials: how many of them are missing.
        earlier: trials of this condition, or of the same method and task, from anywhere.
    """

    condition: Condition
    trials: int
    earlier: Sequence[TrialResult]


def committed(reproduction: Reproduction, tier: str, method: str, task: str) -> tuple[TrialResult, ...]:
    """Return the reference trials of a method on a task: the protocol's, those of `tier` first, then its variants'."""
    tiers = sorted(reproduction.tiers, key=lambda name: name != tier)
    folders = map(reproduction.references_of, ("", *reproduction.variants))
    files = (references.committed(folder, name, method, task) for folder in folders for name in tiers)
    return tuple(itertools.chain.from_iterable(files))


def estimates(missing: Mapping[Key, Missing], platform: str) -> dict[Key, Estimate]:
    """Estimate batches on a platform, such as "gpu".

    Earlier trials of the same condition count as they were; those of the same method and task by their pace; what has
    never run on such a platform counts by its budget, at the median pace of the others.
    """
    layout = layout_on(platform)
    known = {key: _known(one, platform, layout) for key, one in missing.items()}
    of_others = [found.work / max(_steps(missing[key], layout), 1) for key, found in known.items() if found is not None]
    compiling = [found.compile for found in known.values() if found is not None]
    pace = statistics.median(of_others) if of_others else STEP_SECONDS
    compile_seconds = statistics.median(compiling) if compiling else COMPILE_SECONDS
    return {
        key: found or Estimate(compile_seconds, pace * _steps(one, layout), one.trials, layout)
        for (key, one), found in zip(missing.items(), known.values(), strict=True)
    }


def _steps(one: Missing, layout: str) -> int:
    """Return the environment steps that are run one after the other, at most."""
    return one.condition.environment_steps * (one.trials if layout == "alone" else 1)


def _known(one: Missing, platform: str, layout: str) -> Estimate | None:
    """Estimate by earlier trials; None where none ran on this platform."""
    here = (trial for trial in one.earlier if trial.device.get("platform") == platform)
    batches = by_batch(trial for trial in here if trial.status in COMPLETE)
    same = [batch for batch in batches if batch.trials[0].condition == one.condition.id]
    if not batches:
        return None
    batch = max(same or batches[:1], key=lambda batch: len(batch.trials))
    steps = [max(float(trial.metrics.get("environment_steps", 0.0)), 1.0) for trial in batch.trials]
    if layout == "alone":
        used = batch.core_seconds or batch.run * min(usable_cores(), len(steps))  # untold: as if here
        work = used * one.trials / len(steps) if same else used / sum(steps) * _steps(one, layout)
    else:
        work = batch.run if same else batch.run / max(steps) * _steps(one, layout)
    return Estimate(batch.compile, work, one.trials, layout)
