"""What committed trials have cost: time of an accelerator by condition, and the pace of a CPU's core."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from evoclaims.paper import references
from evoclaims.paper.recorded_batches import RecordedBatch, by_batch
from evoclaims.paper.reproduction import Reproduction
from evoclaims.trials.result import TrialResult


@dataclass(frozen=True)
class Spent:
    """What the reference trials of a condition have cost, and would cost.

    Attributes:
        trials: how many there are.
        seconds: of one accelerator, by its kind, with compiling; empty when no trial was made on one.
        core_pace: seconds of a CPU's core per environment step, by trials of the same method and task, if need be of
            another tier, or under the protocol where the variant has none; None without a record.
    """

    trials: int
    seconds: Mapping[str, float]
    core_pace: float | None

    def core_seconds(self, steps: int) -> float | None:
        """Return the seconds of a CPU's core that so many environment steps would take; None where nothing is known."""
        return None if self.core_pace is None else self.core_pace * steps


def spent(reproduction: Reproduction, tier: str, method: str, task: str, variant: str = "") -> Spent:
    """Return what the committed trials of a condition have cost, under the protocol or a variant of it.

    Raises:
        UserError: when a file of reference trials cannot be read.
    """
    condition = reproduction.tier(tier, variant).condition(method, task)
    trials = references.of_condition(reproduction.references, tier, method, task, condition.id)
    seconds: dict[str, float] = defaultdict(float)
    for batch in _batches(trials):
        if batch.layout != "alone":
            seconds[str(batch.trials[0].device["kind"])] += batch.run + batch.compile
    tiers = [name for name in reproduction.tiers if variant or name != tier]
    others = (references.committed(reproduction.references, name, method, task) for name in tiers)
    paces = (_core_pace(found) for found in (trials, *others))
    return Spent(len(trials), dict(seconds), next((pace for pace in paces if pace is not None), None))


def _core_pace(trials: Iterable[TrialResult]) -> float | None:
    """Return the seconds of a core per environment step, by batches whose records tell what they took of one."""
    batches = [batch for batch in _batches(trials) if batch.layout == "alone" and batch.core_seconds is not None]
    steps = sum(trial.metrics.get("environment_steps", 0.0) for batch in batches for trial in batch.trials)
    return sum(batch.core_seconds or 0.0 for batch in batches) / steps if steps else None


def _batches(trials: Iterable[TrialResult]) -> list[RecordedBatch]:
    """Return trials by batch, without those that did not end by themselves or do not name their device."""
    return by_batch(trial for trial in trials if trial.status == "done" and trial.device)
