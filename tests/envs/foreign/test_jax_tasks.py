"""Environments of gymnax and Brax as tasks, on which our methods train, and their policies act."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.envs.foreign.brax_task import BraxTask
from evoclaims.envs.foreign.gymnax_task import GymnaxTask
from evoclaims.envs.foreign.jax_task import Choice, Descriptor, Moment, Range, actions_of
from evoclaims.methods.cma_es import CmaEs
from evoclaims.methods.map_elites import MapElites
from evoclaims.methods.ppo import Ppo
from evoclaims.methods.random_search import RandomSearch
from evoclaims.networks.mlp import Mlp
from evoclaims.trials.compatibility import traced_progress
from evoclaims.trials.result import TrialResult
from evoclaims.trials.runner import run
from evoclaims.trials.spec import Budget, Condition
from evoclaims.trials.store import Store

with_gymnax = pytest.mark.skipif(importlib.util.find_spec("gymnax") is None, reason="gymnax is not installed")

SMALL = Mlp((2,))
CART = GymnaxTask("CartPole-v1", episode_steps=200, solved_at=60, examined_episodes=3)
FAST = BraxTask("fast", episode_steps=12, examined_episodes=2, solved_at=0.0)
ALONG = Descriptor(places=(0, 1), area=((-5, 5), (-5, 5)))
MAPPED = MapElites(network=SMALL, batch=4, cells=(3, 3), initial=4)
STEPPED = Ppo(policy_layers=(2,), value_layers=(2,), environments=4, batch_size=4, minibatches=1, unroll_length=2)


def one_trial(method: Any, task: Any, folder: Path, generations: int = 2) -> TrialResult:
    condition = Condition(method, task, "direct", Budget(generations=generations, reports=1))
    (result,) = run(condition, [0], Store(folder), jax.devices("cpu")[:1])
    return result


@pytest.mark.slow
@pytest.mark.parametrize("method", [MAPPED, STEPPED], ids=lambda method: method.name)
def test_methods_that_want_more_than_episodes_fit_an_environment(method: Any) -> None:
    traced_progress(method, BraxTask("fast", episode_steps=12, descriptor=ALONG))


def test_a_trial_on_brax_is_trained_and_examined(tmp_path: Path) -> None:
    result = one_trial(CmaEs(population=4, network=SMALL), FAST, tmp_path)
    assert result.status == "done"
    assert result.metrics["episode_steps"] == 12.0
    assert result.metrics["last_success"] == 1.0  # of its second generation at the latest
    assert {"brax", "mujoco"} <= set(result.provenance["depends_on"])
    with contextlib.redirect_stdout(io.StringIO()):
        played = FAST.examine_natively(lambda observation: np.zeros(1, np.float32), 0)
    assert played[2] == {"episode_steps": 12.0}


@with_gymnax
def test_a_trial_on_gymnax_is_trained_and_examined(tmp_path: Path) -> None:
    result = one_trial(RandomSearch(population=32, network=Mlp(())), CART, tmp_path, generations=4)
    assert result.status == "done"
    assert result.metrics["last_fitness"] == result.metrics["episode_steps"] > 40
    assert "gymnax" in result.provenance["depends_on"]


@with_gymnax
def test_a_policy_of_a_training_loop_acts_as_the_environment_wants_it() -> None:
    def leaning(observation: Any) -> int:
        assert observation.shape == (4,)
        return int(observation[2] + observation[3] > 0)

    fitness, success, metrics = CART.examine_natively(leaning, 0)
    assert fitness == metrics["episode_steps"] > 60
    assert success == 1.0
    assert CART.examine_natively(lambda observation: 1, 0)[0] < 20


@with_gymnax
@pytest.mark.parametrize("episode_steps", [5, 9])
def test_the_limit_of_an_environment_of_gymnax_truncates_an_episode_and_its_end_terminates_it(
    episode_steps: int,
) -> None:
    def last(limit: int, action: float) -> Any:
        cart = GymnaxTask(
            "CartPole-v1", {"max_steps_in_episode": limit}, episode_steps=50 if limit > 9 else episode_steps
        )
        step = jax.jit(cart.step)
        state = cart.reset(jax.random.key(0), jnp.int32(0))
        for turn in range(cart.episode_steps):
            state = step(state, jnp.array([1.0, 0.0])[:: 1 if turn % 2 and action else -1])
            if state.terminated | state.truncated:
                break
        return int(state.inner.time), bool(state.terminated), bool(state.truncated)

    assert last(5, 1.0) == (5, False, True)  # steered to and fro
    steps, terminated, truncated = last(500, 0.0)  # always to one side: it falls
    assert (5 < steps < 20, terminated, truncated) == (True, True, False)


@with_gymnax
@pytest.mark.slow
def test_our_actions_choose_those_of_the_environment() -> None:
    pendulum = GymnaxTask("Pendulum-v1", episode_steps=3)
    state = jax.jit(pendulum.reset)(jax.random.key(0), jnp.int32(0))
    ours = jax.jit(pendulum.step)(state, jnp.full(1, 0.5))
    theirs = pendulum.advance(jax.random.key(0), state.inner.state, jnp.full(1, 1.0))  # of 2.0 at most
    assert ours.reward == theirs.reward
    assert (ours.terminated, ours.truncated) == (False, False)


@with_gymnax
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:scatter inputs have incompatible types:FutureWarning")  # MinAtar's own
def test_pictures_are_seen_as_vectors_and_an_environment_made_while_tracing_is_whole(tmp_path: Path) -> None:
    breakout = GymnaxTask("Breakout-MinAtar", episode_steps=20, examined_episodes=1)
    result = one_trial(RandomSearch(population=2, network=SMALL), breakout, tmp_path)
    assert breakout.observation_size == 400
    assert result.status == "done"


def test_actions_are_a_choice_or_a_range() -> None:
    spaces = pytest.importorskip("gymnasium", reason="Gymnasium is not installed").spaces
    assert actions_of(spaces.Discrete(3), "it") == Choice(3)
    assert int(Choice(3).chosen(jnp.array([0.1, -2.0, 0.7]))) == 2
    low, high = np.array([[-2.0, 0.0, -np.inf], [2.0, 10.0, np.inf]], np.float32)
    box = actions_of(spaces.Box(low, high), "it")
    assert isinstance(box, Range)
    assert box.chosen(jnp.array([1.0, -5.0, 7.0])).tolist() == [2.0, 0.0, 7.0]
    with pytest.raises(UserError, match="The actions of it are a MultiBinary"):
        actions_of(spaces.MultiBinary(2), "it")


def test_a_number_that_is_not_finite_ends_the_episode() -> None:
    class Breaking(BraxTask):
        def advance(self, key: Any, state: Any, action: Any) -> Any:
            moment = super().advance(key, state, action)
            moved = jax.tree.map(lambda leaf: leaf + jnp.ones_like(leaf), moment.state)
            return replace(moment, state=moved, observation=moment.observation * jnp.nan)

    task = Breaking("fast", episode_steps=12)
    start = task.reset(jax.random.key(0), jnp.int32(0))
    broken = task.step(start, jnp.zeros(1))
    assert broken.terminated
    assert broken.reward == 0.0
    assert (broken.observation == start.observation).all()
    for before, after in zip(*map(jax.tree.leaves, (start.inner.state, broken.inner.state)), strict=True):
        assert np.array_equal(before, after, equal_nan=True)


@pytest.mark.parametrize("actions", [Choice(2), Range((-2.0,), (2.0,), (1,))])
def test_a_policy_that_answers_nan_solves_nothing(actions: Choice | Range) -> None:
    """Its episode ended at once with a return of 0, which is above all others where rewards are below 0."""

    class Costly(BraxTask):
        def begin(self, key: Any) -> Any:
            return replace(super().begin(key), state=jnp.int32(0))

        @property
        def actions(self) -> Choice | Range:
            return actions

        def advance(self, key: Any, state: Any, action: Any) -> Any:
            return Moment(state=state, observation=jnp.zeros(2), reward=jnp.float32(-1), terminated=jnp.zeros((), bool))

    task = Costly("fast", episode_steps=12, examined_episodes=2, solved_at=-5)
    lost = task.examine(lambda observation: jnp.full(task.action_size, jnp.nan), jax.random.key(0), jnp.int32(0))
    assert (np.isnan(lost.fitness), float(lost.success), float(lost.metrics["episode_steps"])) == (True, 0.0, 1.0)
    sound = task.examine(lambda observation: jnp.zeros(task.action_size), jax.random.key(0), jnp.int32(0))
    assert (float(sound.fitness), float(sound.success)) == (-12.0, 0.0)
    if isinstance(actions, Range):  # another choice than a whole number is refused
        fitness, success, _ = task.examine_natively(lambda observation: np.full(1, np.nan), 0)
        assert (np.isnan(fitness), success) == (True, 0.0)


def test_to_break_an_environment_that_costs_pays_no_more_than_its_worst_step_ever_after() -> None:
    class Breaking(BraxTask):
        def begin(self, key: Any) -> Any:
            return replace(super().begin(key), state=jnp.int32(0))

        def advance(self, key: Any, state: Any, action: Any) -> Any:
            paid = jnp.array([0.5, -3.0, -1.0, jnp.nan])[state]
            return Moment(state=state + 1, observation=jnp.zeros(2), reward=paid, terminated=jnp.zeros((), bool))

    task = Breaking("fast", episode_steps=12, examined_episodes=2, solved_at=-5)
    compiled = task.examine(lambda observation: jnp.zeros(1), jax.random.key(0), jnp.int32(0))
    fitness, success, metrics = task.examine_natively(lambda observation: np.zeros(1), 0)
    assert fitness == 0.5 - 3.0 - 1.0 - 3.0 * 9 == compiled.fitness
    assert success == 0.0 == compiled.success
    assert metrics == {"episode_steps": 4.0} == compiled.metrics


def test_a_return_that_32_bits_make_smaller_solves_an_episode() -> None:
    class Hundredths(BraxTask):
        def begin(self, key: Any) -> Any:
            return replace(super().begin(key), state=jnp.int32(0))

        def advance(self, key: Any, state: Any, action: Any) -> Any:
            return Moment(state, jnp.zeros(2), jnp.float32(0.01), terminated=jnp.zeros((), bool))

    for wanted, solves in ((1.0, 1.0), (1.001, 0.0)):
        task = Hundredths("fast", episode_steps=100, examined_episodes=1, solved_at=wanted)
        found = task.examine(lambda observation: jnp.zeros(1), jax.random.key(0), jnp.int32(0))
        assert float(found.fitness) < 1.0
        assert float(found.success) == solves == task.examine_natively(lambda observation: np.zeros(1), 0)[1]


@pytest.mark.parametrize("how", ["truncated", "reward", "observation"])
def test_a_policy_scores_the_same_in_both_examinations(how: str) -> None:
    class Ending(BraxTask):
        def begin(self, key: Any) -> Any:
            moment = super().begin(key)
            return replace(moment, state=jnp.int32(0))

        def advance(self, key: Any, state: Any, action: Any) -> Any:
            over = state >= 3  # after the fourth step, and, where nobody stops there, ever after
            changed = {
                "truncated": {"truncated": over},
                "reward": {"reward": jnp.where(over, jnp.inf, 0.7)},
                "observation": {"observation": jnp.where(over, jnp.nan, jnp.zeros(2))},
            }[how]
            plain = {"observation": jnp.zeros(2), "reward": jnp.float32(0.7), "truncated": jnp.zeros((), bool)}
            return Moment(state=state + 1, terminated=jnp.zeros((), bool), **{**plain, **changed})

    task = Ending("fast", episode_steps=12, examined_episodes=2, solved_at=3 * 0.7)  # a float32 is below this
    compiled = task.examine(lambda observation: jnp.zeros(1), jax.random.key(0), jnp.int32(0))
    fitness, success, metrics = task.examine_natively(lambda observation: np.zeros(1), 0)
    assert fitness == pytest.approx(0.7 * (4 if how == "truncated" else 3)) == compiled.fitness
    assert success == float(how == "truncated") == compiled.success  # what broke off is not solved
    assert metrics == {"episode_steps": 4.0} == compiled.metrics


def test_a_policy_of_a_training_loop_returns_as_many_numbers_as_an_action_has() -> None:
    assert FAST.examine_natively(lambda observation: [[0.5]], 0)[2]["episode_steps"] > 0
    for wrong in ([0.5, 0.5], [], None, "up"):
        with pytest.raises(
            UserError, match=r"returned .* on fast, where an action is an array of shape \(1,\)\. Return"
        ):
            FAST.examine_natively(lambda observation, wrong=wrong: wrong, 0)


def test_wrong_names_and_what_map_elites_needs_are_sentences() -> None:
    with pytest.raises(UnknownNameError, match="no environment of Brax named 'antt'. Did you mean 'ant'"):
        BraxTask("antt").make()
    with pytest.raises(UserError, match="fast has no descriptor of this. Add one, such as descriptor="):
        traced_progress(MAPPED, FAST)
    with pytest.raises(UserError, match="episode_steps must be at least 1, not 0"):
        BraxTask("fast", episode_steps=0)
    with pytest.raises(UserError, match="examined_episodes must be at least 1, not 0"):
        BraxTask("fast", examined_episodes=0)
    with pytest.raises(UserError, match="CartPole-v1's max_steps_in_episode must be at least 1, not -1"):
        GymnaxTask("CartPole-v1", {"max_steps_in_episode": -1})  # each episode would end at once
    with pytest.raises(UserError, match="fast's solved_at must be a finite number, not '1'"):
        BraxTask("fast", solved_at="1")  # type: ignore[arg-type]
    for wrong in (("fast", 3), (3, {})):
        with pytest.raises(UserError, match=r"BraxTask\(.*\) does not name an environment and its settings"):
            BraxTask(*wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("places", [(0,), (0, 1, 2), (-1, 0), (0.5, 1)])
def test_a_descriptors_places_are_two_positions(places: Any) -> None:
    with pytest.raises(UserError, match=r"has places=\(.*\)\. Write two positions in the observation"):
        Descriptor(places=places, area=((0, 1), (0, 1)))


@pytest.mark.parametrize("area", [((1, 0), (0, 1)), ((0, 1), (1, 1)), ((0, math.inf), (0, 1)), ((0, math.nan), (0, 1))])
def test_a_descriptors_area_has_room(area: Any) -> None:
    with pytest.raises(UserError, match=r"has the range \(.*Write two finite numbers, the lower one first"):
        Descriptor(places=(0, 1), area=area)


def test_a_place_beyond_the_observation_is_not_read_as_its_last_number() -> None:
    beyond = Descriptor(places=(0, 2), area=((-5, 5), (-5, 5)))  # an observation of fast has two numbers
    with pytest.raises(
        UserError, match=r"reads the places \(0, 2\) of its observation, which has 2 numbers. Write places from 0 to 1"
    ):
        traced_progress(MAPPED, BraxTask("fast", episode_steps=12, descriptor=beyond))
