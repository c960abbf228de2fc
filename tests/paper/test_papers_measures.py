"""What the paper under test measures beyond what every paper does."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from evoclaims.core.errors import UserError
from evoclaims.judging.measure import Event, Measure
from evoclaims.judging.window import Window
from evoclaims.paper import references
from reproductions.nisioti2025 import REPRODUCTION
from reproductions.nisioti2025.measures import PaperTrials

CONDITION = REPRODUCTION.tier("smoke").condition("neat", "n_parity")
VISIBLE = CONDITION.task.observation_size + CONDITION.task.action_size


@pytest.fixture
def read(made: Callable[..., Any]) -> Callable[..., tuple[float, ...]]:
    """A function that reads something from trials which have these values of one metric, or at the end of a curve."""

    def values(what: Callable[[PaperTrials], Measure | Event], name: str, given: list[float]) -> tuple[float, ...]:
        trials = [
            replace(trial, metrics={**trial.metrics, name: value}, curves={name: (99.0, value)})
            for seed, value in enumerate(given)
            for trial in [made(CONDITION, seed, 1.0)]
        ]
        group = PaperTrials("neat", "n_parity", CONDITION, lambda condition, seeds: trials)
        return what(group).sample({group.fingerprint: tuple(trials)}).values

    return values


@pytest.mark.parametrize(
    ("what", "name"),
    [
        (lambda g: g.stones, "stones"),
        (lambda g: g.overturned, "upside_down"),
        (lambda g: g.control_cost, "control_cost"),
        (lambda g: g.path_coverage, "coverage"),
        (lambda g: g.archive_coverage, "coverage"),
    ],
)
def test_a_measure_reads_its_own_number(read: Any, what: Any, name: str) -> None:
    assert read(what, name, [0.25, 3.0]) == (0.25, 3.0)


@pytest.mark.parametrize(
    ("what", "worst"),
    [(lambda g: g.stones, -math.inf), (lambda g: g.overturned, math.inf), (lambda g: g.control_cost, math.inf)],
)
def test_a_trial_that_diverged_counts_as_the_worst_robot(
    made: Callable[..., Any], what: Callable[[PaperTrials], Measure], worst: float
) -> None:
    lost = replace(made(CONDITION, 0, 1.0), status="diverged")
    group = PaperTrials("neat", "n_parity", CONDITION, lambda condition, seeds: [lost])
    assert what(group).sample({group.fingerprint: (lost,)}).values == (worst,)


@pytest.mark.parametrize(
    ("what", "name", "given", "held"),
    [
        (lambda g: g.crosses(7), "stones", [6.9, 7.0], (0, 1)),
        (lambda g: g.crosses_at_most(1), "stones", [0.0, 1.0, 1.1], (1, 1, 0)),
        (lambda g: g.passes_at_most(1), "obstacles", [0.0, 1.0, 1.1], (1, 1, 0)),
        (lambda g: g.ends_within(2.0), "distance", [1.9, 2.0, 2.1], (1, 1, 0)),
        (lambda g: g.reaches_the_target, "reached", [0.0, 0.5, 0.6], (0, 0, 1)),
        (lambda g: g.never_reaches_the_target, "reached", [0.0, 0.1], (1, 0)),
        (lambda g: g.has_found_the_target, "reached", [0.0, 1.0], (0, 1)),
        (lambda g: g.champion_is_mostly_hidden, "champion_nodes", [2 * VISIBLE, 2 * VISIBLE + 1], (0, 1)),
        (lambda g: g.champion_is_mostly_input_and_output, "champion_nodes", [2 * VISIBLE, 2 * VISIBLE + 1], (1, 0)),
    ],
)
def test_an_event_holds_where_its_name_says(read: Any, what: Any, name: str, given: Any, held: Any) -> None:
    assert read(what, name, given) == held


@pytest.mark.parametrize(
    "name", ["crosses", "crosses_at_most", "passes_at_most", "ends_within", "is_overturned", "pays"]
)
@pytest.mark.parametrize("number", [math.nan, math.inf])
def test_an_event_at_a_number_that_is_not_finite_is_refused(name: str, number: float) -> None:
    group = PaperTrials("neat", "n_parity", CONDITION, lambda *_: [])
    with pytest.raises(UserError, match=f"must be a finite number, not {number}"):
        getattr(group, name)(number)


def test_steps_to_a_success_of_1_are_those_after_which_the_papers_direct_trials_end() -> None:
    condition = REPRODUCTION.tier("smoke").condition("cma_es", "n_parity_direct")
    trials = references.load(references.path_of(REPRODUCTION.references, "smoke", "cma_es", "n_parity_direct"))
    measure = PaperTrials("cma_es", "n_parity_direct", condition, lambda *_: trials).steps_to("success", 1.0)
    every = condition.budget.chunk(1) * condition.method.cost(condition.task)
    assert measure.window == Window(condition.environment_steps, every)
    assert len(trials) >= 10
    for trial in trials:
        spent = trial.metrics["environment_steps"]
        is_solved = trial.metrics["furthest_solved"] == condition.task.levels - 1
        assert measure.of(trial) == (math.ceil(spent / every) * every if is_solved else math.inf)


def test_no_reward_paid_once_is_compared_with_one_paid_each_step() -> None:
    """In `submission_once` goal-conditioned PPO alone is paid each step."""
    tier = REPRODUCTION.tier("full", "submission_once")
    neat, ppo, goal_ppo = (
        PaperTrials(method, "stones", tier.condition(method, "stones"), lambda *_: ())
        for method in ("neat", "ppo", "goal_ppo")
    )
    assert neat.reward.unit == ppo.reward.unit == neat.reward_in_training.unit == "paid once an episode"
    assert goal_ppo.reward.unit == "paid each step"
    assert (neat.reward_of_a_stone, goal_ppo.reward_of_a_stone) == (1, 1_000)
