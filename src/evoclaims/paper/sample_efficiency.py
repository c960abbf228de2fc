"""How many environment steps a trial needs until one of its training curves reaches a value."""

from __future__ import annotations

import math

from evoclaims.core.errors import UserError
from evoclaims.judging.measure import Measure
from evoclaims.judging.sample import Source, UnreadableTrialError
from evoclaims.judging.window import Window
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition

_AXIS = "environment_steps"


def steps_to(source: Source, condition: Condition, curve: str, value: float, level: int | None = None) -> Measure:
    """Return the environment steps at the first report in which a curve is at least `value` on a level.

    A trial that spends its budget without it is censored there: its number is only known to be larger. Where several
    steps of the method lie between two reports, numbers are known to multiples of these. A level that is solved between
    two reports has reached success 1.

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
    if not math.isfinite(value):
        raise UserError(f"{source.label}: steps_to takes a finite value, not {value}.")
    if curve == "success" and not 0.0 <= value <= 1.0:
        raise UserError(
            f"{source.label}: a success is between 0 and 1, and never reaches {value:g}. Use a value in this range."
        )
    if not 0 <= wanted < levels:
        raise UserError(f"{source.label} has levels 0 to {levels - 1}, not {wanted}.")
    cost, budget = condition.cost, float(condition.environment_steps)
    chunk = condition.budget.chunk(cost)
    imported = condition.existing is not None
    advice = "" if imported else "give the condition the progression 'whole_budget', or "
    name = f"environment steps until {curve} is {float(value):.12g}" + f" on level {wanted}" * (levels > 1)

    def read(trial: TrialResult) -> float:
        steps = trial.curves[_AXIS]
        reports = zip(steps, trial.curves[curve], _trained_levels(trial, levels), strict=True)
        first = next((at for at, found, on in reports if on == wanted and found >= value), math.inf)
        solved = trial.levels.get("solved_at")
        if curve == "success" and solved and solved[wanted] >= 0.0:
            first = min(first, solved[wanted])
        if math.isinf(first) and max(steps, default=0.0) < budget:
            raise UnreadableTrialError(
                f"The trial of seed {trial.seed_in_words} of {source.label} ended after "
                f"{max(steps, default=0.0):,.12g} of {budget:,.12g} environment steps with {curve!r} below {value:g}, "
                "and nobody knows when it would have reached that: "
                f"{advice}ask for a value that ended trials have reached"
            )
        return first

    # Reports of imported trials are perhaps unevenly far apart, at steps that are no multiples of the longest distance.
    window = Window(budget, float(chunk * cost) if chunk > 1 else 0.0, as_reported=imported)
    return Measure(source, name, read, "lower", window)


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
