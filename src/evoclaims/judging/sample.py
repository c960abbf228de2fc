"""Sources of trials, and the numbers that are read from each trial."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, Protocol

from evoclaims.core.errors import guess
from evoclaims.judging.effect import median
from evoclaims.trials.result import TRAINED_BY, TrialResult

RESOLUTION: Final = 1e-6
"""Relative difference up to which two trials' numbers count as equal: eight times the precision of float32."""


class Source(Protocol):
    """Trials that can be fetched by seed."""

    @property
    def label(self) -> str:
        """A short name for tables and sentences, such as "cma_es on n_parity"."""

    @property
    def fingerprint(self) -> str:
        """Id of the condition; equal fingerprints mean the same trials."""

    @property
    def existing(self) -> float:
        """How many trials there can be, with seeds from 0; infinite where missing ones are run."""

    @property
    def deterministic(self) -> bool:
        """Whether the trials have no chance in them, so that they may be copies of each other."""

    @property
    def table_rows(self) -> frozenset[tuple[str, int]]:
        """The rows of a table, by its hash, that the trials are read from; none for trials that are run."""

    def fetch(self, seeds: Sequence[int]) -> Sequence[TrialResult]:
        """Return one trial per seed, in any order; run missing ones, or raise if nothing may run."""


Trials = Mapping[str, tuple[TrialResult, ...]]
"""Fetched trials by the fingerprint of their source, in order of their seeds."""


class UnreadableTrialError(Exception):
    """A number of a finished trial cannot be judged; its claim ends as an error, never with a 0 instead."""


class MissingNumberError(UnreadableTrialError, KeyError):
    """A finished trial lacks the number; also a `KeyError`, so that `get` and `in` of a mapping work."""

    __str__ = Exception.__str__  # a KeyError would print the message in quotation marks


@dataclass(frozen=True)
class Sample:
    """What was read from every trial of one condition.

    Attributes:
        label: what was measured, such as "cma_es on n_parity: mean success".
        seeds: shape [n].
        values: one number per trial, shape [n]; an event that held is 1.0. A failed trial has the worst value.
        median: median of `values`.
        failed: seeds of the diverged or timed-out trials.
        endings: how each of these ended, such as "diverged".
        limit: an infinite value of a trial that has not failed is only known to be larger than this; None without one.
        known_as: `TrialResult.seed_in_words` of each trial; empty if these are the seeds themselves.
    """

    label: str
    seeds: tuple[int, ...]
    values: tuple[float, ...]
    median: float
    failed: tuple[int, ...]
    endings: tuple[str, ...] = ()
    limit: float | None = None
    known_as: tuple[str, ...] = field(default=(), metadata={"canonical": "if set"})

    @property
    def capped(self) -> tuple[float, ...]:
        """The values, with the limit in place of those beyond it: the least that they can be."""
        return self.values if self.limit is None else tuple(min(value, self.limit) for value in self.values)


def is_failed(trial: TrialResult) -> bool:
    """Whether the trial ended without a result (diverged or timed out)."""
    return trial.status != "done"


class _Numbers(Mapping[str, Any]):
    """What a trial has measured, by name; reading a NaN is an error, since any comparison with it is silently false.

    So is a missing name, which the error names.
    """

    def __init__(self, numbers: Mapping[str, Any], where: str, lacking: str = "") -> None:
        """Remember where the numbers are from; `lacking` begins the sentence about a NaN that stands for no number."""
        self._numbers = numbers
        self._where = where
        self._lacking = lacking

    def __getitem__(self, name: str) -> Any:
        value = self._numbers.get(name, ())
        if value == ():
            raise MissingNumberError(f"There is no {name!r} in {self._where}.{guess(name, self._numbers)}")
        if any(math.isnan(number) for number in (value if isinstance(value, list | tuple) else (value,))):
            subject = f"{self._lacking} {name!r} for" if self._lacking else f"{name!r} is NaN in"
            raise UnreadableTrialError(f"{subject} {self._where}.")
        return value

    def __iter__(self) -> Iterator[str]:
        return iter(self._numbers)

    def __len__(self) -> int:
        return len(self._numbers)


def checked(trial: TrialResult) -> TrialResult:
    """Return the trial with numbers that raise `UnreadableTrialError` for NaN or missing names."""
    if isinstance(trial.metrics, _Numbers):  # it has been checked, as trials are that are judged again and again
        return trial
    known = vars(trial)  # a trial is read by many measures
    if "_checked" not in known:
        known["_checked"] = _checked(trial)
    found: TrialResult = known["_checked"]
    return found


def _checked(trial: TrialResult) -> TrialResult:
    where = f"the finished trial of seed {trial.seed_in_words} (id {trial.id[:12]})"
    loop, of_metrics, of_levels = trial.provenance.get(TRAINED_BY), "", ""
    if loop:  # what its function or its policy's examination gives as NaN is no finished trial
        of_metrics = f"The training loop {loop} returned no"
        of_levels = f"{of_metrics} policy, which alone shows"
    return replace(
        trial,
        metrics=_Numbers(trial.metrics, where, of_metrics),
        levels=_Numbers(trial.levels, where, of_levels),
        curves=_Numbers(trial.curves, where, "A row of the table has no" if "imported" in trial.spec else ""),
    )


def read_number(trial: TrialResult, what: str, read: Callable[[TrialResult], float], worst: float) -> float:
    """Return what `read` finds in a finished trial, or `worst` for a failed one.

    Raises:
        UnreadableTrialError: when NaN or no number is read from a finished trial.
    """
    if is_failed(trial):
        return worst
    value = read(checked(trial))
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise UnreadableTrialError(
            f"{what} is {value!r}, and no number, in the finished trial of seed {trial.seed_in_words}: what reads it "
            "returns one number for a trial."
        ) from None
    return ranked(number, trial, what)


def ranked(value: float, trial: TrialResult, what: str) -> float:
    """Return `value` if it can be ranked.

    Raises:
        UnreadableTrialError: when it is NaN.
    """
    if math.isnan(value):
        raise UnreadableTrialError(
            f"{what} is NaN in the finished trial of seed {trial.seed_in_words} (id {trial.id[:12]})."
        )
    return value


def sample(label: str, trials: Sequence[TrialResult], values: Sequence[float]) -> Sample:
    """Return the sample of `values`, one for each of `trials`, without a limit."""
    failed = [trial for trial in trials if is_failed(trial)]
    seeds, known_as = tuple(trial.seed for trial in trials), tuple(trial.seed_in_words for trial in trials)
    return Sample(
        label=label,
        seeds=seeds,
        values=tuple(float(value) for value in values),
        median=median(values) if values else math.nan,
        failed=tuple(trial.seed for trial in failed),
        endings=tuple(trial.status for trial in failed),
        known_as=() if known_as == tuple(map(str, seeds)) else known_as,
    )


def alike(value: float, other: float) -> bool:
    """Whether two numbers are equal but for rounding to single precision: nine of ten episodes are 0.90000004 there.

    Whole numbers are counts, and exact.
    """
    if value == other or not (math.isfinite(value) and math.isfinite(other)):
        return value == other
    near = abs(value - other) <= RESOLUTION * max(abs(value), abs(other))
    return near and not (float(value).is_integer() and float(other).is_integer())


def beyond(value: float, number: float) -> float:
    """Return by how much a trial's value is above a number, below it if negative; 0 where they are `alike`."""
    return 0.0 if alike(value, number) else value - number


def levelled(one: Sample, other: Sample) -> tuple[Sample, Sample]:
    """Return two samples in which values that are `alike` are equal.

    Else a method of the engine would be above or below a training loop or a table wherever both have solved nine of ten
    episodes.
    """
    exact: dict[float, float] = {}
    least = math.nan  # of those that are alike: neighbours that are would let numbers far apart be equal
    for value in sorted({*one.values, *other.values}):
        least = exact[value] = least if alike(least, value) else value
    first, second = (replace(side, values=tuple(exact[value] for value in side.values)) for side in (one, other))
    return first, second
