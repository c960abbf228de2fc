"""The nouns of a claim: what is read from each trial, lazily, and the assertions that can be made about it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from operator import and_
from typing import Any, Literal, get_args

from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.judging.assertion import Assertion
from evoclaims.judging.kinds.band import Band
from evoclaims.judging.kinds.equivalent import Equivalent
from evoclaims.judging.kinds.every_trial import EveryTrial
from evoclaims.judging.kinds.greater import Greater
from evoclaims.judging.kinds.most_trials import Solves, Stays
from evoclaims.judging.kinds.self_comparison import SelfComparison
from evoclaims.judging.kinds.trend import Trend
from evoclaims.judging.sample import (
    Sample,
    Source,
    Trials,
    UnreadableTrialError,
    checked,
    is_failed,
    ranked,
    read_number,
    sample,
)
from evoclaims.trials.result import TrialResult

Better = Literal["higher", "lower"]


def _worst(better: Better) -> float:
    """Return the value of a failed trial.

    Raises:
        UnknownNameError: for another direction.
    """
    if better not in get_args(Better):
        raise UnknownNameError("direction of better", better, get_args(Better))
    return -math.inf if better == "higher" else math.inf


def _named(source: Source, name: str) -> dict[str, Any]:
    """Return what tells a measure from others; the reading function has no canonical form, so its name must."""
    return {"condition": source.fingerprint, "name": name}


@dataclass(frozen=True, eq=False)
class Measure:
    """One number a trial.

    Attributes:
        source: the condition.
        name: what is measured, such as "mean success"; part of the claim's fingerprint.
        read: finds the number in a finished trial.
        better: "higher" or "lower"; a failed trial takes the worst value, -inf or +inf.
    """

    source: Source
    name: str
    read: Callable[[TrialResult], float]
    better: Better = "higher"

    def __post_init__(self) -> None:
        """Reject an unknown direction."""
        _worst(self.better)

    def describe(self) -> str:
        """Return "condition: name"."""
        return f"{self.source.label}: {self.name}"

    def plain(self) -> dict[str, Any]:
        """Return what the fingerprint hashes."""
        return {**_named(self.source, self.name), "better": self.better}

    def sample(self, trials: Trials) -> Sample:
        """Read the number from every trial of the condition.

        Raises:
            UnreadableTrialError: when a finished trial holds NaN.
        """
        mine, worst = trials[self.source.fingerprint], _worst(self.better)
        return sample(self.describe(), mine, [read_number(t, self.describe(), self.read, worst) for t in mine])

    def __gt__(self, other: Measure) -> Greater:
        """Assert that this measure lies above `other`."""
        return Greater(self, self._comparable(other))

    def __lt__(self, other: Measure) -> Greater:
        """Assert that this measure lies below `other`."""
        return Greater(self._comparable(other), self)

    def between(self, lo: float, hi: float) -> Band:
        """Assert that the median lies in [lo, hi]."""
        return Band(self, lo, hi)

    def equivalent_to(self, other: Measure, *, margin: float) -> Equivalent:
        """Assert that this measure lies within `margin` of `other`."""
        return Equivalent(self, self._comparable(other), margin)

    def never_above_itself(self) -> SelfComparison:
        """Assert, as a control, that the judge finds no difference between halves of these trials."""
        return SelfComparison(self)

    def _comparable(self, other: object) -> Measure:
        """Return `other` if the two can be compared.

        Raises:
            UserError: when it is no measure, or better means the other direction.
        """
        if not isinstance(other, Measure):
            raise UserError(
                f"{self.describe()!r} is compared with another measure, not with {other!r}: "
                "for numbers use between(lo, hi), or an event."
            )
        if other.better != self.better:
            raise UserError(
                f"{self.describe()!r} is better when {self.better}, {other.describe()!r} when {other.better}: "
                "compare measures of one direction."
            )
        return other


@dataclass(frozen=True, eq=False)
class Event:
    """Something that holds in a trial or does not; never in a failed trial, which supports nothing.

    Attributes:
        source: the condition.
        name: what holds, such as "solved every level"; part of the claim's fingerprint.
        holds: looks whether it holds in a finished trial.
    """

    source: Source
    name: str
    holds: Callable[[TrialResult], bool]

    def describe(self) -> str:
        """Return "condition: name"."""
        return f"{self.source.label}: {self.name}"

    def plain(self) -> dict[str, Any]:
        """Return what the fingerprint hashes."""
        return _named(self.source, self.name)

    def sample(self, trials: Trials) -> Sample:
        """Return 1.0 for every trial in which the event holds, 0.0 for the others.

        Raises:
            UnreadableTrialError: when the event looks at a NaN of a finished trial.
        """
        mine = trials[self.source.fingerprint]
        return sample(self.describe(), mine, [float(not is_failed(t) and bool(self.holds(checked(t)))) for t in mine])

    def in_most_trials(self, p0: float | None = None) -> Solves:
        """Assert that it holds with a probability of at least p0 (default: the protocol's): "solves"."""
        return Solves(self, p0)

    def stays(self, p0: float | None = None) -> Stays:
        """Assert that a bound is kept with a probability of at least p0 (default: the protocol's): "stays"."""
        return Stays(self, p0)

    def in_every_trial(self) -> EveryTrial:
        """Assert that it holds in every trial, for deterministic controls: "exact"."""
        return EveryTrial(self)


@dataclass(frozen=True, eq=False)
class Profile:
    """One vector over levels a trial.

    Attributes:
        source: the condition.
        name: what is measured, such as "success"; part of the claim's fingerprint.
        read: finds the vector in a finished trial, shape [size].
        size: number of levels, at least 2; known beforehand, so that the attainable p is too.
        better: "higher" or "lower"; a failed trial has the worst value at every level.
    """

    source: Source
    name: str
    read: Callable[[TrialResult], tuple[float, ...]]
    size: int
    better: Better = "higher"

    def __post_init__(self) -> None:
        """Reject an unknown direction and a profile without levels to compare."""
        _worst(self.better)
        if self.size < 2:
            raise UserError(f"A profile has at least 2 levels; {self.describe()!r} has {self.size}.")

    def describe(self) -> str:
        """Return "condition: name"."""
        return f"{self.source.label}: {self.name}"

    def plain(self) -> dict[str, Any]:
        """Return what the fingerprint hashes."""
        return {**_named(self.source, self.name), "size": self.size, "better": self.better}

    def at(self, level: int) -> Measure:
        """Return the measure at one level, counted from 0.

        Raises:
            UserError: when there is no such level.
        """
        if not 0 <= level < self.size:
            raise UserError(f"{self.describe()!r} has levels 0 to {self.size - 1}, not {level}.")
        return Measure(self.source, f"{self.name} at level {level}", lambda t: self._row(t)[level], self.better)

    def above(self, other: Profile, *, beyond: int) -> Assertion:
        """Assert that this profile lies above `other` at every level beyond a level, counted from 0.

        Raises:
            UserError: when the two differ in their levels, or have none beyond `beyond`.
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

    def rows(self, trials: Trials) -> tuple[tuple[float, ...], ...]:
        """Read the vector from every trial of the condition, shape [n, size].

        Raises:
            UnreadableTrialError: when a finished trial holds NaN, or a vector of another length.
        """
        return tuple(self._row(trial) for trial in trials[self.source.fingerprint])

    def samples(self, trials: Trials) -> tuple[Sample, ...]:
        """Return one record per level."""
        return tuple(self.at(level).sample(trials) for level in range(self.size))

    def _row(self, trial: TrialResult) -> tuple[float, ...]:
        """Return the vector of one trial; a failed trial is worst everywhere."""
        if is_failed(trial):
            return (_worst(self.better),) * self.size
        row = tuple(ranked(float(value), trial, self.describe()) for value in self.read(checked(trial)))
        if len(row) != self.size:
            raise UnreadableTrialError(
                f"{self.describe()} has {len(row)} levels instead of {self.size} in the trial of seed {trial.seed}."
            )
        return row
