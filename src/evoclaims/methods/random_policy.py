"""A random policy: one network with random weights and no training; a learner must beat it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Int, PRNGKeyArray

from evoclaims.envs.base import Task
from evoclaims.methods.base import Policy, Progress
from evoclaims.methods.flat_champion import Champion, champion_policy, evaluate, first_champion
from evoclaims.networks.base import Network
from evoclaims.networks.mlp import Mlp


@dataclass(frozen=True)
class RandomPolicy:
    """Draw one network's parameters from N(0, 1) and keep them.

    Attributes:
        network: the policy's network, whose parameters are drawn.
    """

    name: ClassVar[str] = "random_policy"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ()

    network: Network = Mlp((32,) * 4)

    def init(self, key: PRNGKeyArray, task: Task) -> Champion:
        """Draw the network."""
        return first_champion(jax.random.normal(key, (self.network.size(task.observation_size, task.action_size),)))

    def step(self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: Champion) -> tuple[Champion, Progress]:
        """Run one episode."""
        episodes = evaluate(self.network, task, key, level, state.parameters[None])
        episode = jax.tree.map(lambda leaf: leaf[0], episodes)
        healthy = jnp.isfinite(episode.fitness)
        return Champion(parameters=state.parameters, episode=episode), Progress(
            fitness=episode.fitness, success=episode.success, healthy=healthy, metrics={}
        )

    def best(self, task: Task, state: Champion) -> Policy:
        """Return the network."""
        return champion_policy(self.network, task, state)

    def cost(self, task: Task) -> int:
        """Return the environment steps of one episode, at its longest."""
        return task.horizon
