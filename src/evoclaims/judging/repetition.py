"""Does a published mean repeat? The 95% prediction interval for the mean of further trials, beside what they gave.

Assumed throughout: both sets of trials are independent draws from one population. The t intervals assume that it is
normal, too; the count at the end of a scale assumes nothing else.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from scipy.stats import t as student

LEVEL: Final = 0.95
"""How often a repetition falls inside."""

FEWEST: Final = 5
"""Fewest trials of ours that are compared with a published mean: those of the first look."""

DEVIATION, STANDARD_ERROR = "standard deviation", "standard error"
"""What an error bar may be that its source does not explain."""


class Answer(StrEnum):
    """Whether a published number repeats."""

    INSIDE = "inside"
    OUTSIDE = "outside"
    UNKNOWN = "cannot be said"


@dataclass(frozen=True)
class PublishedMean:
    """A mean as a paper gives it.

    Attributes:
        mean: of its trials.
        error: its error bar; None where there is none, 0 where none can be seen.
        trials: how many trials it is the mean of, at least 2.
        scale: the smallest and the largest value that a trial can have; None for no limits.
        precision: the largest difference between the number as printed and the mean that was measured: 0.5 for "five".
    """

    mean: float
    error: float | None
    trials: int
    scale: tuple[float, float] | None = None
    precision: float = 0.0

    @property
    def at_an_end(self) -> bool:
        """Whether every trial must have had the same value: the mean is at an end of the scale."""
        return self.scale is not None and self.mean in self.scale and not self.error and not self.precision

    def allows(self, deviation: float) -> bool:
        """Whether values on the scale can have this mean and this standard deviation (Bhatia and Davis 2000)."""
        if self.scale is None:
            return True
        largest = (self.mean - self.scale[0]) * (self.scale[1] - self.mean)
        return deviation**2 * (self.trials - 1) <= self.trials * largest * (1 + 1e-9)


@dataclass(frozen=True)
class Prediction:
    """What a repetition would give if an assumption about the published spread holds.

    Attributes:
        assumption: what is taken for the published spread.
        of: what is predicted: "mean", or "trials at 1".
        low, high: the interval.
        answer: whether our trials are inside.
    """

    assumption: str
    of: str
    low: float
    high: float
    answer: Answer


@dataclass(frozen=True)
class Repetition:
    """A published mean and our trials.

    Attributes:
        predictions: one per reading of the published spread that its scale allows.
        answer: inside or outside if all predictions agree.
        reason: why it cannot be said, or what the scale says about the error bar; may be empty.
    """

    predictions: tuple[Prediction, ...]
    answer: Answer
    reason: str = ""


def repetition(published: PublishedMean, ours: Sequence[float], planned: int, broken: int = 0) -> Repetition:
    """Return whether our trials are a repetition of a published mean.

    Args:
        published: the mean.
        ours: our trials' values, shape [n].
        planned: the number of trials that a prediction is for while ours are too few.
        broken: how many further trials of ours gave no number.
    """
    missing = _missing(len(ours), broken)
    predictions, reason = _predictions(published, () if missing else ours, planned)
    if missing:
        return Repetition(predictions, Answer.UNKNOWN, missing)
    answers = {prediction.answer for prediction in predictions}
    if len(answers) == 1:
        return Repetition(predictions, answers.pop(), reason)
    split = "; ".join(f"{prediction.answer} if {prediction.assumption}" for prediction in predictions)
    return Repetition(predictions, Answer.UNKNOWN, split or reason)


def _missing(count: int, broken: int) -> str:
    """Say what is missing for an answer; empty if nothing is."""
    if broken:
        return f"{broken} of our {count + broken} trials gave no number"
    if count < FEWEST:
        return f"{count} of our trials, at least {FEWEST} are needed" if count else "not run"
    return ""


def _predictions(published: PublishedMean, ours: Sequence[float], planned: int) -> tuple[tuple[Prediction, ...], str]:
    """Return the predictions for our number of trials, and a remark on the published spread."""
    trials, n = published.trials, len(ours) or planned
    if published.at_an_end:
        return (_count(published.mean, trials, n, ours),), ""
    if published.error:
        bars = {DEVIATION: published.error, STANDARD_ERROR: published.error * math.sqrt(trials)}
        allowed = {name: spread for name, spread in bars.items() if published.allows(spread)}
        found = [_mean(published, f"the bar is a {name}", s, trials, n, ours) for name, s in allowed.items()]
        excluded = [name for name in bars if name not in allowed]
        return tuple(found), "; ".join(f"on this scale the bar cannot be a {name}" for name in excluded)
    spread = statistics.stdev(ours) if ours else 0.0
    if not spread:
        return (), "no spread is published" + (", and ours is 0" if ours else "")
    assumption = "the spread, not published, is that of our trials"
    return (_mean(published, assumption, spread, n, n, ours),), ""


def _mean(
    published: PublishedMean, assumption: str, spread: float, known_from: int, n: int, ours: Sequence[float]
) -> Prediction:
    """Predict the mean of `n` trials by Student's t: `spread` is a standard deviation of `known_from` trials."""
    factor = float(student.ppf((1 + LEVEL) / 2, known_from - 1))
    half = factor * spread * math.sqrt(1 / published.trials + 1 / n) + published.precision
    least, most = published.scale or (-math.inf, math.inf)
    low, high = max(published.mean - half, least), min(published.mean + half, most)
    return Prediction(assumption, "mean", low, high, _answer(statistics.fmean(ours) if ours else None, low, high))


def _count(end: float, trials: int, n: int, ours: Sequence[float]) -> Prediction:
    """Predict how many of `n` trials are at an end of the scale, where all `trials` published ones are.

    Of all splits of the pooled trials into published and new ones, each as likely, take those in which the trials that
    are not at the end are all new (Fisher's exact test): the fewest at the end for which these are not too rare.
    """
    failures = 0
    while failures < n and math.comb(n, failures + 1) / math.comb(trials + n, failures + 1) > 1 - LEVEL:
        failures += 1
    at_the_end = sum(value == end for value in ours) if ours else None
    assumption = "all published trials are at the end of the scale, as their mean"
    answer = _answer(at_the_end, n - failures, n)
    return Prediction(assumption, f"trials at {end:g}", float(n - failures), float(n), answer)


def _answer(value: float | None, low: float, high: float) -> Answer:
    """Return whether a value is inside; unknown without one."""
    if value is None:
        return Answer.UNKNOWN
    return Answer.INSIDE if low <= value <= high else Answer.OUTSIDE
