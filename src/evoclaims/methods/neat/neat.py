"""NEAT (Stanley and Miikkulainen 2002): evolves the weights and the structure of a policy's network."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from evoclaims.envs.base import Task
from evoclaims.methods.neat.evolution import GenomeMethod
from evoclaims.methods.neat.settings import PAPER, Settings
from evoclaims.networks.graph import GraphNetwork


@dataclass(frozen=True)
class Neat(GenomeMethod):
    """NEAT whose genomes are the policies' networks."""

    name: ClassVar[str] = "neat"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ("llvmlite",)

    settings: Settings = PAPER

    def network(self, task: Task) -> GraphNetwork:
        """Return the policy's network."""
        return GraphNetwork(task.observation_size, task.action_size, self.settings.activations, self.settings.output)
