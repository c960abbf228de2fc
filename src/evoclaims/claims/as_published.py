"""Trials that stand for a paper's own numbers, so that its claims can be put to them: would the paper pass?"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile
from types import SimpleNamespace
from typing import Any

from evoclaims.claims.fetching import NotStoredError
from evoclaims.judging.measure import Profile
from evoclaims.paper.reproduction import Reproduction
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition, TrialSpec


@dataclass(frozen=True)
class AsPublished:
    """Instead of trials, as many records as are asked for, each with the published means: a `Fetch`.

    What the paper has not published, no record has: an assertion that reads it cannot be judged.

    Attributes:
        reproduction: of the paper.
        tier: whose conditions are asked for.
    """

    reproduction: Reproduction
    tier: str

    def __call__(self, condition: Condition, seeds: Sequence[int]) -> Sequence[TrialResult]:
        """Return one record per seed.

        Raises:
            NotStoredError: when the paper has published no number of the condition.
        """
        conditions = self.reproduction.tier(self.tier).conditions
        names = [name for name, known in conditions.items() if known.id == condition.id]
        for method, task in names:
            metrics, levels = self._numbers(method, task, condition)
            if metrics or levels:
                return [_record(TrialSpec(condition, seed), metrics, levels) for seed in seeds]
        label = " on ".join(names[0]) if names else condition.label
        raise NotStoredError(f"no number of {label} is published")

    def _numbers(
        self, method: str, task: str, condition: Condition
    ) -> tuple[dict[str, float], dict[str, tuple[float, ...]]]:
        """Return metrics and levels as a record has them, with what follows from them."""
        metrics: dict[str, float] = {}
        levels: dict[str, tuple[float, ...]] = {}
        group = self.reproduction.trials(method, task, condition, self)
        for quantity, plot in self.reproduction.published.plots.get(task, {}).items():
            means = tuple(map(float, plot["methods"].get(method, {}).get("mean", ())))
            measure: Any = getattr(group, quantity)
            asked_metrics, asked_levels = _asked(measure.read)
            if isinstance(measure, Profile) and len(means) == measure.size:
                levels |= dict.fromkeys(asked_levels, means)
            elif not isinstance(measure, Profile) and means:
                metrics |= dict.fromkeys(asked_metrics, means[0])
        return {**metrics, **_implied(metrics, levels, condition.task.levels)}, levels


def _asked(read: Any) -> tuple[list[str], list[str]]:
    """Return the names of the metrics and of the levels that a measure reads from a record."""
    metrics, levels = _Noting(), _Noting()
    read(SimpleNamespace(metrics=metrics, levels=levels, curves={}))
    return metrics.asked, levels.asked


class _Noting(dict[str, Any]):
    """A mapping that has every name and notes those that are read."""

    def __init__(self) -> None:
        self.asked: list[str] = []

    def __missing__(self, name: str) -> float:
        self.asked.append(name)
        return 0.0


def _implied(metrics: Mapping[str, float], levels: Mapping[str, tuple[float, ...]], count: int) -> dict[str, float]:
    """Return what follows from success by level, or from perfect success at the last level.

    A level counts as solved if the mean success on it, and on all levels before it, is 1.
    """
    success = levels.get("success")
    if success:
        solved = len(list(takewhile(lambda value: value == 1.0, success)))
        mean = math.fsum(success) / len(success)
        return {"mean_success": mean, "last_success": success[-1], "furthest_solved": solved - 1.0}
    return {"furthest_solved": count - 1.0} if metrics.get("last_success") == 1.0 else {}


def _record(spec: TrialSpec, metrics: Mapping[str, float], levels: Mapping[str, tuple[float, ...]]) -> TrialResult:
    """Return a record of a finished trial with these numbers."""
    return TrialResult(
        id=spec.id,
        condition=spec.condition.id,
        spec=spec.plain,
        seed=spec.seed,
        status="done",
        metrics=metrics,
        levels=levels,
        curves={},
        digest="",
        timing={},
        provenance={},
    )
