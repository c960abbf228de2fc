"""NEAT (Stanley and Miikkulainen 2002): evolves the weights and the structure of a policy's network."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from jaxtyping import Array, Int, PRNGKeyArray

from evoclaims.envs.base import Task
from evoclaims.methods.base import Policy, Progress
from evoclaims.methods.neat.evolution import Evolution, begin, evolve, policy
from evoclaims.methods.neat.settings import PAPER, Settings
from evoclaims.networks.graph import GraphNetwork


@dataclass(frozen=True)
class Neat:
    """NEAT whose genomes are the policies' networks."""

    name: ClassVar[str] = "neat"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ("llvmlite",)

    settings: Settings = PAPER

    def init(self, key: PRNGKeyArray, task: Task) -> Evolution:
        """Draw the first population; a `UserError` says when the smallest network does not fit."""
        return begin(key, self.settings, self.encoding(task))

    def step(
        self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: Evolution
    ) -> tuple[Evolution, Progress]:
        """Run one generation."""
        return evolve(key, self.settings, self.encoding(task), task, level, state)

    def best(self, task: Task, state: Evolution) -> Policy:
        """Return the best genome of the last population that was evaluated, on the level it was evaluated on."""
        return policy(self.encoding(task), state)

    def cost(self, task: Task) -> int:
        """Return the environment steps of one generation, at the longest episode."""
        return self.settings.population * task.horizon

    def encoding(self, task: Task) -> GraphNetwork:
        """Return how a genome encodes a policy of the task's size."""
        return GraphNetwork(task.observation_size, task.action_size, self.settings.activations, self.settings.output)
