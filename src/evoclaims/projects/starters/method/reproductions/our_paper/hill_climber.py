"""A method: four pure functions of a state whose shapes never change."""

from dataclasses import dataclass
from typing import ClassVar

import jax

from evoclaims.methods import Progress, champion_policy, evaluate_with_champion, first_champion, streams
from evoclaims.networks import Mlp


@dataclass(frozen=True)
class HillClimber:
    """(1 + 1) evolution: keep the child where it is at least as good."""

    name: ClassVar[str] = "hill_climber"
    revision: ClassVar[int] = 1  # raise it when the method computes something else
    packages: ClassVar[tuple[str, ...]] = ()  # what computes it beyond jax and numpy, such as ("optax",)
    network: Mlp = Mlp((8,))
    spread: float = 0.5

    def init(self, key, task):
        """Return the state before the first step."""
        return first_champion(jax.random.normal(key, (self.network.size(task.observation_size, task.action_size),)))

    def step(self, key, task, level, state):
        """Return the next state, and what is reported of this step."""
        child_key, episode_key = streams(key, "child", "episode")
        child = state.parameters + self.spread * jax.random.normal(child_key, state.parameters.shape)
        _, best, healthy = evaluate_with_champion(self.network, task, episode_key, level, child[None], state)
        return best, Progress(best.episode.fitness, best.episode.success, healthy, metrics={})

    def best(self, task, state):
        """Return the policy to judge."""
        return champion_policy(self.network, task, state)

    def cost(self, task):
        """Return the environment steps of a step: the child's episode and its parent's."""
        return 2 * task.horizon
