"""Toy trials that end in every way, and a run of them: what is stopped, resumed and watched."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from trial_toys import walk

from evoclaims.trials.progress import RunProgress, ignore
from evoclaims.trials.result import TrialResult
from evoclaims.trials.runner import run
from evoclaims.trials.spec import Condition
from evoclaims.trials.store import Store

CLIMBING = walk(chance=0.35, hazard=0.04)
"""Of the seeds 1 to 5 some end early, one diverges and one spends the whole budget."""
SEEDS = range(1, 6)


class Log(list[RunProgress]):
    """A watcher that keeps what it was told."""

    __call__ = list.append

    def steps(self) -> list[int]:
        return [progress.steps for progress in self if progress.phase == "training"]

    def phases(self) -> list[str]:
        return list(dict.fromkeys(progress.phase for progress in self))


def run_climbers(
    store: Store,
    cpus: Sequence[Any],
    watch: Callable[[RunProgress], None] = ignore,
    condition: Condition = CLIMBING,
    seeds: Sequence[int] = SEEDS,
) -> list[TrialResult]:
    return run(condition, seeds, store, cpus, watch, checkpoint_seconds=0.0)


def digests(results: Sequence[TrialResult]) -> list[str]:
    return [result.digest for result in results]
