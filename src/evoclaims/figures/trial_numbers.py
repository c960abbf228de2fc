"""The numbers read from each trial of a condition, with a note for each that is missing."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from evoclaims.core.printable import printable
from evoclaims.figures.figure import Scope
from evoclaims.judging.measure import Measure
from evoclaims.judging.sample import MissingNumberError, UnreadableTrialError, checked, is_failed
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import TrialSpec

MeasureOf = Callable[[Any], Measure]
"""Returns the measure to read, from a `TrialGroup` of the reproduction."""

NOT_FINITE, NOT_RUN, NOT_MEASURED = "not finite", "not run", "not measured"
PLACE, WHAT = ("panel", "at", "series", "method", "task"), ("what", "against", "n")
COLUMNS = (*PLACE, *WHAT, "seed", "trial", "status", "value", "error")
"""Columns of figures' tables: a number per row. `what` is "trial", "mean" (`error`: the standard deviation), "reported"
(`error`: as published), or the name of a test (`value`: p; `against`: the other side)."""


@dataclass(frozen=True)
class TrialNumber:
    """One trial's number.

    Attributes:
        seed, trial: which trial; `trial` is its id.
        status: the record's; "not finite" for a finished trial with such a number, "not measured" for one without a
            number, "not run" without a trial.
        value: the number; None without a number to draw.
        rank: what rank tests use: the number, or the worst (-inf or inf) for a trial that diverged or ran out of time.
    """

    seed: int
    trial: str
    status: str
    value: float | None
    rank: float | None


@dataclass(frozen=True)
class TrialNumbers:
    """A measure of a condition's trials.

    Attributes:
        method, task: the condition's names.
        name: what is measured.
        each: in the order of seeds.
    """

    method: str
    task: str
    name: str
    each: tuple[TrialNumber, ...]

    @property
    def values(self) -> tuple[float, ...]:
        """The numbers that can be drawn."""
        return tuple(number.value for number in self.each if number.value is not None)

    @property
    def ranks(self) -> tuple[float, ...]:
        """What rank tests use."""
        return tuple(number.rank for number in self.each if number.rank is not None)

    @property
    def broken(self) -> int:
        """How many trials ran and gave no number."""
        return sum(number.value is None and number.status != NOT_RUN for number in self.each)

    @property
    def incomplete(self) -> bool:
        """Whether some trials gave a number, but not all."""
        return 0 < len(self.values) < len(self.each)

    @property
    def mean(self) -> float:
        """The mean of the numbers; NaN without any."""
        return math.fsum(self.values) / len(self.values) if self.values else math.nan

    @property
    def deviation(self) -> float:
        """The sample standard deviation of the numbers; NaN below two."""
        squares = math.fsum((value - self.mean) ** 2 for value in self.values)
        return math.sqrt(squares / (len(self.values) - 1)) if len(self.values) > 1 else math.nan

    def rows(self, **common: Any) -> list[dict[str, Any]]:
        """Return the table's rows of the trials and of their mean; `common` goes into each."""
        names = {**common, "method": self.method, "task": self.task}
        rows = [
            {**names, "what": "trial", "seed": r.seed, "trial": r.trial, "status": r.status, "value": r.value}
            for r in self.each
        ]
        summary = {"what": "mean", "n": len(self.values), "value": self.mean, "error": self.deviation}
        return [*rows, {**names, **summary}] if self.values else rows


def read(scope: Scope, method: str, task: str, measure_of: MeasureOf) -> TrialNumbers:
    """Read a measure from the trials that verdicts look at: those of a third look, wherever all of these are there."""
    group = scope.group(method, task)
    measure, design = measure_of(group), scope.tier.design
    for n in (design.with_third_look().last.n, design.last.n):
        seeds = design.seeds(n, bool(group.condition.existing))
        trials = scope.archive.trials(group.condition, seeds)
        if None not in trials:
            break
    ids = [TrialSpec(group.condition, seed).id for seed in seeds]
    each = [_number(measure, *found) for found in zip(seeds, ids, trials, strict=True)]
    return TrialNumbers(method, task, measure.name, tuple(each))


def frame(rows: Iterable[Mapping[str, Any]], *more: str) -> Any:
    """Return rows as a `pandas.DataFrame` with `COLUMNS` and `more`; counts and seeds are integers or missing."""
    import pandas as pd

    return pd.DataFrame(list(rows), columns=[*COLUMNS, *more]).astype(dict.fromkeys(("n", "seed", *more), "Int64"))


def absences(numbers: Iterable[TrialNumbers]) -> tuple[str, ...]:
    """Say which trials are missing and which gave no number, each condition once."""
    kept = {(one.method, one.task): one for one in numbers}
    absent = [_name(one) for one in kept.values() if all(r.status == NOT_RUN for r in one.each)]
    partial = [one for one in kept.values() if 0 < _count(one, NOT_RUN) < len(one.each)]
    sentences = [f"Not run: {', '.join(absent)}."] if absent else []
    if partial:
        counts = [f"{_name(one)} ({len(one.each) - _count(one, NOT_RUN)} of {len(one.each)} trials)" for one in partial]
        sentences.append(f"Run in part: {', '.join(counts)}.")
    for one in kept.values():
        statuses = Counter(r.status for r in one.each if r.value is None and r.status != NOT_RUN)
        sentences += [f"{_name(one)}: {count} of {len(one.each)} trials {_end(s)}." for s, count in statuses.items()]
    return tuple(sentences)


def _number(measure: Measure, seed: int, trial_id: str, trial: TrialResult | None) -> TrialNumber:
    if trial is None:
        return TrialNumber(seed, trial_id, NOT_RUN, None, None)
    if trial.status == "crashed":  # an accident of the machine, which says nothing about the method
        return TrialNumber(seed, trial_id, trial.status, None, None)
    if is_failed(trial):
        return TrialNumber(seed, trial_id, trial.status, None, -math.inf if measure.better == "higher" else math.inf)
    try:
        value = float(measure.read(checked(trial)))
    except MissingNumberError:
        return TrialNumber(seed, trial_id, NOT_MEASURED, None, None)
    except UnreadableTrialError:  # NaN
        value = math.nan
    if math.isfinite(value):
        return TrialNumber(seed, trial_id, trial.status, value, value)
    return TrialNumber(seed, trial_id, NOT_FINITE, None, None if math.isnan(value) else value)


def _count(numbers: TrialNumbers, status: str) -> int:
    return sum(number.status == status for number in numbers.each)


def _name(numbers: TrialNumbers) -> str:
    return printable(f"{numbers.method} on {numbers.task}")


def _end(status: str) -> str:
    """Say how trials ended, and how means and rank tests treat them."""
    ends = {
        "diverged": "diverged (no value; the worst rank in tests)",
        "timeout": "ran out of time (no value; the worst rank in tests)",
        "crashed": "crashed (left out)",
        NOT_MEASURED: "left no such number (left out)",
    }
    return ends.get(status, "ended with a number that is not finite (left out of the mean)")
