"""A robot's start and step as one kernel each, against the same as NumPy evaluates it, along whole episodes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from evoclaims.envs.base import TaskState
from evoclaims.envs.ecorobot.locomotion import Obstacles
from evoclaims.envs.ecorobot.robot_task import RobotTask
from evoclaims.envs.ecorobot.robots import ANT, HALF_CHEETAH, SIMPLE_ROB
from evoclaims.envs.ecorobot.stones import SteppingStones
from evoclaims.kernels import in_numpy
from evoclaims.kernels.emit.machine_code import lanes
from evoclaims.kernels.trace.in_numpy import ELEMENTARY

pytestmark = pytest.mark.slow

ROBOTS, STEPS, COMPARED = 40, 200, 16
TASKS: dict[str, RobotTask] = {
    # Fewer contacts in most steps than robots have: both ways of these kernels are taken. An ant's is whole where a
    # foot touches two walls, or its centre is inside one.
    "stones": SteppingStones(robot=replace(SIMPLE_ROB, touching=0)),
    "obstacles": Obstacles(robot=replace(HALF_CHEETAH, touching=2)),
    "ant": SteppingStones(robot=ANT),
}
# Largest difference of an observation: of nearly all steps, and of any. In float32 a foot's contact may begin a
# rounding error earlier or later, and velocities are up to 10.
NEARLY_ALL = {"stones": 1e-5, "obstacles": 1e-3, "ant": 1e-3}
ANY = {"stones": 1e-4, "obstacles": 1.0, "ant": 1.0}

# Of the frames of a vector's robots, more than this go the whole way; an ant's seldom do.
LEAST = {"stones": 0.01, "obstacles": 0.01, "ant": 0.0}


def _run(task: RobotTask) -> tuple[TaskState, TaskState, Any]:
    """Return the states before and after each step, and its action; leaves [steps, robots, …]."""
    state = jax.vmap(task.reset, (0, None))(jax.random.split(jax.random.key(0), ROBOTS), jnp.int32(0))
    shape = (STEPS // 10 + 1, ROBOTS, task.action_size)
    *held, leaning = jax.random.uniform(jax.random.key(1), shape, minval=-1.0, maxval=1.0)
    held = jnp.clip(jnp.stack([one + leaning for one in held]), -1.0, 1.0)  # each goes its way, to a wall

    def step(state: TaskState, action: Any) -> Any:
        after = jax.vmap(task.step)(state, action)
        return after, (state, after)

    actions = jnp.repeat(held, 10, axis=0)
    before, after = jax.jit(lambda s: jax.lax.scan(step, s, actions)[1])(state)
    return before, after, actions


_ran: Callable[[str], tuple[TaskState, TaskState, Any]] = cache(lambda name: _run(TASKS[name]))


def _evaluated(function: Any, like: TaskState, *arguments: Any) -> Any:
    """Return what NumPy makes of a function of batches, with the structure of a result that is known."""
    leaves, structure = jax.tree.flatten(arguments)
    made = in_numpy(lambda *given: function(*jax.tree.unflatten(structure, given)), *map(np.asarray, leaves))
    for a, b in zip(jax.tree.leaves(like), made, strict=True):
        assert (a.shape, a.dtype) == (b.shape, b.dtype)
    return jax.tree.unflatten(jax.tree.structure(like), made)


@pytest.mark.parametrize("name", TASKS)
def test_a_start_in_one_kernel_is_the_start(name: str) -> None:
    made = jax.tree.map(lambda leaf: leaf[0], _ran(name)[0])
    expected = _evaluated(TASKS[name].plain_start, made, made.inner.body.position, made.inner.body.velocity)
    for a, b in zip(jax.tree.leaves(made), jax.tree.leaves(expected), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-5, atol=1e-6)
    assert len(np.unique(made.observation, axis=0)) == ROBOTS


@cache
def _by_numpy(name: str) -> tuple[Any, TaskState, float]:
    """Return some robots' steps, those steps by NumPy, and which share of vectors goes the whole way in a frame."""
    some = jax.tree.map(lambda leaf: np.asarray(leaf[:, -COMPARED:]).reshape(-1, *leaf.shape[2:]), _ran(name))
    before, made, actions = some
    states, given = STEPS * COMPARED, list[Any]()

    def seen(condition: Any) -> Any:
        given.append(np.broadcast_to(condition.reshape(len(condition), -1).any(axis=1), states))
        return condition

    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(ELEMENTARY, "seldom", seen)
        expected = _evaluated(TASKS[name].plain_step, made, before, actions)
    # The robots of a vector go the same way, in each frame of a step.
    frames, width = TASKS[name].robot.frames, math.gcd(lanes(), COMPARED)
    whole = np.array(given).reshape(frames, -1, states // width, width).any(axis=(1, 3))
    return some, expected, float(whole.mean())


@pytest.mark.parametrize("name", TASKS)
def test_a_step_in_one_kernel_is_the_step(name: str) -> None:
    (_, made, _), expected, _ = _by_numpy(name)
    differences = np.abs(made.observation - expected.observation).max(axis=-1)
    assert np.median(differences) < 1e-5
    assert np.quantile(differences, 0.99) < NEARLY_ALL[name]
    assert differences.max() < ANY[name]
    assert np.quantile(np.abs(made.reward - expected.reward), 0.99) < NEARLY_ALL[name]
    for marks in ("terminated", "truncated"):
        assert np.mean(np.asarray(getattr(made, marks)) != np.asarray(getattr(expected, marks))) < 0.01
    np.testing.assert_array_equal(made.inner.time, expected.inner.time)


@pytest.mark.parametrize("name", TASKS)
def test_both_ways_of_a_step_are_taken(name: str) -> None:
    assert LEAST[name] < _by_numpy(name)[2] < 0.9


@pytest.mark.parametrize("name", TASKS)
def test_few_contacts_make_a_step_shorter_and_change_no_bit(name: str) -> None:
    task = TASKS[name]
    _, always_whole, _ = _run(replace(task, robot=replace(task.robot, touching=task.robot.contacts)))
    for a, b in zip(jax.tree.leaves(always_whole), jax.tree.leaves(_ran(name)[1]), strict=True):
        np.testing.assert_array_equal(a, b)
