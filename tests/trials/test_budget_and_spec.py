"""What a trial is: budgets, conditions and specifications, and the ids that follow from them."""

from __future__ import annotations

import math
import os
import re
import subprocess
import sys
from dataclasses import dataclass, make_dataclass, replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoclaims.core.canonical import require_numbers
from evoclaims.core.errors import UserError
from evoclaims.envs.ecorobot.stones import SteppingStones
from evoclaims.envs.gates.alu import SimpleAlu
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.cma_es import CmaEs
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.methods.neat.evolution import Neat
from evoclaims.methods.neat.settings import Settings, Species
from evoclaims.methods.ppo import Ppo
from evoclaims.methods.random_search import RandomSearch
from evoclaims.methods.training_loop import TrainingLoop
from evoclaims.networks.all_skips import AllSkips
from evoclaims.networks.mlp import Mlp
from evoclaims.trials.spec import Budget, Condition, TrialSpec

METHOD, TASK, BUDGET = RandomSearch(8, network=AllSkips(hidden=2)), NParity(3), Budget(generations=4)
CONDITION = Condition(METHOD, TASK, "curriculum", BUDGET)


class _Revised(RandomSearch):
    revision = RandomSearch.revision + 1  # type: ignore[misc]


class _RevisedTask(NParity):
    revision = NParity.revision + 1  # type: ignore[misc]


@pytest.mark.parametrize(
    "lengths",
    [
        {},
        {"generations": 1, "environment_steps": 1},
        {"generations": 0},
        {"environment_steps": -5},
        {"generations": 1, "reports": 0},
    ],
)
def test_a_budget_of_no_length_or_two_is_refused_in_a_sentence_that_shows_it(lengths: dict[str, int]) -> None:
    with pytest.raises(UserError, match="exactly one of generations and environment_steps.*generations=") as caught:
        Budget(**lengths)
    assert "\n" not in str(caught.value)


@given(st.integers(1, 10**9), st.integers(1, 10**6), st.integers(1, 200))
def test_environment_steps_are_rounded_up_to_whole_steps_and_reports_cover_them(
    length: int, cost: int, reports: int
) -> None:
    budget = Budget(environment_steps=length, reports=reports)
    steps = budget.steps(cost)
    assert steps * cost >= length > (steps - 1) * cost
    assert (budget.chunk(cost) * reports) >= steps > budget.chunk(cost) * reports - reports
    assert Budget(generations=length).steps(cost) == length


def test_a_condition_counts_the_environment_steps_of_whole_steps() -> None:
    learned = replace(CONDITION, budget=Budget(environment_steps=65))
    assert (CONDITION.steps, CONDITION.environment_steps) == (4, 4 * 8 * 8)
    assert (learned.steps, learned.environment_steps) == (2, 128)


@pytest.mark.parametrize("progression", ["curiculum", "", "DIRECT"])
def test_an_unknown_progression_is_a_sentence_with_the_known_ones(progression: Any) -> None:
    with pytest.raises(UserError, match=r"There is no progression named .*Known: curriculum, direct, whole_budget\."):
        Condition(METHOD, TASK, progression, BUDGET)


@pytest.mark.parametrize("seed", [-1, 2**31])
def test_a_seed_that_the_device_cannot_hold_is_refused_in_a_sentence(seed: int) -> None:
    with pytest.raises(UserError, match=f"A seed .*not {seed}"):
        TrialSpec(CONDITION, seed)


OTHERS = {
    "population": replace(CONDITION, method=replace(METHOD, population=9)),
    "standard deviation": replace(CONDITION, method=replace(METHOD, std=0.5)),
    "network's size": replace(CONDITION, method=replace(METHOD, network=AllSkips(hidden=3))),
    "network": replace(CONDITION, method=replace(METHOD, network=Mlp(layers=(2,)))),
    "method's revision": replace(CONDITION, method=_Revised(8, network=AllSkips(hidden=2))),
    "method": replace(CONDITION, method=HandBuilt()),
    "method's name": replace(CONDITION, method=HandBuilt(negated=True)),
    "task's size": replace(CONDITION, task=NParity(4)),
    "sampling": replace(CONDITION, task=NParity(3, "sampled")),
    "task's revision": replace(CONDITION, task=_RevisedTask(3)),
    "task": replace(CONDITION, task=SimpleAlu(level_count=2)),
    "progression": replace(CONDITION, progression="direct"),
    "generations": replace(CONDITION, budget=Budget(generations=5)),
    "unit of the budget": replace(CONDITION, budget=Budget(environment_steps=4)),
    "reports": replace(CONDITION, budget=Budget(generations=4, reports=49)),
}


@pytest.mark.parametrize(
    ("body", "what"),
    [
        ({"name": "mine"}, r"Mine has no revision, .*\. Write `revision: ClassVar\[int\] = …`"),
        (
            {"name": "mine", "revision": "1"},
            r"Mine has '1' as its revision, .*\. Write `revision: ClassVar\[int\] = …`",
        ),
        ({"name": "mine", "revision": 1}, r"Mine is not a dataclass. Write @dataclass\(frozen=True\)"),
    ],
)
def test_what_a_method_lacks_to_be_told_apart_is_a_sentence(body: dict[str, Any], what: str) -> None:
    with pytest.raises(UserError, match=what):
        _ = Condition(type("Mine", (), body)(), NParity(3), "direct", Budget(generations=1)).id


@pytest.mark.parametrize(
    ("functions", "what"),
    [
        (
            "init step cost",
            "Mine has no function best. Write `def best(self, …)` in it. A method has init, step, best, ",
        ),
        ("step", "Mine has no function init and no best and no cost. Write `def init(self, …)` in it. A method has "),
    ],
)
def test_a_method_that_lacks_a_function_is_a_sentence(functions: str, what: str) -> None:
    has = {"name": "mine", "revision": 1, **dict.fromkeys(functions.split(), print)}
    mine: Any = make_dataclass("Mine", [], namespace=has, frozen=True)
    with pytest.raises(UserError, match=re.escape(what)):
        _ = replace(CONDITION, method=mine()).id


_TASK: dict[str, Any] = {
    **{"name": "mine", "revision": 1, "levels": 1, "observation_size": 1, "action_size": 1, "horizon": 1},
    **dict.fromkeys(("reset", "step", "episode", "examine"), print),
}


@pytest.mark.parametrize(
    ("lacks", "what"),
    [
        (
            ("examine",),
            "Mine has no function examine. Write `def examine(self, …)` in it. A task has reset, step, episode, "
            "examine.",
        ),
        (("reset", "step"), "Mine has no function reset and no step. Write `def reset(self, …)` in it. A task has "),
        (
            ("levels", "horizon"),
            "Mine has no levels and no horizon. Write `levels: ClassVar[int] = …` in it, or a field or property of "
            "that name. A task needs levels, observation_size, action_size, horizon.",
        ),
    ],
)
def test_a_task_that_lacks_a_function_or_a_size_is_a_sentence(lacks: tuple[str, ...], what: str) -> None:
    mine: Any = make_dataclass(
        "Mine", [], namespace={name: has for name, has in _TASK.items() if name not in lacks}, frozen=True
    )
    with pytest.raises(UserError, match=re.escape(what)):
        _ = replace(CONDITION, task=mine()).id


def test_the_task_of_a_training_loop_needs_nothing_that_only_the_engine_asks_for() -> None:
    mine: Any = make_dataclass("Mine", [], namespace={"name": "mine", "revision": 1}, frozen=True)
    assert replace(CONDITION, method=TrainingLoop("loops:train", packages=()), task=mine()).id


def test_a_method_that_can_be_changed_after_its_trials_have_an_id_is_a_sentence() -> None:
    mine: Any = make_dataclass("Mine", [], namespace={"name": "mine", "revision": 1})
    with pytest.raises(UserError, match="Mine is not a frozen dataclass. Write @dataclass"):
        _ = Condition(mine(), NParity(3), "direct", Budget(generations=1)).id


@pytest.mark.parametrize("field", ["method", "task"])
def test_a_class_in_the_place_of_an_object_is_a_sentence(field: str) -> None:
    given: Any = type(getattr(CONDITION, field))
    said = f"^{given.__name__} is a class, and an object of it is needed\\. Write {given.__name__}\\(\\)\\.$"
    with pytest.raises(UserError, match=said):
        _ = replace(CONDITION, **{field: given}).id


def test_the_id_changes_with_everything_that_makes_a_trial_another() -> None:
    ids = {name: condition.id for name, condition in {"same": CONDITION, **OTHERS}.items()}
    assert len(set(ids.values())) == len(ids)
    assert len({TrialSpec(condition, 0).id for condition in OTHERS.values()}) == len(OTHERS)


@given(st.integers(0, 2**31 - 1), st.integers(0, 2**31 - 1))
def test_two_seeds_share_the_condition_and_nothing_else(one: int, other: int) -> None:
    first, second = TrialSpec(CONDITION, one), TrialSpec(replace(CONDITION), other)
    assert first.condition.id == second.condition.id
    assert (first.id == second.id) == (one == other)


def test_the_id_changes_with_the_engine(monkeypatch: pytest.MonkeyPatch) -> None:
    before = TrialSpec(CONDITION, 0).id
    monkeypatch.setattr("evoclaims.trials.spec.ENGINE_REVISION", 10**6)
    assert TrialSpec(replace(CONDITION), 0).id != before


def test_the_id_is_that_of_every_process_whatever_its_hash_seed() -> None:
    script = (
        "from evoclaims.envs.gates.parity import NParity; from evoclaims.methods.random_search import RandomSearch\n"
        "from evoclaims.networks.all_skips import AllSkips; from evoclaims.trials.spec import Budget\n"
        "from evoclaims.trials.spec import Condition, TrialSpec\n"
        "c = Condition(RandomSearch(8, network=AllSkips(hidden=2)), NParity(3), 'curriculum', Budget(generations=4))\n"
        "print(TrialSpec(c, 7).id)"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "PYTHONHASHSEED": "12345"}
    done = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == TrialSpec(CONDITION, 7).id


def test_the_canonical_form_of_a_specification_is_what_has_been_stored_so_far() -> None:
    """Written down by hand from the fields; another form would orphan every stored and reference trial."""
    assert TrialSpec(CONDITION, 7).plain == {
        "engine": 1,
        "method": {
            "name": "random_search",
            "revision": 1,
            "parameters": {"population": 8, "std": 1.0, "network": {"name": "all_skips", "hidden": 2}},
        },
        "task": {"name": "n_parity", "revision": 1, "parameters": {"bits": 3, "sampling": "exhaustive"}},
        "progression": "curriculum",
        "budget": {"generations": 4, "environment_steps": None, "reports": 50},
        "seed": 7,
    }


@pytest.mark.parametrize(("progression", "label"), [("curriculum", ""), ("direct", " (direct)")])
def test_a_condition_has_a_short_name(progression: Any, label: str) -> None:
    assert replace(CONDITION, progression=progression).label == f"random_search on n_parity{label}"


@pytest.mark.parametrize("lengths", [{"generations": 3.0}, {"environment_steps": 1e3}, {"generations": True}])
def test_a_budget_is_a_whole_number_so_that_one_length_has_one_id(lengths: dict[str, Any]) -> None:
    with pytest.raises(UserError, match="a whole number of at least 1"):
        Budget(**lengths)
    with pytest.raises(UserError, match="a whole number of at least 1"):
        Budget(generations=3, reports=2.5)  # type: ignore[arg-type]


@dataclass(frozen=True)
class _Wide:
    width: int = 3


@dataclass(frozen=True)
class _Negated:
    width: int = 3


class _Otherwise(RandomSearch):
    """Computes something else under the inherited name."""


class _OtherGate(SimpleAlu):
    """Asks something else under the inherited name."""


class _Named(RandomSearch):
    name = "random_search"  # type: ignore[misc]


def test_parts_and_subclasses_of_a_users_own_are_told_apart_by_their_classes() -> None:
    wide, negated = (Condition(RandomSearch(8, network=part), TASK, "direct", BUDGET) for part in (_Wide(), _Negated()))
    assert wide.id != negated.id
    plain, other = (Condition(kind(8), TASK, "direct", BUDGET) for kind in (RandomSearch, _Otherwise))
    assert plain.id != other.id
    assert Condition(METHOD, SimpleAlu(), "direct", BUDGET).id != Condition(METHOD, _OtherGate(), "direct", BUDGET).id
    assert Condition(_Named(8), TASK, "direct", BUDGET).id == plain.id  # it says that it is the same


def test_a_field_that_cannot_be_written_is_a_sentence_that_names_the_class() -> None:
    with pytest.raises(UserError, match="A field of RandomSearch is not a number, word"):
        _ = Condition(RandomSearch(8, network=Mlp), TASK, "direct", BUDGET).id  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("method", "said"),
    [
        (CmaEs(population=16.0), r"CmaEs has population=16\.0\. Write whole numbers without a decimal point \(int\)"),  # type: ignore[arg-type]
        (CmaEs(network=AllSkips(24.0)), r"AllSkips has hidden=24\.0\. Write whole numbers"),  # type: ignore[arg-type]
        (CmaEs(network=Mlp((8, 8.0))), r"Mlp has layers=\(8, 8\.0\)\. Write whole numbers .* \(tuple\[int, \.\.\.\]\)"),  # type: ignore[arg-type]
    ],
    ids=["method", "network", "widths"],
)
def test_a_float_where_a_whole_number_is_declared_is_refused_with_the_name_of_the_field(
    method: CmaEs, said: str
) -> None:
    with pytest.raises(UserError, match=said):
        _ = Condition(method, NParity(3), "curriculum", Budget(generations=1)).id


@pytest.mark.parametrize(
    ("method", "task", "said"),
    [
        (Ppo(entropy_cost=math.nan), TASK, r"Ppo has entropy_cost=nan\. Write a number in place of nan\."),
        (Neat(Settings(species=Species(disjoint=math.nan))), TASK, "Species has disjoint=nan"),
        (METHOD, SteppingStones(shows_goal="no"), r"SteppingStones has shows_goal='no'\. Write True or False\."),  # type: ignore[arg-type]
        (Ppo(normalize_observations=1), TASK, r"Ppo has normalize_observations=1\. Write True or False\."),  # type: ignore[arg-type]
    ],
    ids=["method", "part of a part", "word for a truth", "number for a truth"],
)
def test_nan_is_refused_in_every_field_and_a_word_for_a_truth(method: Any, task: Any, said: str) -> None:
    with pytest.raises(UserError, match=said):
        _ = Condition(method, task, "whole_budget", BUDGET).id
    mine = make_dataclass("Mine", [("ends", tuple[float, float])], frozen=True)
    require_numbers(mine((-math.inf, math.inf)))
    with pytest.raises(UserError, match=r"Mine has ends=\(0.0, nan\)"):
        require_numbers(mine((0.0, math.nan)))


def test_a_float_in_a_class_whose_annotations_are_types_is_refused_too() -> None:
    mine = make_dataclass("Mine", [("sizes", tuple[int, int]), ("rate", float)], frozen=True)
    require_numbers(mine((1, 2), 3))
    with pytest.raises(UserError, match=r"Mine has sizes=.* Write whole numbers"):
        require_numbers(mine((1, 2.5), 0.5))
