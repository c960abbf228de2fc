"""What a claim can read from the trials of one condition."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from evoclaims.claims.trial_group import TrialGroup
from evoclaims.judging.measure import Event, Measure
from evoclaims.paper.reproduction import Reproduction

Served = Callable[..., Any]


@pytest.fixture
def group(reproduction: Reproduction, served: Served) -> Callable[[Callable[[int], float]], TrialGroup]:
    """A function that makes the group "better on small" from `value(seed)`."""

    def make(value: Callable[[int], float]) -> TrialGroup:
        condition = reproduction.tier("smoke").condition("better", "small")
        return TrialGroup("better", "small", condition, served(lambda condition, seed: value(seed)))

    return make


def _read(what: Measure | Event, group: TrialGroup, n: int = 3) -> tuple[float, ...]:
    return what.sample({group.fingerprint: tuple(group.fetch(range(n)))}).values


def test_a_group_is_named_as_the_claim_asked_for_it(group: Any) -> None:
    made = group(lambda seed: 1.0)
    assert (made.label, made.fingerprint) == ("better on small", made.condition.id)


def test_no_trial_is_fetched_before_a_verdict_needs_it(reproduction: Reproduction) -> None:
    def refuse(*asked: Any) -> Any:
        raise AssertionError("fetched")

    made = TrialGroup("better", "small", reproduction.tier("smoke").condition("better", "small"), refuse)
    assert made.mean_success.between(0.0, 1.0).describe()
    assert made.solves_every_level.in_most_trials().describe()


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("mean_success", (0.0, 0.5, 1.0)),
        ("last_success", (0.0, 0.25, 0.5)),
        ("furthest_solved", (-1.0, -1.0, 1.0)),
        ("furthest_reached", (1.0, 1.0, 1.0)),
    ],
)
def test_each_measure_reads_its_own_number(group: Any, name: str, values: tuple[float, ...]) -> None:
    made = group(lambda seed: seed / 2)
    assert _read(getattr(made, name), made) == values


@pytest.mark.parametrize(
    ("event", "held"),
    [
        (lambda g: g.solves_every_level, (0, 0, 1)),
        (lambda g: g.solves_the_last_level, (0, 0, 1)),
        (lambda g: g.does_not_solve_the_last_level, (1, 1, 0)),
        (lambda g: g.solves_level(0), (0, 0, 1)),
        (lambda g: g.solves_level(-1), (1, 1, 1)),
        (lambda g: g.solves_no_level_beyond(0), (1, 1, 0)),
        (lambda g: g.solves_no_level_beyond(1), (1, 1, 1)),
        (lambda g: g.success_everywhere_is(0.5), (0, 1, 0)),
    ],
)
def test_each_event_holds_where_its_name_says(group: Any, event: Any, held: tuple[int, ...]) -> None:
    made = group(lambda seed: seed / 2)
    assert _read(event(made), made) == held


def test_a_champion_is_mostly_hidden_when_more_than_half_of_its_nodes_are(group: Any) -> None:
    made = group(lambda seed: 1.0)
    visible = made.condition.task.observation_size + made.condition.task.action_size
    trial = made.fetch([0])[0]
    last = [2 * visible + more for more in (-1, 0, 1)]
    grown = [replace(trial, seed=seed, curves={"champion_nodes": (99.0, float(n))}) for seed, n in enumerate(last)]
    assert made.champion_is_mostly_hidden.sample({made.fingerprint: tuple(grown)}).values == (0, 0, 1)
    assert made.champion_is_mostly_input_and_output.sample({made.fingerprint: tuple(grown)}).values == (1, 1, 0)


def test_the_success_of_a_level_can_be_compared_with_another(group: Any) -> None:
    made = group(lambda seed: seed / 2)
    assert made.success.size == 2
    assert _read(made.success.at(1), made) == (0.0, 0.5, 1.0)


def test_measures_and_events_have_names_of_their_own_since_fingerprints_hash_them(group: Any) -> None:
    made = group(lambda seed: 1.0)
    measures = [made.mean_success, made.last_success, made.furthest_solved, made.furthest_reached]
    events = [
        made.solves_every_level,
        made.solves_the_last_level,
        made.does_not_solve_the_last_level,
        made.champion_is_mostly_hidden,
        made.champion_is_mostly_input_and_output,
        made.solves_level(0),
        made.solves_level(1),
        made.solves_no_level_beyond(0),
        made.solves_no_level_beyond(1),
        made.success_everywhere_is(0.0),
    ]
    names = [thing.name for thing in (*measures, *events, made.success)]
    assert len(set(names)) == len(names)
