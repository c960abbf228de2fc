"""Collecting experience from parallel environments that reset themselves, with parts of Brax and in its layout."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Int, PRNGKeyArray

from evoclaims.core.foreign import Later
from evoclaims.core.keys import streams
from evoclaims.core.pytree import pytree, select
from evoclaims.envs.base import Task, TaskState

losses = Later("brax.training.agents.ppo.losses")
networks = Later("brax.training.agents.ppo.networks")
running_statistics = Later("brax.training.acme.running_statistics")
specs = Later("brax.training.acme.specs")
types = Later("brax.training.types")


Act = Callable[[Array, Array], tuple[Array, Any]]
"""A stochastic policy, as Brax's `make_inference_fn` gives it: (observations, key) -> (actions, extras)."""


@pytree
class Interaction:
    """Parallel running episodes.

    Attributes:
        states: leaves have a leading axis [environments].
        level: the level they started at.
    """

    states: TaskState
    level: Int[Array, ""]

    @staticmethod
    def start(task: Task, key: PRNGKeyArray, level: Int[Array, ""], environments: int) -> Interaction:
        """Start `environments` episodes at `level`."""
        keys = jax.random.split(key, environments)
        return Interaction(
            states=jax.vmap(task.reset, in_axes=(0, None))(keys, level),
            level=level,
        )

    def at_level(self, task: Task, key: PRNGKeyArray, level: Int[Array, ""]) -> Interaction:
        """Return the same episodes, or new ones when the level has changed."""
        fresh = Interaction.start(task, key, level, self.states.reward.shape[0])
        return select(level != self.level, fresh, self)

    def after(self, task: Task, key: PRNGKeyArray, reached: TaskState) -> Interaction:
        """Return the episodes after a step to the states `reached`, with a fresh one for each that ended."""
        fresh = Interaction.start(task, key, self.level, self.states.reward.shape[0])
        ended = reached.terminated | reached.truncated
        return Interaction(states=jax.vmap(select)(ended, fresh.states, reached), level=self.level)


def collect(
    task: Task, act: Act, key: PRNGKeyArray, interaction: Interaction, rounds: int, unroll_length: int
) -> tuple[Interaction, Any]:
    """Act for `rounds` × `unroll_length` steps in every environment.

    Returns:
        The episodes' current state, and transitions with leaves [rounds × environments, unroll_length, …]: one
        trajectory per row, as Brax's loss expects.
    """

    def one_step(interaction: Interaction, key: Array) -> tuple[Interaction, Any]:
        act_key, reset_key = streams(key, "act", "reset")
        states = interaction.states
        action, extras = act(states.observation, act_key)
        reached = jax.vmap(task.step)(states, action)
        transition = types.Transition(
            observation=states.observation,
            action=action,
            reward=reached.reward,
            discount=1.0 - reached.terminated.astype(jnp.float32),
            next_observation=reached.observation,
            extras={
                "policy_extras": extras,
                "state_extras": {"truncation": reached.truncated.astype(jnp.float32)},
            },
        )
        return interaction.after(task, reset_key, reached), transition

    keys = jax.random.split(key, rounds * unroll_length)
    interaction, data = jax.lax.scan(one_step, interaction, keys)

    def by_trajectory(leaf: Array) -> Array:
        timed = leaf.reshape(rounds, unroll_length, *leaf.shape[1:])
        return jnp.swapaxes(timed, 1, 2).reshape(-1, unroll_length, *leaf.shape[2:])

    return interaction, jax.tree.map(by_trajectory, data)
