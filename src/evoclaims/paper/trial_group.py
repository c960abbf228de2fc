"""The trials of one condition, with the measures that claims use."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any

from evoclaims.core.errors import UnknownNameError, UserError, require_finite, require_known
from evoclaims.judging.measure import Event, Measure, Profile
from evoclaims.judging.reading import Better
from evoclaims.judging.sample import Source, UnreadableTrialError, alike
from evoclaims.judging.window import Window
from evoclaims.trials.result import RETURNED, TRAINED_BY, TrialResult
from evoclaims.trials.spec import Condition

_AXIS = "environment_steps"


def steps_to(source: Source, condition: Condition, curve: str, value: float, level: int | None = None) -> Measure:
    """Return the environment steps at the first report in which a curve is at least `value` on a level.

    Of a training loop with a budget in generations, which its reports count, return these. A trial that spends its
    budget without it is censored there: its number is only known to be larger. Where several steps of the method lie
    between two reports, numbers are known to multiples of these. A level that is solved between two reports has reached
    success 1.

    Args:
        source: the trials.
        condition: what they run.
        curve: its name in the trials' records, such as "success".
        value: to be reached.
        level: on which the trial must train at that report, counted from 0; None for the last.

    Raises:
        UserError: when the value is not finite, or a success that none can be, or there is no such level.
    """
    levels = condition.task.levels
    wanted = levels - 1 if level is None else level
    require_finite(f"{source.label}: the", value=value)
    if curve == "success":
        _require_success(source.label, value)
    if not 0 <= wanted < levels:
        raise UserError(f"{source.label} has no level {wanted}. Use one from 0 to {levels - 1}.")
    budget = float(condition.environment_steps)
    imported = bool(condition.existing)
    advice = "" if imported else "give the condition the progression 'whole_budget', or "
    every = max(condition.report_distance, 1)
    counted = "environment steps"
    if condition.loop and condition.budget.generations is not None:
        counted = "generations"  # it reports in its budget's unit
    name = f"{counted} until {curve} is {float(value):.12g}" + f" on level {wanted}" * (levels > 1)

    def last_before(trial: TrialResult, step: float) -> float:
        return max((at for at in trial.curves[_AXIS] if at < step), default=0.0)

    def before(trial: TrialResult) -> float:
        return last_before(trial, read(trial))

    def read(trial: TrialResult) -> float:
        steps = trial.curves[_AXIS]
        reports = zip(steps, trial.curves[curve], _trained_levels(trial, levels), strict=True)
        reached = (at for at, found, on in reports if on == wanted and (found >= value or _is(found, value)))
        first = next(reached, math.inf)
        solved = trial.levels.get("solved_at")
        if curve == "success" and solved and solved[wanted] >= 0.0:
            first = min(first, solved[wanted])
        if math.isinf(first) and max(steps, default=0.0) < budget:
            raise UnreadableTrialError(
                f"The trial of seed {trial.seed_in_words} of {source.label} ended after "
                f"{max(steps, default=0.0):,.12g} of {budget:,.12g} {counted} with {curve!r} below {value:g}, "
                "and nobody knows when it would have reached that: "
                f"{advice}ask for a value that ended trials have reached"
            )
        last = last_before(trial, first)
        if condition.loop and first - last > 2 * every and not math.isinf(first):  # it reports when it likes
            raise UnreadableTrialError(
                f"The trial of seed {trial.seed_in_words} of {source.label} reports nothing between {last:,.12g} and "
                f"{first:,.12g} {counted}, where {curve!r} reaches {value:g}, and its budget has reports "
                f"{every:,} apart: call report(...) as often, or give all compared conditions fewer reports"
            )
        return first

    # Reports of imported trials are perhaps unevenly far apart, at steps that are no multiples of the longest distance.
    window = Window(budget, float(condition.report_distance), imported, condition.report_steps)
    return Measure(source, name, read, "lower", window, f"in {counted}", before=before if window.every else None)


def _is(found: float, value: float) -> bool:
    """Whether a number is a value: a whole one exactly, since a level is solved at exactly 1."""
    return found == value or (not float(value).is_integer() and alike(found, value))


def _metric(name: str, trial: TrialResult) -> float:
    """Return a metric of a finished trial.

    Raises:
        UnreadableTrialError: when a training loop has counted generations, and environment steps are asked for.
    """
    made: Mapping[str, Any] = getattr(trial, "provenance", {})  # what stands for a trial may have numbers alone
    if name == _AXIS and not made.get(RETURNED, {}).get("counts_steps", True):
        raise UnreadableTrialError(
            f"The training loop {made[TRAINED_BY]} has a budget in generations, and returned no {name!r} "
            f"for the trial of seed {trial.seed_in_words}. Let it return them, or compare its measure('steps', "
            "better='lower') with that of another such loop"
        )
    return trial.metrics[name]


def _require_success(label: str, value: float) -> None:
    """Reject a success outside 0 to 1: an event at it would never hold."""
    require_finite(f"{label}: a success's", value=value)
    if not 0.0 <= value <= 1.0:
        raise UserError(
            f"{label}: a success is between 0 and 1, and never reaches {value:g}. Use a value in this range."
        )


def _trained_levels(trial: TrialResult, levels: int) -> list[float]:
    """Return the level that each report of a trial is about.

    A report has the level after its last step; if this step solved a level, its success and fitness are of that one.
    """
    steps, solved = trial.curves[_AXIS], trial.levels.get("solved_at")
    if levels == 1:
        return [0.0] * len(steps)
    reported = trial.curves["level"]
    if not solved:  # of a trial that has not ended as it should, or that was made elsewhere
        return list(reported)
    pairs = zip(reported, steps, strict=True)
    return [level - 1.0 if level > 0.0 and solved[int(level) - 1] == at else level for level, at in pairs]


Fetch = Callable[[Condition, Sequence[int]], Sequence[TrialResult]]


class UnknownMeasureError(UnknownNameError, AttributeError):
    """A misspelled measure; an `AttributeError` too, so that `hasattr` works."""


@dataclass(frozen=True, eq=False)
class TrialGroup:
    """Trials that are run only when a verdict needs them, and the measures of each.

    Here are the measures of every method and task. A paper adds its own in a subclass, which its reproduction
    names: `Reproduction(trials=...)`. Names of measures and events are hashed into claims' fingerprints.

    Attributes:
        method, task: the names by which a claim asked for them.
        condition: what is run.
        get: runs trials, or reads them from the store.
    """

    method: str
    task: str
    condition: Condition
    get: Fetch = field(repr=False)

    if not TYPE_CHECKING:  # a type checker knows the measures, and finds misspelled ones by itself

        def __getattr__(self, name: str) -> Any:
            """Raise an error that lists the known measures."""
            if name.startswith("_") or hasattr(type(self), name):
                return object.__getattribute__(self, name)  # raises what the property itself has raised
            known = {known for known in dir(type(self)) if not known.startswith("_")} - set(dir(Source))
            raise UnknownMeasureError("measure", name, known)

    @property
    def label(self) -> str:
        """A short name, such as "cma_es on n_parity"."""
        return f"{self.method} on {self.task}"

    @property
    def fingerprint(self) -> str:
        """The condition's id."""
        return self.condition.id

    @property
    def deterministic(self) -> bool:
        """Whether the method says that it draws nothing, so that its trials may be copies of each other."""
        return bool(getattr(self.condition.method, "deterministic", False))

    def fetch(self, seeds: Sequence[int]) -> Sequence[TrialResult]:
        """Return one trial per seed."""
        return self.get(self.condition, seeds)

    @property
    def existing(self) -> float:
        """How many trials there can be; infinite where missing ones are run."""
        return len(self.condition.existing) or math.inf

    @property
    def table_rows(self) -> frozenset[tuple[str, int]]:
        """The rows of a table that the trials are read from."""
        return self.condition.table_rows

    def measure(
        self,
        name: str,
        read: Callable[[TrialResult], float] | None = None,
        better: Better = "higher",
        unit: str = "",
    ) -> Measure:
        """A custom measure, such as `measure("steps", lambda t: t.metrics["steps"], "lower")`.

        Without `read` it is the metric with this name: `measure("steps", better="lower")`. Measures with different
        units are not compared.

        Raises:
            UnknownNameError: for a metric that imported trials do not have. Other trials have to run first: then a
                missing metric makes the claim an error.
        """
        if read is None and self.condition.existing:
            require_known(f"metric of {self.label}", name, self.condition.existing[0].metrics)
        return Measure(self, name, read or partial(_metric, name), better, unit=unit)

    def event(self, name: str, holds: Callable[[TrialResult], bool], **numbers: float) -> Event:
        """A custom event, such as `event("is fast", lambda t: t.metrics["steps"] < 100)`.

        Raises:
            UserError: when one of `numbers`, those that `holds` compares with, is not finite: it would never hold, or
                always.
        """
        require_finite(f"{self.label}: the event's", **numbers)
        return Event(self, name, holds)

    @property
    def success(self) -> Profile:
        """Success of the final policy on each level."""
        return Profile(self, "success", lambda t: t.levels["success"], self.condition.task.levels)

    @property
    def mean_success(self) -> Measure:
        """Success of the final policy, averaged over the levels."""
        return self.measure("mean success over levels", lambda t: t.metrics["mean_success"])

    @property
    def last_success(self) -> Measure:
        """Success of the final policy on the last level."""
        return self.measure("success on the last level", lambda t: t.metrics["last_success"])

    @property
    def reward(self) -> Measure:
        """Episode reward of the final policy on the last level, averaged over the examination's episodes."""
        return self.measure("episode reward", lambda t: t.metrics["last_fitness"])

    @property
    def furthest_solved(self) -> Measure:
        """Highest level solved while training, or -1."""
        return self.measure("furthest level solved", lambda t: t.metrics["furthest_solved"])

    @property
    def furthest_reached(self) -> Measure:
        """Highest level trained on."""
        return self.measure("furthest level reached", lambda t: t.metrics["furthest_reached"])

    @property
    def environment_steps(self) -> Measure:
        """Environment steps that the trial has spent: fewer than the budget if it ended early."""
        return self.measure("environment steps", partial(_metric, _AXIS), "lower")

    def steps_to(self, curve: str, value: float, level: int | None = None) -> Measure:
        """Environment steps at the first report at which a training curve has at least `value`.

        Only reports count in which the trial trains on `level`, counted from 0 (default: the last).
        """
        return steps_to(self, self.condition, curve, value, level)

    @property
    def solves_every_level(self) -> Event:
        """The final policy is right on every row of every level."""
        return self.success_everywhere_is(1.0)

    @property
    def solves_the_last_level(self) -> Event:
        """The last level was solved while training."""
        last = self.condition.task.levels - 1
        return self.event("solves the last level", lambda t: t.metrics["furthest_solved"] == last)

    @property
    def does_not_solve_the_last_level(self) -> Event:
        """The last level was never solved."""
        last = self.condition.task.levels - 1
        return self.event("does not solve the last level", lambda t: t.metrics["furthest_solved"] < last)

    def solves_level(self, level: int) -> Event:
        """This level, counted from 0, was solved while training."""
        self._require_level(level, 0, self.condition.task.levels - 1)

        def solved(trial: TrialResult) -> bool:
            at = trial.levels.get("solved_at")
            return bool(at[level] >= 0.0 if at else trial.metrics["furthest_solved"] >= level)

        return self.event(f"solves level {level}", solved)

    def solves_no_level_beyond(self, level: int) -> Event:
        """No level above `level` (counted from 0; -1 for none at all) was solved while training."""
        self._require_level(level, -1, self.condition.task.levels - 2)
        return self.event(f"solves no level beyond {level}", lambda t: t.metrics["furthest_solved"] <= level)

    def _require_level(self, level: int, first: int, last: int) -> None:
        """Reject what is no level, and a level about which an event would always hold, or never."""
        if level not in range(first, last + 1):
            raise UserError(
                f"{self.label} has {self.condition.task.levels} levels, counted from 0: an event at level {level} "
                f"would always hold, or never. Use a level from {first} to {last}."
            )

    def last_success_is(self, value: float) -> Event:
        """The final policy's success on the last level is exactly `value`."""
        _require_success(self.label, value)
        return self.event(
            f"success on the last level is {_exact(value)}", lambda t: _is(t.metrics["last_success"], value)
        )

    def success_everywhere_is(self, value: float) -> Event:
        """The final policy's success is exactly `value` on every level."""
        _require_success(self.label, value)
        name = "solves every level" if value == 1.0 else f"success is {_exact(value)} on every level"
        return self.event(name, lambda t: all(_is(x, value) for x in t.levels["success"]))


def _exact(value: float) -> str:
    """Return a number as briefly as it stays what it is: an event's name stands for it in fingerprints."""
    brief = f"{value:g}"
    return brief if float(brief) == value else repr(float(value))
