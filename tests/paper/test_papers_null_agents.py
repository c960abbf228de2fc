"""The null agents of our own paper have the numbers of what learns nothing, and satisfy what they should."""

from __future__ import annotations

import itertools
import math
from typing import Any

import jax
import jax.numpy as jnp
import pytest

from evoclaims.claims.fetching import StoredOnly
from evoclaims.claims.null_agents import answers
from evoclaims.envs import SimpleAlu
from evoclaims.judging.assertion import Assertion
from evoclaims.judging.design import Look
from evoclaims.judging.judge import fetch_from
from evoclaims.paper.archive import Archive
from evoclaims.paper.trial_group import TrialGroup
from evoclaims.trials.store import Store
from reproductions.nisioti2025 import REPRODUCTION
from reproductions.nisioti2025.measures import PaperTrials, constant_success
from reproductions.nisioti2025.null_agents import NULL_AGENTS, no_action

SMOKE, FULL = REPRODUCTION.tiers["smoke"], REPRODUCTION.tiers["full"]


@pytest.mark.parametrize("names", [("neat", "stones"), ("ppo", "deceptive_maze_easy")])
def test_a_robot_at_its_start_has_the_numbers_of_the_agent(names: tuple[str, str]) -> None:
    condition = SMOKE.conditions[names]
    task: Any = condition.task
    outing: Any = task.reset(jax.random.key(0), jnp.zeros((), jnp.int32)).inner
    step = task.rule(outing.memory, outing.pose, outing.pose, jnp.zeros(task.action_size))
    numbers = no_action(condition)
    assert numbers is not None
    told = numbers["metrics"]
    assert told["last_fitness"] == pytest.approx(task.episode_steps * float(step.reward), rel=1e-5, abs=1e-5)
    for name, value in task.measures(outing).items():
        assert told[name] == pytest.approx(float(value), rel=1e-5), name
    path = task.path_measures(outing.pose.place[None, :2], jnp.ones(1, bool))
    assert told["coverage"] == pytest.approx(float(path["coverage"]), rel=1e-5)


@pytest.mark.parametrize(
    ("variant", "names", "reward"),
    [
        ("", ("neat", "stones"), 1_000 * (1 - 2.5 / math.hypot(8, 8))),
        ("pay_once", ("neat", "stones"), 1 - 2.5 / math.hypot(8, 8)),
        ("after_next", ("neat", "stones"), 1_000 * (1 - 6.2 / math.hypot(8, 8))),
        ("big_maze_ant", ("neat", "stones_ant"), 1_000 * (1 - math.hypot(2.5, 2) / math.hypot(12, 12))),
        ("submission", ("neat", "stones_ant"), 1_000 * (1 - math.hypot(7.5, 2) / math.hypot(12, 12))),
        ("submission_once", ("neat", "stones"), 1 - 6.2 / math.hypot(8, 8)),
        ("easy_as_coded", ("ppo", "deceptive_maze_easy"), math.hypot(4, 9) - math.hypot(1, 8)),
    ],
)
def test_an_idle_robot_earns_what_the_variant_pays(variant: str, names: tuple[str, str], reward: float) -> None:
    numbers = no_action(REPRODUCTION.tier("full", variant).condition(*names))
    assert numbers is not None
    assert numbers["metrics"]["last_fitness"] == pytest.approx(reward, rel=1e-5)


def test_no_constant_circuit_is_right_more_often_than_the_agent() -> None:
    alu = SimpleAlu(level_count=3)
    level = jnp.asarray(2, jnp.int32)
    answers = itertools.product((-1.0, 1.0), repeat=alu.action_size)
    key = jax.random.key(0)
    best = max(float(alu.examine(lambda seen, a=a: jnp.asarray(a), key, level).success) for a in answers)  # type: ignore[misc]
    assert constant_success(alu)[-1] == pytest.approx(best)


@pytest.fixture(scope="module")
def satisfied(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A function that returns which agents satisfy an assertion about the committed trials of the full tier."""
    store = Store(tmp_path_factory.mktemp("none") / "store")
    fetch = StoredOnly(Archive(store, REPRODUCTION.references))

    def group(method: str, on: str) -> TrialGroup:
        return REPRODUCTION.trials(method, on, FULL.condition(method, on), fetch)

    def put(asserted: Any) -> tuple[str, ...]:
        assertion: Assertion = asserted(group)
        found = answers(NULL_AGENTS, assertion, Look(10, 0.05), FULL.design, fetch_from, group)
        return tuple(name for name, answer in found.items() if answer is True)

    return put


Group = Any


@pytest.mark.parametrize(
    ("before", "now", "agent", "left"),
    [
        (
            lambda of: of("neat", "stones_ant").crosses_at_most(1).stays(),
            lambda of: of("neat", "stones_ant").stones.between(0.5, 1.5),
            "no action",
            (),
        ),
        (
            lambda of: of("ppo", "stones").crosses_at_most(1).stays(),
            lambda of: of("ppo", "stones").stones.between(0.5, 1.5),
            "no action",
            (),
        ),
        (
            lambda of: of("ppo", "stones_ant").crosses_at_most(1).stays(),
            lambda of: (
                of("ppo", "stones_ant").crosses_at_most(1).stays()
                & (of("ppo", "stones").stones > of("ppo", "stones_ant").stones)
            ),
            "no action",
            (),
        ),
        (
            lambda of: of("ppo", "n_parity_direct").last_success > of("ppo", "n_parity").last_success,
            lambda of: (
                of("ppo", "n_parity_direct").last_success_is(1).in_most_trials()
                & of("ppo", "n_parity").solves_no_level_beyond(0).stays()
            ),
            "random search",
            (),
        ),
        (
            lambda of: of("neat", "simple_alu").champion_is_mostly_hidden.in_most_trials(),
            lambda of: of("neat", "simple_alu").champion_size > of("neat", "stones").champion_size,
            "full arrays",
            (),
        ),
        (
            lambda of: of("neat", "n_parity").last_success > of("neat", "simple_alu").last_success,
            lambda of: (
                of("neat", "n_parity").success_beyond_guessing > of("neat", "simple_alu").success_beyond_guessing
            ),
            "constant circuit",
            ("random search",),  # to which the ALU is harder, too
        ),
    ],
    ids=["M1", "S3", "X1", "G9", "G10", "G11"],
)
def test_an_agent_satisfies_what_a_claim_asserted_and_not_what_it_asserts(
    satisfied: Any, before: Any, now: Any, agent: str, left: tuple[str, ...]
) -> None:
    assert agent in satisfied(before)
    assert satisfied(now) == left


def test_agents_say_nothing_of_conditions_that_they_cannot_stand_for() -> None:
    assert no_action(FULL.conditions["neat", "n_parity"]) is None
    for name in ("constant circuit", "full arrays"):
        agent = NULL_AGENTS[name]
        assert agent.numbers is not None
        assert agent.numbers(FULL.conditions["ppo", "stones"]) is None
    assert issubclass(REPRODUCTION.trials, PaperTrials)
