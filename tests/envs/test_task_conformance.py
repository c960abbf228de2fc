"""What every task keeps to: gates, probes and robots alike."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from probes import PROBES

from evoclaims.core.canonical import canonical_json
from evoclaims.envs.ecorobot.deceptive import DeceptiveMaze
from evoclaims.envs.ecorobot.locomotion import Locomotion, Obstacles
from evoclaims.envs.ecorobot.robots import SIMPLE_ROB
from evoclaims.envs.ecorobot.stones import SteppingStones
from evoclaims.envs.gates.alu import SimpleAlu
from evoclaims.envs.gates.parity import NParity

EXACT: dict[str, Any] = {
    "parity": NParity(3),
    "parity, sampled": NParity(3, "sampled"),
    "alu": SimpleAlu(3),
    "alu, sampled": SimpleAlu(3, sampling="sampled"),
    **PROBES,
}
"""Tasks whose examinations draw nothing."""

_SHORT: Any = {"episode_steps": 4, "examined_episodes": 2}
ROBOTS: dict[str, Any] = {
    "stepping stones": SteppingStones(shows_goal=True, **_SHORT),
    "deceptive maze": DeceptiveMaze(**_SHORT),
    "obstacles": Obstacles(**_SHORT),
    "locomotion": Locomotion(robot=SIMPLE_ROB, **_SHORT),
}
"""Tasks whose episodes start at random, and whose physics rounds as the compiler arranges it."""
TASKS = {**EXACT, **ROBOTS}
LEVEL = jnp.zeros((), jnp.int32)


@pytest.fixture(params=TASKS.values(), ids=list(TASKS))
def task(request: pytest.FixtureRequest) -> Any:
    return request.param


@pytest.fixture(params=EXACT.values(), ids=list(EXACT))
def exact(request: pytest.FixtureRequest) -> Any:
    return request.param


def _act(task: Any, observation: jax.Array) -> jax.Array:
    """A policy that is right about some observations and wrong about others."""
    return jnp.sin(3.0 * jnp.arange(1.0, task.action_size + 1) + 2.0 * jnp.sum(observation))


def _equal(one: Any, other: Any) -> None:
    jax.tree.map(np.testing.assert_array_equal, one, other)


def test_a_step_keeps_structure_shapes_and_dtypes(task: Any) -> None:
    start = jax.eval_shape(task.reset, jax.random.key(0), LEVEL)
    after = jax.eval_shape(task.step, start, jnp.zeros(task.action_size))
    assert jax.tree.structure(start) == jax.tree.structure(after)
    for one, other in zip(jax.tree.leaves(start), jax.tree.leaves(after), strict=True):
        assert (one.shape, one.dtype) == (other.shape, other.dtype)
    assert start.observation.shape == (task.observation_size,)
    assert start.observation.dtype == after.reward.dtype == jnp.float32
    assert start.terminated.dtype == start.truncated.dtype == jnp.bool_
    assert start.reward.shape == start.terminated.shape == start.truncated.shape == ()


def test_the_same_key_starts_the_same_episode(task: Any) -> None:
    _equal(task.reset(jax.random.key(3), LEVEL), task.reset(jax.random.key(3), LEVEL))


def test_a_fresh_episode_has_neither_ended_nor_paid(task: Any) -> None:
    state = task.reset(jax.random.key(0), LEVEL)
    assert (float(state.reward), bool(state.terminated), bool(state.truncated)) == (0.0, False, False)


@pytest.mark.parametrize("task", [*EXACT.values(), ROBOTS["locomotion"]], ids=[*EXACT, "locomotion"])
def test_every_level_ends_within_the_horizon(task: Any) -> None:
    step = jax.jit(lambda state: task.step(state, _act(task, state.observation)))
    for level in range(task.levels):
        state, steps = task.reset(jax.random.key(level), jnp.asarray(level, jnp.int32)), 0
        while not (state.terminated or state.truncated):
            state, steps = step(state), steps + 1
            assert steps <= task.horizon
        assert not (state.terminated and state.truncated)


def _played(task: Any, key: jax.Array, level: jax.Array) -> Any:
    return task.step(task.reset(key, level), jnp.ones(task.action_size))


def test_a_batch_matches_the_loop_plain_and_jitted(exact: Any) -> None:
    play, levels = partial(_played, exact), jnp.arange(4, dtype=jnp.int32) % exact.levels
    batch = jax.jit(jax.vmap(play))(jax.random.split(jax.random.key(1), 4), levels)
    jitted = jax.jit(play)
    for i, key in enumerate(jax.random.split(jax.random.key(1), 4)):
        alone = jax.tree.map(lambda leaf, i=i: leaf[i], batch)
        _equal(alone, jitted(key, levels[i]))
        if i == 3:
            _equal(alone, play(jax.random.split(jax.random.key(1), 4)[3], levels[3]))


def test_examinations_lie_between_0_and_1_and_do_not_depend_on_the_key(exact: Any) -> None:
    examine = jax.jit(lambda key, level: exact.examine(lambda o: _act(exact, o), key, level))
    for level in range(exact.levels):
        one = examine(jax.random.key(1), jnp.asarray(level, jnp.int32))
        _equal(one, examine(jax.random.key(2), jnp.asarray(level, jnp.int32)))
        assert 0.0 <= float(one.success) <= 1.0
        assert one.success.dtype == one.fitness.dtype == jnp.float32
        assert one.success.shape == one.fitness.shape == ()


def test_an_examination_of_a_robot_depends_on_the_key_alone() -> None:
    task = ROBOTS["locomotion"]
    examine = jax.jit(lambda key: task.examine(lambda o: _act(task, o), key, LEVEL))
    one, again, other = (examine(jax.random.key(seed)) for seed in (1, 1, 2))
    _equal(one, again)
    assert float(one.fitness) != float(other.fitness)
    assert one.success.dtype == one.fitness.dtype == jnp.float32
    assert one.success.shape == one.fitness.shape == ()


def test_a_task_is_hashable_and_has_a_canonical_form(task: Any) -> None:
    assert hash(task) == hash(replace(task))
    assert task == replace(task)
    assert canonical_json(task)
    assert task.revision >= 1
    assert isinstance(task.name, str)
