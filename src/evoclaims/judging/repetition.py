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
"""Fewest of our trials that are compared with a published mean: those of the first look."""


class Spread(StrEnum):
    """What is taken for the spread of the published trials."""

    DEVIATION = "the bar is a standard deviation"
    STANDARD_ERROR = "the bar is a standard error"
    OURS = "no spread is published: that of our trials"
    NONE = "none: the mean is at the end of the scale, and so is every trial"

    @property
    def short(self) -> str:
        """A few letters for tables."""
        return {"DEVIATION": "SD", "STANDARD_ERROR": "SE", "OURS": "our SD", "NONE": "exact"}[self.name]


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
        error: its error bar; None without one, 0 where none can be seen.
        trials: how many trials it is the mean of, at least 2.
        scale: the smallest and the largest value that a trial can have; None for no limits.
        precision: the largest difference between the number as printed and the mean that was measured: 0.5 for "five".
    """

    mean: float
    error: float | None
    trials: int
    scale: tuple[float, float] | None = None
    precision: float = 0.0

    def allows(self, deviation: float) -> bool:
        """Whether values on the scale can have this mean and this standard deviation (Bhatia and Davis 2000)."""
        if self.scale is None:
            return True
        largest = (self.mean - self.scale[0]) * (self.scale[1] - self.mean)
        return deviation**2 * (self.trials - 1) <= self.trials * largest * (1 + 1e-9)


@dataclass(frozen=True)
class Prediction:
    """What a repetition would give, by one reading of the published spread.

    Attributes:
        spread: the reading.
        of: what is predicted: "mean", or "trials at 1".
        low, high: the interval.
        ours: our mean, or our number of trials at 1; None while our trials are too few.
    """

    spread: Spread
    of: str
    low: float
    high: float
    ours: float | None

    @property
    def answer(self) -> Answer:
        """Whether our trials are inside."""
        if self.ours is None:
            return Answer.UNKNOWN
        return Answer.INSIDE if self.low <= self.ours <= self.high else Answer.OUTSIDE


@dataclass(frozen=True)
class Repetition:
    """A published mean and our trials.

    Attributes:
        predictions: one per reading of the published spread that its scale allows.
        answer: inside or outside if all predictions agree.
        reason: why it is unknown, or what the scale says about the error bar; may be empty.
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
        broken: how many further trials gave no number.
    """
    missing = _missing(len(ours), broken)
    predictions, reason = _predictions(published, () if missing else ours, planned)
    if missing:
        return Repetition(predictions, Answer.UNKNOWN, missing)
    answers = {prediction.answer for prediction in predictions}
    if len(answers) == 1:
        return Repetition(predictions, answers.pop(), reason)
    split = "; ".join(f"{prediction.answer} if {prediction.spread}" for prediction in predictions)
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
    at_an_end = published.scale is not None and published.mean in published.scale
    if at_an_end and not published.error and not published.precision:  # every trial had the same value
        return (_count(published.mean, trials, n, ours),), ""
    if published.error:
        bars = {Spread.DEVIATION: published.error, Spread.STANDARD_ERROR: published.error * math.sqrt(trials)}
        found = [_mean(published, name, s, trials, n, ours) for name, s in bars.items() if published.allows(s)]
        excluded = [f"on its scale it cannot be that {name}" for name, s in bars.items() if not published.allows(s)]
        return tuple(found), "; ".join(excluded)
    deviation = statistics.stdev(ours) if ours else 0.0
    if not deviation:
        return (), "no spread is published" + (", and ours is 0" if ours else "")
    return (_mean(published, Spread.OURS, deviation, n, n, ours),), ""


def _mean(
    published: PublishedMean, spread: Spread, deviation: float, known_from: int, n: int, ours: Sequence[float]
) -> Prediction:
    """Predict the mean of `n` trials by Student's t, from the standard deviation of `known_from` trials."""
    factor = float(student.ppf((1 + LEVEL) / 2, known_from - 1))
    half = factor * deviation * math.sqrt(1 / published.trials + 1 / n) + published.precision
    least, most = published.scale or (-math.inf, math.inf)
    low, high = max(published.mean - half, least), min(published.mean + half, most)
    return Prediction(spread, "mean", low, high, statistics.fmean(ours) if ours else None)


def _count(end: float, trials: int, n: int, ours: Sequence[float]) -> Prediction:
    """Predict how many of `n` trials are at an end of the scale, where all `trials` published ones are.

    Of all splits of the pooled trials into published and new ones, each as likely, take those in which the trials that
    are not at the end are all new (Fisher's exact test): the fewest at the end for which these are not too rare.
    """
    failures = 0
    while failures < n and math.comb(n, failures + 1) / math.comb(trials + n, failures + 1) > 1 - LEVEL:
        failures += 1
    at_the_end = float(sum(value == end for value in ours)) if ours else None
    return Prediction(Spread.NONE, f"trials at {end:g}", float(n - failures), float(n), at_the_end)
