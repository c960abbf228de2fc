"""The tasks in Brax's API: the same numbers, and usable by Brax's own code."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from brax.envs.wrappers import training

from evoclaims.core.foreign import implicit_promotions
from evoclaims.envs.ecorobot.brax_env import BraxEnv
from evoclaims.envs.ecorobot.stones import SteppingStones

pytestmark = pytest.mark.slow

TASK = SteppingStones(episode_steps=3)
EAST = jnp.array([0.0, 1.0, 0.0, 0.0])


def test_a_step_in_braxs_api_is_the_tasks_own_step() -> None:
    env = BraxEnv(TASK)
    key = jax.random.key(3)
    own, state = TASK.reset(key, jnp.zeros((), jnp.int32)), env.reset(key)
    np.testing.assert_array_equal(state.obs, own.observation)
    own, state = TASK.step(own, EAST), env.step(state, EAST)
    np.testing.assert_array_equal(state.obs, own.observation)
    assert float(state.reward) == float(own.reward)
    assert float(state.done) == 0.0
    assert float(state.metrics["x"]) == float(own.inner.pose.place[0])
    assert (env.observation_size, env.action_size, env.backend) == (10, 4, "mjx")


def test_an_old_key_is_the_typed_key_that_it_stands_for() -> None:
    env = BraxEnv(TASK)
    old = env.reset(jax.random.PRNGKey(5))
    np.testing.assert_array_equal(old.obs, env.reset(jax.random.key(5)).obs)


def test_braxs_wrappers_truncate_and_restart_episodes() -> None:
    with implicit_promotions():
        env = training.wrap(BraxEnv(TASK), episode_length=3, action_repeat=1)
        keys = jax.random.split(jax.random.PRNGKey(0), 2)
        state = first = jax.jit(env.reset)(keys)
        step = jax.jit(env.step)
        ends = []
        for _ in range(3):
            state = step(state, jnp.tile(EAST, (2, 1)))
            ends.append((np.asarray(state.done).tolist(), np.asarray(state.info["truncation"]).tolist()))
    assert ends == [([0, 0], [0, 0]), ([0, 0], [0, 0]), ([1, 1], [1, 1])]
    np.testing.assert_array_equal(state.obs, first.obs)
