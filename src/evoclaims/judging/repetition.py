"""Does a published mean repeat? The 95% prediction interval for the mean of further trials, and a test of equivalence.

Assumed throughout: both sets of trials are independent draws from one population. The t intervals assume that it is
normal, too; the count at the end of a scale assumes nothing else.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from typing import Final

from evoclaims.judging.design import POWER, detectable_a12
from evoclaims.judging.exact import MAX_TRIALS, binomial_test

LEVEL: Final = 0.95
"""How often a repetition falls inside."""

FEWEST: Final = 5
"""Fewest of our trials that are compared with a published mean: those of the first look."""

FEWEST_PUBLISHED: Final = 4
"""Fewest published trials a side that detect anything at 0.05."""


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
    """Whether ours is inside the prediction interval."""

    INSIDE = "inside"
    OUTSIDE = "outside"
    UNKNOWN = "cannot be said"


class Agreement(StrEnum):
    """Whether a published number repeats: inside an interval is only not outside.

    Consistent: ours is shown to be within the effect that the paper's n detects with power 1/3 (Simonsohn 2015).
    Contradicted: ours is outside the prediction interval. Uninformative: neither. Open: too few trials, or broken ones.
    """

    CONSISTENT = "consistent"
    CONTRADICTED = "contradicted"
    UNINFORMATIVE = "uninformative"
    OPEN = "cannot be said"


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
        needed: fewest trials that would show equivalence, if they were as ours are; None where no number would.
    """

    spread: Spread
    of: str
    low: float
    high: float
    ours: float | None
    needed: int | None = None

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
        trials: how many measured trials it is about; 0 while they are too few or broken.
    """

    predictions: tuple[Prediction, ...]
    answer: Answer
    reason: str = ""
    trials: int = 0

    @property
    def agreement(self) -> Agreement:
        """Whether the number repeats; each reading of the spread has to agree."""
        if not self.trials:
            return Agreement.OPEN
        if self.answer is Answer.OUTSIDE:
            return Agreement.CONTRADICTED
        consistent = self.needed is not None and self.needed <= self.trials
        return Agreement.CONSISTENT if consistent and self.answer is Answer.INSIDE else Agreement.UNINFORMATIVE

    @property
    def needed(self) -> int | None:
        """Fewest trials that would show equivalence by each reading; None where no number would."""
        every = [prediction.needed for prediction in self.predictions]
        known = [needed for needed in every if needed is not None]
        return max(known) if known and len(known) == len(every) else None


def repetition(
    published: PublishedMean, ours: Sequence[float], planned: int, broken: int = 0, among: int = 1
) -> Repetition:
    """Return whether our trials are a repetition of a published mean.

    Args:
        published: the mean.
        ours: our trials' values, shape [n].
        planned: the number of trials that a prediction is for while ours are too few.
        broken: how many further trials gave no number.
        among: how many numbers of one condition have to be inside together (Bonferroni).
    """
    missing = _missing(len(ours), broken)
    level = 1 - (1 - LEVEL) / among
    predictions, reason = _predictions(published, () if missing else ours, planned, level)
    if missing:
        return Repetition(predictions, Answer.UNKNOWN, missing)
    answers = {prediction.answer for prediction in predictions}
    if len(answers) == 1:
        return Repetition(predictions, answers.pop(), reason, len(ours))
    split = "; ".join(f"{prediction.answer} if {prediction.spread}" for prediction in predictions)
    return Repetition(predictions, Answer.UNKNOWN, split or reason, len(ours))


def _missing(count: int, broken: int) -> str:
    """Say what is missing for an answer; empty if nothing is."""
    if broken:
        return f"{broken} of our {count + broken} trials gave no number"
    if count < FEWEST:
        return f"{count} of our trials, at least {FEWEST} are needed" if count else "not run"
    return ""


def _predictions(
    published: PublishedMean, ours: Sequence[float], planned: int, level: float
) -> tuple[tuple[Prediction, ...], str]:
    """Return the predictions for our number of trials, and a remark on the published spread."""
    trials, n = published.trials, len(ours) or planned
    at_an_end = published.scale is not None and published.mean in published.scale
    if at_an_end and not published.error and not published.precision:  # every trial had the same value
        return (_count(published.mean, trials, n, ours, level),), ""
    if published.error:
        bars = {Spread.DEVIATION: published.error, Spread.STANDARD_ERROR: published.error * math.sqrt(trials)}
        found = [_mean(published, name, s, trials, n, ours, level) for name, s in bars.items() if published.allows(s)]
        excluded = [f"on its scale it cannot be that {name}" for name, s in bars.items() if not published.allows(s)]
        return tuple(found), "; ".join(excluded)
    deviation = statistics.stdev(ours) if ours else 0.0
    if not deviation:
        return (), "no spread is published" + (", and ours is 0" if ours else "")
    return (_mean(published, Spread.OURS, deviation, n, n, ours, level),), ""


def _mean(
    published: PublishedMean,
    spread: Spread,
    deviation: float,
    known_from: int,
    n: int,
    ours: Sequence[float],
    level: float,
) -> Prediction:
    """Predict the mean of `n` trials by Student's t, from the standard deviation of `known_from` trials."""
    factor = _t((1 + level) / 2, known_from - 1)
    half = factor * deviation * math.sqrt(1 / published.trials + 1 / n) + published.precision
    least, most = published.scale or (-math.inf, math.inf)
    low, high = max(published.mean - half, least), min(published.mean + half, most)
    if not ours:
        return Prediction(spread, "mean", low, high, None)
    mean = statistics.fmean(ours)
    if published.trials < FEWEST_PUBLISHED:
        return Prediction(spread, "mean", low, high, mean)
    # Equivalence: |difference| + t(0.95) s sqrt(1/N + 1/n) + precision is at most the detectable shift. Solved for n.
    room = detectable_shift(published.trials) - (abs(mean - published.mean) + published.precision) / deviation
    left = (room / _t(LEVEL, known_from - 1)) ** 2 - 1 / published.trials if room > 0 else 0.0
    needed = max(FEWEST, math.ceil(1 / left - 1e-9)) if left > 0 else None
    return Prediction(spread, "mean", low, high, mean, needed)


@lru_cache
def _t(level: float, freedom: int) -> float:
    from scipy.stats import t as student  # as in `judging.exact`

    return float(student.ppf(level, freedom))


def detectable_shift(n: int) -> float:
    """Return the shift, in standard deviations, that `n` against `n` normal trials detect with power 1/3."""
    return math.sqrt(2) * statistics.NormalDist().inv_cdf(detectable_a12(n))


@lru_cache
def detectable_share(n: int) -> float:
    """Return the share at an end that `n` trials detect with power 1/3 beside `n` that all are there, by Fisher's test.

    The sides are equal, at least 4 trials each.
    """
    most = max(
        (k for k in range(n) if 2 * math.comb(n, n - k) / math.comb(2 * n, n - k) <= 1 - LEVEL),
        default=-1,
    )
    low, high = 0.0, 1.0
    for _ in range(50):
        share = (low + high) / 2
        power = math.fsum(math.comb(n, k) * share**k * (1 - share) ** (n - k) for k in range(most + 1))
        low, high = (share, high) if power > POWER else (low, share)
    return low


def _count(end: float, trials: int, n: int, ours: Sequence[float], level: float) -> Prediction:
    """Predict how many of `n` trials are at an end of the scale, where all `trials` published ones are.

    Of all splits of the pooled trials into published and new ones, each as likely, take those in which the trials that
    are not at the end are all new (Fisher's exact test): the fewest at the end for which these are not too rare.
    """
    failures = 0
    while failures < n and math.comb(n, failures + 1) / math.comb(trials + n, failures + 1) > 1 - level:
        failures += 1
    ends = f"trials at {end:g}", float(n - failures), float(n)
    if not ours:
        return Prediction(Spread.NONE, *ends, None)
    there = sum(value == end for value in ours)
    if trials < FEWEST_PUBLISHED:
        return Prediction(Spread.NONE, *ends, float(there))
    share = detectable_share(trials)
    needed = next(
        (
            count
            for count in range(FEWEST, MAX_TRIALS + 1)
            if binomial_test(there * count // n, count, share, "greater").p <= 1 - LEVEL
        ),
        None,
    )
    return Prediction(Spread.NONE, *ends, float(there), needed)
