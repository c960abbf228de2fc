"""What trials spend against their budgets: in silence up to 2%, named beyond it, refused beyond what is allowed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from evoclaims.core.errors import UserError
from evoclaims.envs.gates.parity import NParity
from evoclaims.judging.design import FIXED_10
from evoclaims.judging.judge import judge
from evoclaims.judging.verdict import Outcome
from evoclaims.methods.training_loop import TrainingLoop
from evoclaims.trials.spec import Budget, Condition


def trained(**further: Any) -> Condition:
    """Return a condition of a training loop."""
    loop = TrainingLoop("loops:one", packages=(), **further)
    return Condition(loop, NParity(3), "whole_budget", Budget(environment_steps=100))


def _spending(source: Any, spent: list[float], reported: float = 0.0, **parameters: Any) -> Any:
    """Return a source of ten trials with a budget of 1,000 environment steps."""
    made = source("a", [float(n) for n in range(10, 20)])
    spec = {"budget": {"environment_steps": 1000, "generations": None}, "method": {"parameters": parameters}}
    for seed, trial in made.trials.items():
        metrics = {**trial.metrics, "environment_steps": spent[seed % len(spent)]}
        curves = {"environment_steps": (10.0, reported)} if reported else {}
        made.trials[seed] = replace(trial, metrics=metrics, curves=curves, spec=spec)
    return made


@pytest.mark.parametrize(
    ("spent", "reported", "parameters", "outcome", "words"),
    [
        ([1000, 1020], 0, {}, "supported", ""),
        ([1000, 1021], 0, {}, "supported", "5 of 10 trials of a spent up to 1,021 of 1,000 environment steps"),
        ([2000], 0, {}, "supported", "10 of 10 trials of a spent up to 2,000 of 1,000 environment steps"),
        ([2001], 0, {}, "error", "a spent 2,001 of 1,000 environment steps (seed 0), and at most 2,000 are allowed"),
        ([10_000], 0, {}, "error", "a spent 10,000 of 1,000"),
        ([900], 10_000, {}, "error", "a spent 10,000 of 1,000"),  # what it returns does not hide what it reported
        ([9_000], 0, {"overspend": 9.0}, "supported", "10 of 10 trials of a spent up to 9,000"),
        ([1_600], 0, {"overspend": 0.5}, "error", "at most 1,500 are allowed"),
    ],
)
def test_what_is_overspent_is_named_or_refused(source, spent, reported, parameters, outcome, words) -> None:  # type: ignore[no-untyped-def]
    verdict = judge(_spending(source, spent, reported, **parameters).score() > 5.0, FIXED_10)
    assert verdict.outcome == outcome
    assert words in (verdict.reason if verdict.outcome is Outcome.ERROR else verdict.overspent)
    assert bool(words) == bool(verdict.overspent or verdict.outcome is Outcome.ERROR)


def test_overspend_is_part_of_a_trials_id_only_where_it_is_set() -> None:
    plain = trained()
    assert "overspend" not in plain.plain["method"]["parameters"]
    assert trained(overspend=1.0).id == plain.id
    assert trained(overspend=2.0).id != plain.id
    assert trained(overspend=2).id == trained(overspend=2.0).id


@pytest.mark.parametrize("share", [-0.1, float("nan"), True, "1"])
def test_an_overspend_that_is_no_share_is_refused(share: Any) -> None:
    with pytest.raises(UserError, match="is not a share of its budget, 0 or above"):
        trained(overspend=share)


def test_trials_without_a_budget_say_nothing_of_it(source) -> None:  # type: ignore[no-untyped-def]
    assert judge(source("a", [9.0] * 10).score() > 5.0, FIXED_10).overspent == ""
