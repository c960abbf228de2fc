"""What a claim reads from each trial, with methods that make assertions about it.

A kind of assertion needs no method here: `verdict(Kind(measure, ...))` also works.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import reduce
from numbers import Real
from operator import and_
from typing import NoReturn, TypeGuard

from evoclaims.core.errors import UserError
from evoclaims.judging.assertion import Assertion
from evoclaims.judging.kinds.band import Band
from evoclaims.judging.kinds.equivalent import Equivalent
from evoclaims.judging.kinds.every_trial import EveryTrial
from evoclaims.judging.kinds.greater import Greater
from evoclaims.judging.kinds.most_trials import Solves, Stays
from evoclaims.judging.kinds.self_comparison import SelfComparison
from evoclaims.judging.kinds.threshold import Threshold
from evoclaims.judging.kinds.trend import Trend
from evoclaims.judging.reading import EventReading, LevelsReading, NumberReading, comparable
from evoclaims.judging.sample import UnreadableTrialError
from evoclaims.judging.window import product
from evoclaims.trials.result import TrialResult


class Measure(NumberReading):
    """One number per trial, and assertions about it."""

    def __gt__(self, other: Measure | float) -> Greater | Threshold:
        """Assert that this measure is above `other`, or its median above a number."""
        if _is_number(other):
            return Threshold(self, "above", float(other))
        above, below = comparable(self, self._measure(other))
        return Greater(above, below)

    def __lt__(self, other: Measure | float) -> Greater | Threshold:
        """Assert that this measure is below `other`, or its median below a number."""
        return Threshold(self, "below", float(other)) if _is_number(other) else self._measure(other) > self

    def __ge__(self, other: object) -> NoReturn:
        """Reject a comparison that holds for equal values, which decide nothing.

        Raises:
            UserError: always.
        """
        raise UserError(
            f"{self.describe()!r} is compared by > or <, and not by >= or <=: equal values decide nothing. "
            "Write m > 90, or m.between(90, 100), whose ends count as inside."
        )

    __le__ = __ge__

    def __mul__(self, factor: float) -> Measure:
        """Return this measure times a number above 0, for ratios: `2 * a.environment_steps < b.environment_steps`.

        Every value must be at least 0, because twice a negative reward is not twice as good.

        Raises:
            UserError: when `factor` is no finite number above 0.
        """
        if not _is_number(factor) or not 0 < factor < math.inf:
            raise UserError(f"{self.describe()!r} is multiplied by {factor!r}. Use a finite number above 0.")
        written, before = repr(float(factor)).removesuffix(".0"), self.before
        return replace(
            self,
            name=f"{written} × {self.name}",
            read=lambda trial: product(factor, self._at_least_0(trial)),
            before=before and (lambda trial: product(factor, before(trial))),
            window=self.window.scaled(factor),
        )

    __rmul__ = __mul__

    def between(self, lo: float, hi: float) -> Band:
        """Assert that the median is in [lo, hi]."""
        return Band(self, lo, hi)

    def equivalent_to(self, other: Measure, *, margin: float) -> Equivalent:
        """Assert that this measure is within `margin` of `other`."""
        left, right = comparable(self, self._measure(other))
        return Equivalent(left, right, margin)

    def never_above_itself(self) -> SelfComparison:
        """Assert, as a control, that the judge finds no difference between halves of these trials."""
        return SelfComparison(self)

    def _measure(self, other: object) -> Measure:
        if not isinstance(other, Measure):
            raise UserError(f"{self.describe()!r} is compared with {other!r}. Use another measure or a number.")
        return other

    def _at_least_0(self, trial: TrialResult) -> float:
        """Return the number of a finished trial, which must be 0 or above."""
        value = self.read(trial)
        if value < 0:
            raise UnreadableTrialError(
                f"{self.describe()} is {value:g} in the trial of seed {trial.seed_in_words}: "
                "a measure that can be below 0 has no ratios."
            )
        return value


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, Real) and not isinstance(value, bool)


class Event(EventReading):
    """Something that holds in a trial or does not, and assertions about it."""

    def in_most_trials(self, p0: float | None = None) -> Solves:
        """Assert that it holds with probability at least p0 (default: the design's): "solves"."""
        return Solves(self, p0)

    def stays(self, p0: float | None = None) -> Stays:
        """Assert that a bound is kept with probability at least p0 (default: the design's): "stays"."""
        return Stays(self, p0)

    def in_every_trial(self) -> EveryTrial:
        """Assert that it holds in every trial, for deterministic controls: "exact"."""
        return EveryTrial(self)


class Profile(LevelsReading):
    """One vector over levels per trial, and assertions about it."""

    def at(self, level: int) -> Measure:
        """Return the measure at one level, counted from 0.

        Raises:
            UserError: when there is no such level.
        """
        if not 0 <= level < self.size:
            raise UserError(f"{self.describe()!r} has levels 0 to {self.size - 1}, not {level}.")
        return Measure(self.source, f"{self.name} at level {level}", lambda t: self.of(t)[level], self.better)

    def above(self, other: Profile, *, beyond: int) -> Assertion:
        """Assert that this profile is above `other` at every level beyond `beyond`, counted from 0.

        Raises:
            UserError: when the two differ in their number of levels, or have none beyond `beyond`.
        """
        if self.size != other.size or not 0 <= beyond < self.size - 1:
            raise UserError(
                f"{self.describe()!r} with {self.size} levels cannot be compared with {other.describe()!r} with "
                f"{other.size} at the levels beyond {beyond}."
            )
        return reduce(and_, (self.at(level) > other.at(level) for level in range(beyond + 1, self.size)))

    def falls(self) -> Trend:
        """Assert that the values fall with the level."""
        return Trend(self, "falls")

    def rises(self) -> Trend:
        """Assert that the values rise with the level."""
        return Trend(self, "rises")
