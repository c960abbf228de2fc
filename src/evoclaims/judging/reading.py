"""What is read from each trial of a condition, lazily: a number, an event, or a vector over levels."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, get_args

from evoclaims.core.errors import UnknownNameError, UserError
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


@dataclass(frozen=True, eq=False)
class TrialReading(ABC):
    """Something that can be read from every trial of a condition.

    Attributes:
        source: the condition.
        name: what is read, such as "mean success"; part of the claim's fingerprint, which cannot hash the function.
    """

    source: Source
    name: str

    def describe(self) -> str:
        """Return "condition: name"."""
        return f"{self.source.label}: {self.name}"

    def plain(self) -> dict[str, Any]:
        """Return what the fingerprint hashes."""
        return {"condition": self.source.fingerprint, "name": self.name}

    @abstractmethod
    def of(self, trial: TrialResult) -> float | tuple[float, ...]:
        """Return what is read from one trial, of any status.

        Raises:
            UnreadableTrialError: when a finished trial lacks it, or when it is NaN.
        """


class ScalarReading(TrialReading):
    """One number per trial, or 1 and 0."""

    @abstractmethod
    def of(self, trial: TrialResult) -> float:
        """Return what is read from one trial, of any status; raises as `TrialReading.of` does."""

    def sample(self, trials: Trials) -> Sample:
        """Read every trial of the condition.

        Raises:
            UnreadableTrialError: when a NaN is read from a finished trial.
        """
        mine = trials[self.source.fingerprint]
        return sample(self.describe(), mine, list(map(self.of, mine)))


@dataclass(frozen=True, eq=False)
class NumberReading(ScalarReading):
    """One number per trial.

    Attributes:
        read: reads the number from a finished trial.
        better: "higher" or "lower"; a failed trial gets the worst value, -inf or +inf.
    """

    read: Callable[[TrialResult], float]
    better: Better = "higher"

    def __post_init__(self) -> None:
        """Reject an unknown direction."""
        _worst(self.better)

    def plain(self) -> dict[str, Any]:
        """Return what the fingerprint hashes."""
        return {**super().plain(), "better": self.better}

    def of(self, trial: TrialResult) -> float:
        """Return the number of one trial; the worst value for a failed one."""
        return read_number(trial, self.describe(), self.read, _worst(self.better))


@dataclass(frozen=True, eq=False)
class EventReading(ScalarReading):
    """Something that holds in a trial or does not; it never holds in a failed trial.

    Attributes:
        holds: checks whether it holds in a finished trial.
    """

    holds: Callable[[TrialResult], bool]

    def of(self, trial: TrialResult) -> float:
        """Return 1.0 if the event holds in a trial, else 0.0."""
        return float(not is_failed(trial) and bool(self.holds(checked(trial))))


@dataclass(frozen=True, eq=False)
class LevelsReading(TrialReading):
    """One vector over levels per trial.

    Attributes:
        read: reads the vector from a finished trial, shape [size].
        size: number of levels, at least 2; known beforehand, so that the attainable p is too.
        better: "higher" or "lower"; a failed trial gets the worst value at every level.
    """

    read: Callable[[TrialResult], tuple[float, ...]]
    size: int
    better: Better = "higher"

    def __post_init__(self) -> None:
        """Reject an unknown direction, and a vector with fewer than two levels."""
        _worst(self.better)
        if self.size < 2:
            raise UserError(f"A profile has at least 2 levels; {self.describe()!r} has {self.size}.")

    def plain(self) -> dict[str, Any]:
        """Return what the fingerprint hashes."""
        return {**super().plain(), "size": self.size, "better": self.better}

    def rows(self, trials: Trials) -> tuple[tuple[float, ...], ...]:
        """Read the vector from every trial of the condition, shape [n, size].

        Raises:
            UnreadableTrialError: when a finished trial's vector has NaN or another length.
        """
        return tuple(map(self.of, trials[self.source.fingerprint]))

    def samples(self, trials: Trials) -> tuple[Sample, ...]:
        """Return one sample per level."""
        mine, columns = trials[self.source.fingerprint], zip(*self.rows(trials), strict=True)
        return tuple(sample(f"{self.describe()} at level {at}", mine, column) for at, column in enumerate(columns))

    def of(self, trial: TrialResult) -> tuple[float, ...]:
        """Return the vector of one trial; the worst values for a failed trial."""
        if is_failed(trial):
            return (_worst(self.better),) * self.size
        row = tuple(ranked(float(value), trial, self.describe()) for value in self.read(checked(trial)))
        if len(row) != self.size:
            raise UnreadableTrialError(
                f"{self.describe()} has {len(row)} levels instead of {self.size} in the trial of seed {trial.seed}."
            )
        return row


def _worst(better: Better) -> float:
    """Return the value of a failed trial.

    Raises:
        UnknownNameError: for another direction.
    """
    if better not in get_args(Better):
        raise UnknownNameError("direction of better", better, get_args(Better))
    return -math.inf if better == "higher" else math.inf
