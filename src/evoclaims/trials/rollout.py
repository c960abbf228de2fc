"""The evaluation of final policies, the same for every method."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import PRNGKeyArray

from evoclaims.envs.base import Episode, PolicyFn, Task


def score_every_level(task: Task, policy: PolicyFn, key: PRNGKeyArray) -> Episode:
    """Examine a policy on each level separately; the leaves of the result have shape [levels].

    The key must come from the trial's evaluation stream, which training never draws from.
    """
    levels = jnp.arange(task.levels, dtype=jnp.int32)
    keys = jax.random.split(key, task.levels)
    return jax.vmap(lambda k, level: task.examine(policy, k, level))(keys, levels)
