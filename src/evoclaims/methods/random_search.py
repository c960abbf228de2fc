"""Random search: the negative control, with the encoding and the number of evaluations of CMA-ES."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Int, PRNGKeyArray

from evoclaims.core.errors import UserError
from evoclaims.core.keys import streams
from evoclaims.envs.base import Task
from evoclaims.methods.base import Policy, Progress
from evoclaims.methods.flat_champion import Champion, champion_policy, evaluate_with_champion, first_champion
from evoclaims.networks.all_skips import AllSkips
from evoclaims.networks.base import Network


@dataclass(frozen=True)
class RandomSearch:
    """Draw a population from N(0, std²) at every step and keep the best individual seen.

    Attributes:
        population: individuals drawn per step.
        std: standard deviation of every parameter; 1 is what CMA-ES starts from.
        network: the policy's network, whose parameters are drawn.
    """

    name: ClassVar[str] = "random_search"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ()

    population: int = 256
    std: float = 1.0
    network: Network = AllSkips()

    def __post_init__(self) -> None:
        """Check the size and the spread."""
        if not (self.population >= 1 and 0 < self.std < math.inf):
            raise UserError(
                f"Random search has population={self.population} and std={self.std}. Write a population of at least "
                "1 and a finite std above 0."
            )

    def init(self, key: PRNGKeyArray, task: Task) -> Champion:
        """Start without a champion."""
        return first_champion(jnp.zeros(self.network.size(task.observation_size, task.action_size)))

    def step(self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: Champion) -> tuple[Champion, Progress]:
        """Draw and evaluate one population."""
        draw_key, episode_key = streams(key, "draw", "episode")
        population = self.std * jax.random.normal(draw_key, (self.population, state.parameters.shape[0]))
        _, champion, healthy = evaluate_with_champion(self.network, task, episode_key, level, population, state)
        return champion, Progress(
            fitness=champion.episode.fitness, success=champion.episode.success, healthy=healthy, metrics={}
        )

    def best(self, task: Task, state: Champion) -> Policy:
        """Return the champion."""
        return champion_policy(self.network, task, state)

    def cost(self, task: Task) -> int:
        """Return the environment steps of one population, at the longest episode, but for the champion's own."""
        return self.population * task.horizon
