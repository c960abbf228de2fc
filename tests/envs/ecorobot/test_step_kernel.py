"""A robot's step as one kernel, executed by a machine for tests, against the same step as XLA compiles it."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from plain_mujoco import quickly_compiled

from evoclaims.envs.ecorobot.obstacles import Obstacles
from evoclaims.envs.ecorobot.robot_task import RobotTask
from evoclaims.envs.ecorobot.robots import ANT
from evoclaims.envs.ecorobot.stones import SteppingStones

pytestmark = pytest.mark.slow

ROBOTS = 40
TASKS: dict[str, RobotTask] = {
    "stones": SteppingStones(),
    "obstacles": Obstacles(),
    "ant": SteppingStones(robot=ANT),
}
# In float32 a foot's contact may begin a rounding error earlier: of legged robots most agree, and the others nearly.
EXACT = {"stones": 1e-5, "obstacles": 2e-3, "ant": 2e-3}


@pytest.mark.usefixtures("gpu")
@pytest.mark.parametrize("name", TASKS)
def test_a_step_in_one_kernel_is_the_step(name: str) -> None:
    task = TASKS[name]
    plain = quickly_compiled(jax.vmap(task.plain_step))
    keys = jax.random.split(jax.random.key(0), ROBOTS)
    state = jax.vmap(task.reset, (0, None))(keys, jnp.int32(0))
    actions = jax.random.uniform(jax.random.key(1), (3, ROBOTS, task.action_size), minval=-1.0, maxval=1.0)
    for number in range(45):  # 15 steps under each action: they fall, and meet walls
        following = plain(state, actions[number // 15])
        if number in (20, 44):
            made = jax.vmap(task.step)(state, actions[number // 15])
            _compare(made, following, EXACT[name])
        state = following


def _compare(made: Any, expected: Any, exact: float) -> None:
    """Compare states."""
    assert jax.tree.structure(made) == jax.tree.structure(expected)
    np.testing.assert_allclose(made.inner.body.position, expected.inner.body.position, atol=exact / 10)
    np.testing.assert_allclose(made.observation, expected.observation, atol=exact)
    np.testing.assert_allclose(made.reward, expected.reward, atol=exact)
    np.testing.assert_allclose(np.median(np.abs(made.observation - expected.observation)), 0.0, atol=1e-6)
    for a, b in zip(jax.tree.leaves(made), jax.tree.leaves(expected), strict=True):
        assert (a.shape, a.dtype) == (b.shape, b.dtype)
        if a.dtype != jnp.float32:
            np.testing.assert_array_equal(a, b)
