"""A simulation that diverges ends its episode, and leaves no number that is not finite."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from evoclaims.envs.ecorobot import physics
from evoclaims.envs.ecorobot.locomotion import Locomotion
from evoclaims.envs.ecorobot.robots import SIMPLE_ROB

TASK = Locomotion(robot=SIMPLE_ROB, episode_steps=10)


@pytest.mark.parametrize(
    ("number", "stable"), [(1.0, True), (1e10, True), (2e10, False), (-2e10, False), (np.inf, False), (np.nan, False)]
)
@pytest.mark.parametrize("where", ["position", "velocity", "acceleration"])
def test_numbers_beyond_mujocos_limit_are_unstable(where: str, number: float, stable: bool) -> None:
    calm = physics.Body(position=jnp.ones(3), velocity=jnp.ones(3), acceleration=jnp.ones(3))
    body = replace(calm, **{where: jnp.array([0.0, number, 0.0])})
    assert bool(physics.is_stable(body)) is stable


def test_a_step_that_diverges_pays_nothing_and_ends_the_episode_where_it_was() -> None:
    start = TASK.reset(jax.random.key(0), jnp.asarray(0))
    fast = replace(start.inner.body, velocity=jnp.full_like(start.inner.body.velocity, 1e12))
    states = [start, replace(start, inner=replace(start.inner, body=fast))]
    step = jax.jit(TASK.step)
    usual, diverged = (step(state, jnp.ones(TASK.action_size)) for state in states)
    assert not bool(usual.terminated)
    assert float(usual.reward) != 0.0
    assert (bool(diverged.terminated), bool(diverged.truncated), float(diverged.reward)) == (True, False, 0.0)
    np.testing.assert_array_equal(diverged.inner.body.position, start.inner.body.position)
    assert np.isfinite(diverged.observation).all()
