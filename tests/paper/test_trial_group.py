"""What a claim can read from the trials of one condition."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from evoclaims.claims.session import Session
from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.judging.design import FIXED_10
from evoclaims.judging.measure import Event, Measure
from evoclaims.paper.reproduction import Reproduction, Tier, Variant
from evoclaims.paper.trial_group import TrialGroup
from evoclaims.trials.store import Store

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


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("mean_success", (0.0, 0.5, 1.0)),
        ("last_success", (0.0, 0.25, 0.5)),
        ("reward", (-1.0, -0.5, 0.0)),
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
        (lambda g: g.solves_level(1), (0, 0, 1)),
        (lambda g: g.solves_no_level_beyond(-1), (1, 1, 0)),
        (lambda g: g.solves_no_level_beyond(0), (1, 1, 0)),
        (lambda g: g.success_everywhere_is(0.5), (0, 1, 0)),
        (lambda g: g.last_success_is(0.25), (0, 1, 0)),
    ],
)
def test_each_event_holds_where_its_name_says(group: Any, event: Any, held: tuple[int, ...]) -> None:
    made = group(lambda seed: seed / 2)
    assert _read(event(made), made) == held


def test_a_level_that_was_not_trained_on_is_not_solved_by_a_later_one(group: Any) -> None:
    """A trial that goes directly to the last level had solved all levels before it, too."""
    made = group(lambda seed: 1.0)
    (trial,) = made.fetch(range(1))
    direct = replace(trial, levels={**trial.levels, "solved_at": (-1.0, 4.0)})
    events = (made.solves_level(0), made.solves_level(1), made.solves_the_last_level)
    assert [event.sample({made.fingerprint: (direct,)}).values for event in events] == [(0.0,), (1.0,), (1.0,)]


@pytest.mark.parametrize(
    ("event", "said"),
    [
        (lambda g: g.solves_level(-1), "2 levels, counted from 0: .* level -1 .* from 0 to 1"),
        (lambda g: g.solves_level(2), "2 levels, counted from 0: .* level 2 .* from 0 to 1"),
        (lambda g: g.solves_level(0.5), "2 levels, counted from 0: .* level 0.5 .* from 0 to 1"),
        (lambda g: g.solves_no_level_beyond(1), "2 levels, counted from 0: .* level 1 .* from -1 to 0"),
        (lambda g: g.solves_no_level_beyond(-2), "level -2"),
        (lambda g: g.last_success_is(math.nan), "a success's value must be a finite number, not nan"),
        (lambda g: g.success_everywhere_is(math.nan), "a success's value must be a finite number, not nan"),
        (lambda g: g.success_everywhere_is(100), "a success is between 0 and 1, and never reaches 100"),
    ],
)
def test_what_would_always_hold_or_never_is_refused(group: Any, event: Any, said: str) -> None:
    with pytest.raises(UserError, match=said):
        event(group(lambda seed: 1.0))


def test_measures_and_events_have_names_of_their_own_since_fingerprints_hash_them(group: Any) -> None:
    made = group(lambda seed: 1.0)
    measures = [made.mean_success, made.last_success, made.reward, made.furthest_solved, made.furthest_reached]
    events = [
        made.solves_every_level,
        made.solves_the_last_level,
        made.does_not_solve_the_last_level,
        made.solves_level(0),
        made.solves_level(1),
        made.solves_no_level_beyond(0),
        made.solves_no_level_beyond(-1),
        made.success_everywhere_is(0.0),
        made.last_success_is(0.0),
    ]
    names = [thing.name for thing in (*measures, *events, made.success)]
    assert len(set(names)) == len(names)


def test_events_of_two_numbers_have_two_names_however_alike_the_numbers_are(group: Any) -> None:
    made = group(lambda seed: 1.0)
    near, fifth, half = (made.last_success_is(value).describe() for value in (0.833333, 5 / 6, 0.5))
    assert near != fifth
    assert half.endswith("success on the last level is 0.5")
    assert made.success_everywhere_is(0.833333).describe() != made.success_everywhere_is(5 / 6).describe()


def test_a_measure_made_on_the_spot_reads_what_it_is_told_to(group: Any) -> None:
    made = group(lambda seed: seed / 2)
    spent = made.measure("steps spent", lambda trial: trial.metrics["environment_steps"], "lower")
    assert (spent.describe(), spent.better, _read(spent, made)) == (
        "better on small: steps spent",
        "lower",
        (100, 101, 102),
    )
    odd = made.event("has an odd seed", lambda trial: trial.seed % 2 == 1)
    assert (odd.describe(), _read(odd, made)) == ("better on small: has an odd seed", (0, 1, 0))


class Counted(TrialGroup):
    """Trials of a paper that counts steps."""

    @property
    def steps_spent(self) -> Measure:
        return self.measure("steps spent", lambda trial: trial.metrics["environment_steps"])

    @property
    def torn(self) -> Measure:
        return self.condition.nothing  # type: ignore[attr-defined, no-any-return]


def test_a_reproduction_s_own_measures_stand_beside_those_of_every_paper(
    reproduction: Reproduction, store: Store, served: Served
) -> None:
    told = Session(replace(reproduction, trials=Counted), store, served(lambda condition, seed: seed / 2))
    made = told.group("better", "small", "smoke")
    assert isinstance(made, Counted)
    assert _read(made.steps_spent, made) == (100, 101, 102)
    assert _read(made.mean_success, made) == (0.0, 0.5, 1.0)


def test_a_misspelled_measure_lists_the_known_ones(reproduction: Reproduction) -> None:
    made = Counted("better", "small", reproduction.tier("smoke").condition("better", "small"), list)  # type: ignore[arg-type]
    with pytest.raises(UserError) as error:
        made.step_spent  # type: ignore[attr-defined]  # noqa: B018
    said = str(error.value)
    assert said.startswith("There is no measure named 'step_spent'. Did you mean 'steps_spent'? Known: does_not_")
    assert "mean_success" in said
    assert not {"label", "fetch", "fingerprint"} & set(said.rstrip(".").split("Known: ")[1].split(", "))
    assert not hasattr(made, "step_spent")


def test_what_breaks_in_a_measure_is_not_taken_for_a_misspelled_one(reproduction: Reproduction) -> None:
    made = Counted("better", "small", reproduction.tier("smoke").condition("better", "small"), list)  # type: ignore[arg-type]
    with pytest.raises(AttributeError, match="'Condition' object has no attribute 'nothing'"):
        made.torn  # noqa: B018


def test_trials_that_are_none_are_refused(reproduction: Reproduction) -> None:
    with pytest.raises(UserError, match="The reproduction 'tiny' has trials=.* Name a subclass of TrialGroup"):
        replace(reproduction, trials={"stones": len})  # type: ignore[arg-type]


def test_a_variant_is_of_tiers_that_there_are(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="There is no tier for the variant 'other' named 'smok'. Did you mean 'smoke'"):
        Reproduction("tiny", "", tmp_path, {"smoke": Tier({}, FIXED_10)}, variants={"other": Variant("", {"smok": {}})})


def test_what_a_variant_changes_is_of_one_tier_and_the_protocol_itself_changes_nothing(
    reproduction: Reproduction,
) -> None:
    names, one = ("better", "small"), reproduction.tier("smoke").condition("worse", "small")
    varied = replace(reproduction, variants={"worse": Variant("worse", {"smoke": {names: one}})})
    assert varied.changed_by("worse", "smoke") == {names: one}
    assert varied.tier("smoke", "worse").condition(*names) == one
    assert varied.changed_by("worse", "full") == varied.changed_by("", "smoke") == {}
    for variant, tier, said in (("wors", "full", "variant named 'wors'"), ("", "ful", "tier named 'ful'")):
        with pytest.raises(UnknownNameError, match=f"There is no {said}. Did you mean"):
            varied.changed_by(variant, tier)
