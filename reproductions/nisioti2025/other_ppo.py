"""PPO as the authors' Brax runs it: environments that return to their first state, and a noisy examination."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import jax
from jaxtyping import Array, Float, Int, PRNGKeyArray

from evoclaims.core.errors import UserError
from evoclaims.core.foreign import implicit_promotions
from evoclaims.core.pytree import pytree, select, static
from evoclaims.envs.base import Task, TaskState
from evoclaims.methods import Policy, Ppo
from evoclaims.methods.collect import Interaction, networks
from evoclaims.methods.ppo import PpoState
from reproductions.nisioti2025.first_level_ppo import FirstLevelPpo


@pytree
class FirstStates(Interaction):
    """Parallel running episodes, each of whose environments has one start for the whole training.

    Attributes:
        first: the starts; leaves have a leading axis [environments].
        keeps_counters: whether an ended episode's counters, such as the stones crossed, go on in the next one.
    """

    first: TaskState
    keeps_counters: bool = static()

    def at_level(self, task: Task, key: PRNGKeyArray, level: Int[Array, ""]) -> FirstStates:
        """Return the same episodes, or new starts when the level has changed."""
        fresh = Interaction.start(task, key, level, self.states.reward.shape[0])
        return select(level != self.level, replace(self, states=fresh.states, level=level, first=fresh.states), self)

    def after(self, task: Any, key: PRNGKeyArray, reached: TaskState) -> FirstStates:
        """Return the episodes after a step to the states `reached`, each that ended at its environment's first state.

        Counters that are kept start anew where all is done, as with all stones crossed: else every step would end.
        """
        first = self.first
        if self.keeps_counters:
            inner = first.inner
            done = jax.vmap(task.reached)(reached.inner)
            memory = jax.vmap(select)(done, inner.memory, reached.inner.memory)
            first = replace(first, inner=replace(inner, memory=memory))
        ended = reached.terminated | reached.truncated
        return replace(self, states=jax.vmap(select)(ended, first, reached))


@dataclass(frozen=True)
class OtherPpo(Ppo):
    """PPO with the starts and the examination of the authors' Brax.

    Attributes:
        first_state: each environment draws one start, before training, and returns to it (Brax's `AutoResetWrapper`).
        kept_counters: a task's counters go on when an episode ends, as they are not part of that state.
        frozen_noise: the policy is examined with its noise, which is the same draw in every step of every episode.
    """

    name: ClassVar[str] = "other_ppo"

    first_state: bool = False
    kept_counters: bool = False
    frozen_noise: bool = False

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        if self.kept_counters and not self.first_state:
            raise UserError("PPO keeps counters only where environments return to their first state (first_state).")

    def init(self, key: PRNGKeyArray, task: Task) -> PpoState:
        """Draw the networks' parameters and start the environments at level 0; raises as `Ppo.init` does."""
        state = super().init(key, task)
        if not self.first_state:
            return state
        begun = state.interaction
        return replace(state, interaction=FirstStates(begun.states, begun.level, begun.states, self.kept_counters))

    def best(self, task: Task, state: PpoState) -> Policy:
        """Return the current policy, deterministic or with frozen noise; both are functions of the observation."""
        if not self.frozen_noise:
            return super().best(task, state)
        make = networks.make_inference_fn(self._networks(task))

        def function(parameters: Any, observation: Float[Array, " observation"]) -> Float[Array, " action"]:
            with implicit_promotions():
                action: Array = make(parameters)(observation, jax.random.key(0))[0]
            return action

        return Policy(parameters=(state.statistics, state.networks.policy), function=function)


@dataclass(frozen=True)
class OtherFirstLevelPpo(OtherPpo, FirstLevelPpo):
    """The same, trained on the first level all along."""

    name: ClassVar[str] = "other_first_level_ppo"
