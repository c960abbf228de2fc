"""Trials that stand for a paper's own numbers, so that its claims can be put to them: would the paper pass?"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile
from types import SimpleNamespace
from typing import Any, Final

from evoclaims.claims.fetching import NotStoredError
from evoclaims.judging.measure import Profile
from evoclaims.paper.reproduction import Reproduction
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition, TrialSpec

PARTS: Final = ("metrics", "levels", "curves")
"""The parts of a record that measures read."""

Numbers = dict[str, dict[str, Any]]
"""What a record has in each part, by name."""


@dataclass(frozen=True)
class AsPublished:
    """Instead of trials of a tier's conditions, as many records as are asked for, with the published means: a `Fetch`.

    What the paper has not published, no record has: an assertion that reads it cannot be judged.
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
            numbers = self._numbers(method, task, condition)
            if any(numbers.values()):
                return [record(TrialSpec(condition, seed), numbers) for seed in seeds]
        label = " on ".join(names[0]) if names else condition.label
        raise NotStoredError(f"no number of {label} is published")

    def _numbers(self, method: str, task: str, condition: Condition) -> Numbers:
        """Return the published numbers where a record has them, with what follows from them."""
        numbers: Numbers = {part: {} for part in PARTS}
        group = self.reproduction.trials(method, task, condition, self)
        for quantity, plot in self.reproduction.published.plots.get(task, {}).items():
            means = tuple(map(float, plot["methods"].get(method, {}).get("mean", ())))
            measure: Any = getattr(group, quantity)
            if means and (not isinstance(measure, Profile) or len(means) == measure.size):
                value = means if isinstance(measure, Profile) else means[0]
                for part, found in _placed(measure.read, value).items():
                    numbers[part].update(found)
        implied = _implied(numbers["metrics"], numbers["levels"], condition.task.levels)
        numbers["metrics"].update(implied)
        return numbers


def _placed(read: Callable[[Any], Any], value: Any) -> Numbers:
    """Return the part of a record in which a measure finds `value`; nothing if it computes more than it reads.

    The measure is given a record that has every name and notes which one is asked for, then one with that name alone.
    """
    asking = {part: _Noting(0.0 if part == "metrics" else (0.0,)) for part in PARTS}
    try:
        read(SimpleNamespace(**asking))
        ((part, name),) = [(part, name) for part in PARTS for name in asking[part].asked]
        held = value if part == "metrics" or isinstance(value, tuple) else (value,)
        placed = {known: {name: held} if known == part else {} for known in PARTS}
        return placed if read(SimpleNamespace(**placed)) == value else {}
    except (ArithmeticError, LookupError, TypeError, ValueError):  # it needs more than one number
        return {}


class _Noting(dict[str, Any]):
    """A mapping that has every name, with one value, and notes those that are read."""

    def __init__(self, value: Any) -> None:
        self.asked: list[str] = []
        self._value = value

    def __missing__(self, name: str) -> Any:
        self.asked.append(name)
        return self._value


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


def record(spec: TrialSpec, numbers: Numbers) -> TrialResult:
    """Return a record of a finished trial with these numbers."""
    return TrialResult(
        id=spec.id,
        condition=spec.condition.id,
        spec=spec.plain,
        seed=spec.seed,
        status="done",
        metrics=numbers["metrics"],
        levels=numbers["levels"],
        curves=numbers["curves"],
        digest="",
        timing={},
        provenance={},
    )
