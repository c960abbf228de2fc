"""What is read from each trial of a condition, lazily: a number, an event, or a vector over levels."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, Final, Literal, Self, TypeVar, get_args

import numpy as np

from evoclaims.core.errors import UserError, require_known
from evoclaims.judging.sample import (
    Sample,
    Source,
    Trials,
    UnreadableTrialError,
    beyond,
    checked,
    is_failed,
    ranked,
    read_number,
    sample,
)
from evoclaims.judging.window import EVERYTHING, Window, shared
from evoclaims.trials.result import TrialResult

Better = Literal["higher", "lower"]

_ROUNDING: Final = 1e-9
"""A share of the distance between reports that numbers may be off by."""


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
        window: how far and how finely values are observed.
        unit: what the number counts, such as "in metres"; empty where nothing is known. Two units are not compared.
        refusal: why it is not read from any trial; empty if it is.
        before: reads what the number is surely above, such as the step of the report before; None for exact numbers.
    """

    read: Callable[[TrialResult], float]
    better: Better = "higher"
    window: Window = EVERYTHING
    unit: str = ""
    refusal: str = ""
    before: Callable[[TrialResult], float] | None = None

    def __post_init__(self) -> None:
        """Reject an unknown direction."""
        _worst(self.better)

    @property
    def is_censored(self) -> bool:
        """Whether large values are only known to be large."""
        return math.isfinite(self.window.limit)

    def describe(self) -> str:
        """Return "condition: name", and how far values are observed."""
        return super().describe() + f", within {self.window.limit:,.12g}" * self.is_censored

    def plain(self) -> dict[str, Any]:
        """Return what the fingerprint hashes."""
        seen = {} if self.window == EVERYTHING else {"limit": self.window.limit, "every": self.window.every}
        return {**super().plain(), "better": self.better, **seen}

    def seen_through(self, window: Window) -> Self:
        """Return this reading as it is observed through a window no wider and no finer than its own."""
        return self if window == self.window else replace(self, window=window)

    def require_seen(self, number: float) -> None:
        """Reject an assertion about a number beyond what is observed, or between two multiples.

        Raises:
            UserError: when there is a limit, and the number is above it; or when it lies between two multiples.
        """
        if number > self.window.limit:
            raise UserError(
                f"{self.describe()!r} is not observed beyond that, so trials show nothing about "
                f"{number:,.12g}. Name a smaller number, or raise the budget."
            )
        every, above = self.window.every, self.window.seen(number)
        if number > 0 and above - number > _ROUNDING * every:  # a trial below the number may count as one above it
            raise UserError(
                f"{self.describe()!r} is known to multiples of {every:,.12g}, so trials show nothing about "
                f"{number:,.12g}. Name {math.floor(number / every) * every:,.12g} or {above:,.12g}, or let trials have "
                "more reports."
            )

    def sample(self, trials: Trials) -> Sample:
        """Read every trial of the condition, as far as its numbers are observed."""
        return replace(super().sample(trials), limit=self.window.limit if self.is_censored else None)

    def of(self, trial: TrialResult) -> float:
        """Return the number of one trial, as far as it is observed; the worst value for a failed one."""
        if self.refusal:
            raise UnreadableTrialError(self.refusal)
        return self.window.seen(self._number(trial))

    def _number(self, trial: TrialResult) -> float:
        return read_number(trial, self.describe(), self.read, _worst(self.better))

    def signs(self, trials: Trials, number: float) -> list[int | None]:
        """Return of each trial whether its number is above another one (1), at it (0) or below (-1).

        None where that is not known: `number` lies between two of the trial's reports.
        """

        def sign(trial: TrialResult) -> int | None:
            above, before = beyond(self.of(trial), number), self.before if self.window.every else None
            if before and above > 0 and not is_failed(trial) and beyond(before(checked(trial)), number) < 0:
                return None
            return int(above > 0) - int(above < 0)

        return [sign(trial) for trial in trials[self.source.fingerprint]]

    def is_shown(self, trials: Trials) -> bool:
        """Whether each trial's number is known as finely as the window has it."""
        if (before := self.before) is None or not self.window.every:
            return True
        done = (trial for trial in trials[self.source.fingerprint] if not is_failed(trial))
        return all(self.window.shows(before(checked(trial)), self._number(trial)) for trial in done)

    def spans(self, trials: Trials) -> tuple[list[float], list[float]]:
        """Return what each trial's number is at least, and at most; numbers beyond the limit are infinite."""
        limit, least, most = self.window.limit, [], []
        for trial in trials[self.source.fingerprint]:
            number = self._number(trial)
            known = number if self.before is None or is_failed(trial) else self.before(checked(trial))
            most.append(number if number <= limit else math.inf)
            least.append(math.inf if known >= limit and number > limit else math.nextafter(known, number))
        return least, most


AnyNumber = TypeVar("AnyNumber", bound=NumberReading)


def comparable(*readings: AnyNumber) -> tuple[AnyNumber, ...]:
    """Return readings whose values can be ranked together: seen as far and as finely as all of them are.

    Numbers of two units cannot: reading them makes the verdict an error. A variant may change the unit of one side, and
    the claim's other readings are judged all the same.

    Raises:
        UserError: when one is better higher and another lower, or they see nothing in common.
    """
    first = readings[0]
    for other in readings[1:]:
        if other.better != first.better:
            raise UserError(
                f"{first.describe()!r} is better when {first.better}, {other.describe()!r} when "
                f"{other.better}. Compare measures of one direction."
            )
    window = shared([reading.window for reading in readings])
    seen = tuple(reading.seen_through(window) for reading in readings)
    if len({reading.unit for reading in readings if reading.unit}) < 2:
        return seen
    units = " and ".join(f"{reading.describe()} ({reading.unit or 'of an unknown unit'})" for reading in readings)
    refusal = f"{units} are not compared: their numbers have different units"
    return tuple(replace(reading, refusal=refusal, unit="") for reading in seen)


def require_independent(*readings: NumberReading) -> None:
    """Reject measures that no rank test may compare: it assumes independent samples that are observed alike.

    Raises:
        UserError: when two read the same trials, have two units, or are not observed equally far and finely.
    """
    for one, other in combinations(readings, 2):
        a, b = one.source, other.source
        if a.fingerprint == b.fingerprint or a.table_rows & b.table_rows:
            raise UserError(
                f"{one.describe()!r} and {other.describe()!r} read the same trials, which a rank test "
                "cannot compare. Use a profile's falls() or rises() for levels, never_above_itself() for "
                "a control."
            )
        if one.window != other.window or (one.unit and other.unit and one.unit != other.unit):
            differ = "are not observed up to the same limit" if one.window != other.window else "have different units"
            raise UserError(f"{one.describe()!r} and {other.describe()!r} {differ}. Write a < b, which handles this.")


@dataclass(frozen=True, eq=False)
class EventReading(ScalarReading):
    """Something that holds in a trial or does not; it never holds in a failed trial.

    Attributes:
        holds: checks whether it holds in a finished trial.
    """

    holds: Callable[[TrialResult], bool]

    def of(self, trial: TrialResult) -> float:
        """Return 1.0 if the event holds in a trial, else 0.0.

        Raises:
            UnreadableTrialError: when `holds` gives something else than True or False, such as a number or nothing.
        """
        if is_failed(trial):
            return 0.0
        held: object = self.holds(checked(trial))
        if not isinstance(held, bool | np.bool_):
            raise UnreadableTrialError(
                f"{self.describe()!r} is {held!r} in the trial of seed {trial.seed_in_words}, neither True nor "
                "False. Let the event's function return a comparison, such as lambda t: "
                "t.metrics['steps'] > 5."
            )
        return float(held)


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
            raise UserError(
                f"{self.describe()!r} has {self.size} levels, and a profile needs at least 2. Use last_success instead."
            )

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
    """Return the value of a failed trial, after checking the direction."""
    require_known("direction of better", better, get_args(Better))
    return -math.inf if better == "higher" else math.inf
