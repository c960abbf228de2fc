"""What a trial is: budgets, conditions and specifications, and the ids that follow from them."""

from __future__ import annotations

import math
from dataclasses import InitVar, dataclass, field, make_dataclass, replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from trial_toys import walk

from evoclaims.core.canonical import require_numbers
from evoclaims.core.errors import UserError
from evoclaims.envs.ecorobot.stones import SteppingStones
from evoclaims.envs.gates.alu import SimpleAlu
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.cma_es import CmaEs
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.methods.neat.evolution import Neat
from evoclaims.methods.neat.settings import Attribute, Mutation, Settings
from evoclaims.methods.ppo import LevelTest, Ppo
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
        {"generations": 3.0},
        {"environment_steps": 1e3},  # it would have another id than 1000
        {"generations": True},
        {"generations": 3, "reports": 2.5},
    ],
)
def test_a_budget_of_no_length_or_two_or_no_whole_number_is_refused_in_a_sentence(lengths: dict[str, Any]) -> None:
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


_TOLD = {"name": "mine", "revision": 1}
_METHOD: dict[str, Any] = {**_TOLD, **dict.fromkeys(("init", "step", "best", "cost"), print)}
_TASK: dict[str, Any] = {
    **{**_TOLD, "levels": 1, "observation_size": 1, "action_size": 1, "horizon": 1},
    **dict.fromkeys(("reset", "step", "episode", "examine"), print),
}


def _mine(has: dict[str, Any], *lacks: str, frozen: bool = True) -> Any:
    """Return a component of a class Mine that has all this but for what it lacks."""
    namespace = {name: given for name, given in has.items() if name not in lacks}
    return make_dataclass("Mine", [], namespace=namespace, frozen=frozen)()


@pytest.mark.parametrize(
    ("part", "given", "what"),
    [
        ("method", type("Mine", (), {"name": "mine"})(), r"Mine has no revision, .* `revision: ClassVar\[int\] = …`"),
        ("method", _mine({**_METHOD, "revision": "1"}), r"Mine has '1' as its revision, .* `revision: ClassVar\[int\]"),
        ("method", type("Mine", (), _TOLD)(), r"Mine is not a dataclass. Write @dataclass\(frozen=True\)"),
        ("method", _mine(_METHOD, frozen=False), r"Mine is not a frozen dataclass. Write @dataclass\(frozen=True\)"),
        ("method", RandomSearch, r"^RandomSearch is a class, and an object of it is needed. Write RandomSearch\(\)\.$"),
        ("task", NParity, r"^NParity is a class, and an object of it is needed\. Write NParity\(\)\.$"),
        (
            *("method", _mine(_METHOD, "best")),
            r"^Mine has no function best\. Write `def best\(self, …\)` in it\. A method has init, step, best, cost\.$",
        ),
        (
            *("method", _mine(_METHOD, "init", "best", "cost")),
            r"^Mine has no function init and no best and no cost\. Write `def init\(self, …\)` in it\. A method has ",
        ),
        (
            *("task", _mine(_TASK, "reset", "step")),
            r"^Mine has no function reset and no step\. Write `def reset\(self, …\)` in it\. A task has reset, step, ",
        ),
        (
            *("task", _mine(_TASK, "levels", "horizon")),
            r"^Mine has no levels and no horizon\. Write `levels: ClassVar\[int\] = …` in it, or a field or property "
            r"of that name\. A task needs levels, observation_size, action_size, horizon\.$",
        ),
        # 16.0 would have another id than 16, and "no" is true to Python.
        ("method", CmaEs(population=16.0), r"CmaEs has population=16\.0\. Write whole numbers .* \(int\)"),  # type: ignore[arg-type]
        ("method", CmaEs(network=AllSkips(24.0)), r"AllSkips has hidden=24\.0\. Write whole numbers"),  # type: ignore[arg-type]
        ("method", CmaEs(network=Mlp((8, 8.0))), r"Mlp has layers=\(8, 8\.0\)\. .* \(tuple\[int, \.\.\.\]\)"),  # type: ignore[arg-type]
        ("method", Ppo(entropy_cost=math.nan), r"Ppo has entropy_cost=nan\. Write a number in place of nan\."),
        ("method", Neat(Settings(mutation=Mutation(weight=Attribute(mean=math.nan)))), "Attribute has mean=nan"),
        ("method", Ppo(normalize_observations=1), r"Ppo has normalize_observations=1\. Write True or False\."),  # type: ignore[arg-type]
        ("task", SteppingStones(shows_goal="no"), r"SteppingStones has shows_goal='no'\. Write True or False\."),  # type: ignore[arg-type]
        ("method", RandomSearch(8, network=Mlp), "A field of RandomSearch is not a number, word"),  # type: ignore[arg-type]
    ],
)
def test_what_cannot_be_told_from_others_by_an_id_is_a_sentence(part: str, given: Any, what: str) -> None:
    with pytest.raises(UserError, match=what):
        _ = replace(CONDITION, **{part: given}).id


def test_numbers_are_required_where_annotations_are_types_too() -> None:
    mine = make_dataclass("Mine", [("sizes", tuple[int, int]), ("ends", tuple[float, float])], frozen=True)
    require_numbers(mine((1, 2), (-math.inf, math.inf)))
    with pytest.raises(UserError, match=r"Mine has sizes=.* Write whole numbers"):
        require_numbers(mine((1, 2.5), (0.0, 1.0)))
    with pytest.raises(UserError, match=r"Mine has ends=\(0.0, nan\)"):
        require_numbers(mine((1, 2), (0.0, math.nan)))


def test_what_a_class_keeps_of_an_argument_is_a_field() -> None:
    """Else two with other numbers would have one id."""

    def keep(self: Any, scale: float) -> None:
        object.__setattr__(self, "scale", scale)
        object.__setattr__(self, "doubled", 2 * scale)

    fields: Any = [("scale", InitVar[float]), ("doubled", float, field(init=False))]
    taking = make_dataclass("Mine", fields[:1], namespace={"__post_init__": keep}, frozen=True)
    writing = make_dataclass("Mine", [], namespace={"__init__": keep}, frozen=True)
    for kind in (taking, writing):
        with pytest.raises(UserError, match=r"Mine keeps scale, doubled, and is given scale, which are no fields"):
            require_numbers(kind(1.0))
    holding = make_dataclass("Mine", fields[1:], namespace={"__init__": keep}, frozen=True)
    with pytest.raises(UserError, match=r"Mine keeps scale, and is given scale, which"):
        require_numbers(holding(1.0))
    deriving = make_dataclass(
        "Mine",
        [("scale", float)],
        namespace={"__post_init__": lambda self: object.__setattr__(self, "doubled", 2 * self.scale)},
        frozen=True,
    )
    require_numbers(deriving(1.0))


def test_the_task_of_a_training_loop_needs_nothing_that_only_the_engine_asks_for() -> None:
    assert replace(CONDITION, method=TrainingLoop("loops:train", packages=()), task=_mine(_TOLD)).id


def test_the_id_changes_with_everything_that_makes_a_trial_another() -> None:
    ids = {name: condition.id for name, condition in {"same": CONDITION, **OTHERS}.items()}
    assert len(set(ids.values())) == len(ids)
    assert len({TrialSpec(one, seed).id for one in OTHERS.values() for seed in (0, 1)}) == 2 * len(OTHERS)
    assert replace(CONDITION).id == CONDITION.id


def test_the_id_changes_with_the_engine(monkeypatch: pytest.MonkeyPatch) -> None:
    before = TrialSpec(CONDITION, 0).id
    monkeypatch.setattr("evoclaims.trials.spec.ENGINE_REVISION", 10**6)
    assert TrialSpec(replace(CONDITION), 0).id != before


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


@pytest.mark.parametrize("steps", [2**31, 2**60])
def test_a_budget_that_no_counter_holds_is_a_sentence(steps: int) -> None:
    with pytest.raises(UserError, match=f"has a budget of {steps} steps, and a trial takes at most 2147483647"):
        _ = walk(steps=steps).steps
    assert walk(steps=2**31 - 1).steps == 2**31 - 1


def test_environment_steps_that_no_float_counts_are_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    condition = walk(steps=4)
    monkeypatch.setattr(type(condition.method), "cost", lambda self, task: 2**52)
    with pytest.raises(UserError, match=r"18014398509481984 environment steps \(4 steps of 4503599627370496\)"):
        _ = condition.environment_steps
    assert Budget(generations=2).steps(2**52) * 2**52 == 2**53


@pytest.mark.parametrize(("every", "what"), [(5, "after each 5 whether it moves up"), (0, "nothing")])
def test_a_curriculum_that_is_never_tested_is_a_sentence(every: int, what: str) -> None:
    """It would say that the method stays at the first level, whatever it learns."""
    seldom = replace(CONDITION, method=Ppo(level_test=LevelTest(every=every)))
    with pytest.raises(UserError, match=f"a curriculum of 4 steps, and ppo tests {what}: it would stay at the first"):
        _ = seldom.steps
    assert replace(seldom, progression="whole_budget").steps == 4
    assert replace(seldom, method=Ppo(level_test=LevelTest(every=4))).steps == 4
    assert replace(seldom, task=SteppingStones()).steps == 4
