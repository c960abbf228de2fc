"""A robot's start and step as one kernel each, against the same as XLA compiles them, along whole episodes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from plain_mujoco import quickly_compiled

from evoclaims.envs.base import TaskState
from evoclaims.envs.ecorobot import robot_task
from evoclaims.envs.ecorobot.locomotion import Obstacles
from evoclaims.envs.ecorobot.robot_task import RobotTask
from evoclaims.envs.ecorobot.robots import ANT
from evoclaims.envs.ecorobot.stones import SteppingStones

pytestmark = pytest.mark.slow

ROBOTS, STEPS = 6, 400
TASKS: dict[str, RobotTask] = {"stones": SteppingStones(), "obstacles": Obstacles(), "ant": SteppingStones(robot=ANT)}
# Largest difference of an observation: of nearly all steps, and of any. In float32 a foot's contact may begin a
# rounding error earlier or later, and velocities are up to 10.
NEARLY_ALL = {"stones": 1e-5, "obstacles": 1e-3, "ant": 1e-3}
ANY = {"stones": 1e-4, "obstacles": 1.0, "ant": 1.0}


@pytest.mark.parametrize("name", TASKS)
def test_a_start_in_one_kernel_is_the_start(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    task = TASKS[name]

    keys = jax.random.split(jax.random.key(0), ROBOTS)

    def starts() -> TaskState:
        drawn: TaskState = quickly_compiled(jax.vmap(lambda key: task.reset(key, jnp.int32(0))))(keys)
        return drawn

    made = starts()
    monkeypatch.setattr(robot_task, "_start_kernel", lambda task: lambda *drawn: task.plain_start(*drawn[:2]))
    expected = starts()
    assert jax.tree.structure(made) == jax.tree.structure(expected)
    for a, b in zip(jax.tree.leaves(made), jax.tree.leaves(expected), strict=True):
        assert (a.shape, a.dtype) == (b.shape, b.dtype)
        np.testing.assert_allclose(a, b, rtol=1e-5, atol=1e-6)
    assert len(np.unique(made.observation, axis=0)) == ROBOTS


@pytest.mark.parametrize("name", TASKS)
def test_a_step_in_one_kernel_is_the_step(name: str) -> None:
    task = TASKS[name]
    state = jax.vmap(task.reset, (0, None))(jax.random.split(jax.random.key(0), ROBOTS), jnp.int32(0))
    held = jax.random.uniform(jax.random.key(1), (STEPS // 10, ROBOTS, task.action_size), minval=-1.0, maxval=1.0)
    actions = jnp.repeat(held, 10, axis=0)
    plain = quickly_compiled(jax.vmap(task.plain_step))
    states = [state]
    for action in actions:
        states.append(plain(states[-1], action))
    before, expected = (jax.tree.map(lambda *leaves: jnp.stack(leaves), *part) for part in (states[:-1], states[1:]))
    made = jax.vmap(jax.vmap(task.step))(before, actions)
    assert jax.tree.structure(made) == jax.tree.structure(expected)
    for a, b in zip(jax.tree.leaves(made), jax.tree.leaves(expected), strict=True):
        assert (a.shape, a.dtype) == (b.shape, b.dtype)
    differences = np.abs(made.observation - expected.observation).max(axis=-1)
    assert np.median(differences) < 1e-5
    assert np.quantile(differences, 0.99) < NEARLY_ALL[name]
    assert differences.max() < ANY[name]
    assert np.quantile(np.abs(made.reward - expected.reward), 0.99) < NEARLY_ALL[name]
    for marks in ("terminated", "truncated"):
        assert np.mean(np.asarray(getattr(made, marks)) != np.asarray(getattr(expected, marks))) < 0.01
    np.testing.assert_array_equal(made.inner.time, expected.inner.time)


@pytest.mark.parametrize("name", ["obstacles", "ant"])
def test_few_contacts_make_a_step_shorter_and_change_no_bit(name: str) -> None:
    def path(touching: int) -> list[np.ndarray[Any, Any]]:
        task = replace(TASKS[name], robot=replace(TASKS[name].robot, touching=touching))
        state = jax.vmap(task.reset, (0, None))(jax.random.split(jax.random.key(0), 40), jnp.int32(0))

        def step(state: Any, held: Any) -> Any:
            def follow(state: Any, _: None) -> Any:
                return jax.vmap(task.step)(state, held), None

            state, _ = jax.lax.scan(follow, state, None, length=10)
            return state, (state.inner.body, state.observation, state.reward)

        held = jax.random.uniform(jax.random.key(1), (20, 40, task.action_size), minval=-1.0, maxval=1.0)
        return [np.asarray(leaf) for leaf in jax.tree.leaves(jax.jit(lambda s: jax.lax.scan(step, s, held))(state)[1])]

    always_whole, often_short = path(TASKS[name].robot.contacts), path(2)  # two are touched by some, not by all
    for a, b in zip(always_whole, often_short, strict=True):
        np.testing.assert_array_equal(a, b)
