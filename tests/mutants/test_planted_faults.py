"""Faults are planted in what they say, change what they say, and leave sound components alone."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from probes import COPY

from evoclaims.core.errors import UserError
from evoclaims.envs.base import Episode, PolicyFn
from evoclaims.envs.gates.alu import SimpleAlu
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.base import Resizable
from evoclaims.methods.cma_es import CmaEs
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.methods.neat.evolution import Neat
from evoclaims.methods.neat.settings import Settings, Species
from evoclaims.methods.random_search import RandomSearch
from evoclaims.mutants import faults
from evoclaims.mutants.faults import plant
from evoclaims.mutants.mutant import MUTANTS
from evoclaims.networks.all_skips import AllSkips
from evoclaims.trials.program import Program
from evoclaims.trials.spec import Budget, Condition

PARITY = NParity(3)
CMA_ES = CmaEs(population=8, network=AllSkips(4))
KEY = jax.random.key(0)
LEVEL = jnp.int32(1)


def condition(method: Any = CMA_ES, task: Any = PARITY) -> Condition:
    return Condition(method, task, "curriculum", Budget(generations=3))


SOUND = {("a", "b"): condition()}
RIGHT: PolicyFn = HandBuilt().best(PARITY, jnp.int32(0))


class Halved(faults.Fault):
    """A fault of the project's own."""

    says = "is halved"


def test_the_code_of_a_projects_own_fault_is_looked_at() -> None:
    """Else an edited fault would be judged by its old trials without a word."""
    assert [*condition(plant(Halved, CMA_ES)).code] == [f"{__name__}.Halved"]
    assert [*condition(task=plant(Halved, PARITY)).code] == [f"{__name__}.Halved"]
    assert condition(plant(faults.Minimizes, CMA_ES)).code == {}


def examined(fault: type[Any], policy: PolicyFn, level: int = 1) -> Episode:
    return plant(fault, PARITY).examine(policy, KEY, jnp.int32(level))  # type: ignore[no-any-return]


@cache
def step_of(method: Any, task: Any) -> Any:
    """Return a compiled step; equal methods share it."""
    return jax.jit(lambda key, state: method.step(key, task, LEVEL, state))


def trained(method: Any, steps: int = 3, task: Any = PARITY, seed: int = 0) -> Any:
    state, step = method.init(jax.random.key(seed), task), step_of(method, task)
    for number in range(steps):
        state, progress = step(jax.random.key(100 * seed + number), state)
    return state, progress


@pytest.mark.parametrize("name", MUTANTS)
def test_a_mutant_has_conditions_of_its_own_and_the_sound_ones_stay(name: str) -> None:
    sound = {("cma_es", "n_parity"): condition(), ("other", "copy"): condition(RandomSearch(4, 1.0, AllSkips(4)), COPY)}
    before = {names: one.id for names, one in sound.items()}
    mutant = MUTANTS[name]
    for target in mutant.targets(sound):
        for names, faulty in mutant.conditions(sound, target).items():
            assert target in names
            assert faulty.id != sound[names].id
            assert mutant.conditions(sound, target)[names].id == faulty.id
    assert {names: one.id for names, one in sound.items()} == before


def test_equal_faulty_components_are_equal_and_differ_from_sound_ones() -> None:
    blind = plant(faults.Blind, PARITY)
    assert blind == plant(faults.Blind, NParity(3))
    assert hash(blind) == hash(plant(faults.Blind, NParity(3)))
    assert len({id(plant(faults.Blind, PARITY).__class__), id(blind.__class__)}) == 1
    assert blind != PARITY
    assert isinstance(blind, NParity)
    assert blind.sound == PARITY
    assert (blind.name, PARITY.name) == ("n_parity that shows nothing", "n_parity")


class _TwoBits(faults.Fault):
    """Parity of two bits, however many were asked for."""

    says = "has two bits"
    bits = 2


def test_a_fault_in_place_of_a_parameter_is_one_sentence() -> None:
    """A copy of the component with another parameter could not be made."""
    with pytest.raises(UserError, match="_TwoBits replaces 'bits', a parameter of 'n_parity'"):
        plant(_TwoBits, PARITY)


@dataclass(frozen=True)
class _Priced(NParity):
    """A task with parameters that are called as functions of `FaultyTask` are."""

    paid: float = 1.0
    says: str = "a word"


def test_a_parameter_may_have_the_name_of_a_function_of_ours() -> None:
    assert plant(faults.Blind, _Priced(3)).sound == _Priced(3)


def test_two_faults_in_one_component_are_one_sentence() -> None:
    with pytest.raises(UserError, match="'n_parity that shows nothing' has a fault already"):
        plant(faults.Paralysed, plant(faults.Blind, PARITY))


@pytest.mark.parametrize(
    ("fault", "success", "fitness"),
    [
        (faults.Blind, 0.5, -0.5),
        (faults.Paralysed, 0.5, -0.5),
        (faults.PaysNothing, 1.0, 0.0),
        (faults.IgnoresAnInput, 0.5, -0.5),
        (faults.HasAWrongRow, 7 / 8, -1 / 8),
    ],
)
def test_what_a_right_circuit_gets_from_faulty_parity(fault: type[Any], success: float, fitness: float) -> None:
    episode = examined(fault, RIGHT)
    assert (float(episode.success), float(episode.fitness)) == (success, fitness)


def test_a_reversed_reward_is_the_negative_of_the_right_one() -> None:
    always = lambda bits: jnp.ones(1)  # noqa: E731
    assert float(examined(faults.ReversesReward, always).fitness) == 0.5
    assert float(PARITY.examine(always, KEY, LEVEL).fitness) == -0.5


def test_a_random_payment_depends_on_the_key_alone() -> None:
    task: Any = plant(faults.PaysAtRandom, PARITY)
    paid = [float(task.episode(RIGHT, jax.random.key(seed), LEVEL).fitness) for seed in (0, 0, 1)]
    assert paid[0] == paid[1] != paid[2]
    assert 0 <= min(paid) <= max(paid) < 1


def test_the_level_is_the_first_one_whatever_is_asked() -> None:
    first_level_alone: Any = lambda bits: jnp.where(bits[:1] > 0, -1.0, RIGHT(bits))  # noqa: E731
    assert float(PARITY.examine(first_level_alone, KEY, LEVEL).success) < 1
    assert float(examined(faults.StaysAtFirstLevel, first_level_alone).success) == 1


@pytest.mark.parametrize(
    ("fault", "paid"),
    [(faults.Blind, -1.0), (faults.PaysNothing, 0.0), (faults.ReversesReward, 1.0), (faults.PaysAtRandom, None)],
)
def test_steps_are_faulty_like_episodes(fault: type[Any], paid: float | None) -> None:
    task: Any = plant(fault, NParity(3, "sampled"))
    sound = task.sound.reset(KEY, LEVEL)
    assert bool(jnp.any(sound.observation != 0))
    state = task.reset(KEY, LEVEL)
    assert bool(jnp.any(state.observation != 0)) == (fault is not faults.Blind)
    following = task.step(state, -RIGHT(sound.observation))  # a wrong answer, which costs 1
    assert float(following.reward) == paid if paid is not None else 0 <= float(following.reward) < 1
    assert bool(following.terminated)


def test_an_alu_that_ignores_an_input_differs_from_the_right_one_in_targets_alone() -> None:
    alu = SimpleAlu(level_count=3)
    faulty: Any = plant(faults.IgnoresAnInput, alu)
    np.testing.assert_array_equal(faulty.table.inputs, alu.table.inputs)
    assert (faulty.table.targets != alu.table.targets).any()


def test_a_method_that_learns_nothing_keeps_its_state() -> None:
    method: Any = plant(faults.LearnsNothing, CMA_ES)
    state, _ = trained(method)
    np.testing.assert_array_equal(state.distribution.mean, method.init(KEY, PARITY).distribution.mean)
    moved, _ = trained(CMA_ES)
    assert (moved.distribution.mean != state.distribution.mean).any()


def test_a_method_that_minimizes_ends_with_the_worst_individual() -> None:
    assert float(trained(CMA_ES)[1].fitness) > float(-trained(plant(faults.Minimizes, CMA_ES))[1].fitness)


def test_selection_at_random_does_not_follow_the_rewards() -> None:
    _, progress = trained(plant(faults.SelectsAtRandom, CMA_ES))
    assert 0 <= float(progress.fitness) < 1


def test_a_forgotten_champion_is_what_training_began_with() -> None:
    method: Any = plant(faults.ForgetsChampion, CMA_ES)
    state, _ = trained(method)
    np.testing.assert_array_equal(method.best(PARITY, state).parameters, np.zeros_like(state.champion.parameters))
    assert (CMA_ES.best(PARITY, state).parameters != 0).any()


def test_the_step_size_stays_what_it_was() -> None:
    method: Any = plant(faults.KeepsItsStepSize, CMA_ES)
    assert float(trained(method)[0].distribution.std) == float(method.init(KEY, PARITY).distribution.std)
    assert float(trained(CMA_ES)[0].distribution.std) != float(CMA_ES.init(KEY, PARITY).distribution.std)


@pytest.mark.parametrize(
    "name", ["pays-at-random", *(name for name, one in MUTANTS.items() if one.part == "method" and one.targets(SOUND))]
)
def test_the_engine_runs_a_mutant_as_any_other_condition(name: str) -> None:
    (faulty,) = MUTANTS[name].conditions(SOUND, MUTANTS[name].targets(SOUND)[0]).values()
    program = Program(faulty)

    def whole(seed: Any) -> Any:
        trial = program.start(seed, jnp.zeros((), bool))
        return program.examine(program.advance(trial, jnp.int32(3))[0]).final.success

    assert jax.eval_shape(whole, jnp.int32(0)).shape == (PARITY.levels,)


@pytest.mark.parametrize("fault", [None, faults.ForgetsChampion])
def test_a_fault_in_neat_is_traced_side_by_side_too(fault: type[Any] | None) -> None:
    sound = Neat(Settings(population=8, nodes=8, connections=12, species=Species(most=3)))
    method = plant(fault, sound) if fault else sound
    assert isinstance(method, Resizable)
    program, two = Program(condition(method)), jnp.arange(2)
    state = jax.eval_shape(jax.vmap(program.start), two, two > 2)
    following, _ = jax.eval_shape(program.advance_together, state, two)
    assert jax.tree.structure(following) == jax.tree.structure(state)
