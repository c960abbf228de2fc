"""What trials have spent, against their budgets."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from evoclaims.judging.assertion import Assertion
from evoclaims.judging.sample import Trials
from evoclaims.trials.result import TrialResult

TOLERATED: Final = 0.02
"""Share of a budget that may be overspent in silence."""

ALLOWED: Final = 1.0
"""Share of a budget beyond which claims are errors, unless a training loop's `overspend` says another."""


class _Spending(NamedTuple):
    """What a trial has spent of its budget, in environment steps or generations, and the most that it may spend."""

    spent: float
    budget: int
    unit: str
    allowed: float


def _spending(trial: TrialResult) -> _Spending | None:
    """Return what a trial has spent; None for one without a budget, such as an imported one, or that does not say."""
    budget, method = trial.spec.get("budget"), trial.spec.get("method")
    if not isinstance(budget, Mapping):
        return None
    steps, generations = budget.get("environment_steps"), budget.get("generations")
    name, most = ("environment_steps", steps) if steps else ("steps", generations)
    spent = [*trial.curves.get(name, ())[-1:]]
    if steps:  # of a loop whose budget is in generations, the metric may be in environment steps
        spent += [trial.metrics[name]] if name in trial.metrics else []
    if not most or not spent:
        return None
    parameters: Any = method.get("parameters") if isinstance(method, Mapping) else None
    share = parameters.get("overspend", ALLOWED) if isinstance(parameters, Mapping) else ALLOWED
    allowed = share if isinstance(share, int | float) and not isinstance(share, bool) else ALLOWED
    return _Spending(max(spent), most, "environment steps" if steps else "generations", most * (1 + allowed))


def overspent(assertion: Assertion, trials: Trials) -> tuple[str, str]:
    """Return a line on conditions whose trials overspent, and a sentence that refuses one; both empty without any."""
    lines, refusal = [], ""
    for source in assertion.sources():
        found = [(trial, spent) for trial in trials[source.fingerprint] if (spent := _spending(trial)) is not None]
        over = [(trial, spent) for trial, spent in found if spent.spent / spent.budget > 1 + TOLERATED]
        if not over:
            continue
        trial, worst = max(over, key=lambda one: one[1].spent / one[1].budget)
        in_words = f"{worst.spent:,.0f} of {worst.budget:,} {worst.unit}"  # "53,995 of 40,000 environment steps"
        lines.append(f"{len(over)} of {len(found)} trials of {source.label} spent up to {in_words}")
        if worst.spent > worst.allowed and not refusal:
            refusal = (
                f"{source.label} spent {in_words} (seed {trial.seed_in_words}), and at most {worst.allowed:,.0f} "
                "are allowed: end training within the budget, raise the budget (of a method in steps, to a multiple of "
                "its cost), or declare a larger overspend= of the training loop"
            )
    return "; ".join(lines), refusal
