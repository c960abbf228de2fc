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
    steps of the method lie between two reports, numbers are known to multiples of these.

    Args:
        source: the trials.
        condition: what they run.
        curve: its name in the trials' records, such as "success".
        value: to be reached.
        level: on which the trial must train at that report, counted from 0; None for the last.

    Raises:
        UserError: when the value is not finite, or there is no such level.
    """
    levels = condition.task.levels
    wanted = levels - 1 if level is None else level
    if not math.isfinite(value):
        raise UserError(f"{source.label}: a curve is asked when it reaches a finite value, unlike {value}.")
    if not 0 <= wanted < levels:
        raise UserError(f"{source.label} has levels 0 to {levels - 1}, not {wanted}.")
    cost, budget = condition.cost, float(condition.environment_steps)
    chunk = condition.budget.chunk(cost)
    imported = condition.existing is not None
    advice = "" if imported else "give the condition the progression 'whole_budget', or "
    name = f"environment steps until {curve} is {float(value):.12g}" + f" on level {wanted}" * (levels > 1)

    def read(trial: TrialResult) -> float:
        steps = trial.curves[_AXIS]
        on_level = [at == wanted for at in trial.curves["level"]] if levels > 1 else [True] * len(steps)
        reached = (
            at
            for at, found, there in zip(steps, trial.curves[curve], on_level, strict=True)
            if there and found >= value
        )
        first = next(reached, math.inf)
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
