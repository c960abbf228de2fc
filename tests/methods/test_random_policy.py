"""The random policy learns nothing, and is random."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.random_policy import RandomPolicy
from evoclaims.networks.mlp import Mlp

METHOD, TASK = RandomPolicy(Mlp((8,))), NParity(3)


def test_steps_change_nothing_but_what_is_known_of_it() -> None:
    key = jax.random.key(0)
    state = METHOD.init(key, TASK)
    for step in range(3):
        following, progress = METHOD.step(jax.random.key(step), TASK, jnp.asarray(1), state)
        np.testing.assert_array_equal(following.parameters, state.parameters)
        policy = METHOD.best(TASK, following)
        examined = TASK.examine(policy, key, jnp.asarray(1))
        assert float(progress.fitness) == float(examined.fitness)
        assert float(progress.success) == float(examined.success)
        assert bool(progress.healthy)
        state = following


def test_parameters_are_standard_normal_and_differ_between_seeds() -> None:
    method = RandomPolicy(Mlp((64,) * 2))
    draws = np.stack([method.init(jax.random.key(seed), TASK).parameters for seed in range(4)])
    assert len(np.unique(draws[:, 0])) == 4
    assert abs(draws.mean()) < 0.05
    assert abs(draws.std() - 1) < 0.05


def test_a_step_costs_an_episode() -> None:
    assert METHOD.cost(TASK) == 8
