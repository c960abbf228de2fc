"""Faults of tasks: bugs in an environment's observations, actions, rewards and levels."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PRNGKeyArray

from evoclaims.core.keys import stream
from evoclaims.envs.base import Episode, PolicyFn, TaskState, fitting
from evoclaims.envs.gates.truth_table import TruthTable
from evoclaims.mutants.planting import Fault


class FaultyTask(Fault):
    """A task with wrong observations, actions, rewards or levels; a subclass says which."""

    def seen(self, observation: Float[Array, " observation"]) -> Float[Array, " observation"]:
        """Return what the policy sees of an observation."""
        return observation

    def done(self, action: Float[Array, " action"]) -> Float[Array, " action"]:
        """Return the action that is taken."""
        return action

    def paid(self, reward: Float[Array, ""], key: PRNGKeyArray) -> Float[Array, ""]:
        """Return the value that replaces a reward, or a whole episode's fitness."""
        return reward

    def asked(self, level: Int[Array, ""]) -> Int[Array, ""]:
        """Return the level that replaces a requested one."""
        return level

    def reset(self, key: PRNGKeyArray, level: Int[Array, ""]) -> TaskState:
        """Start an episode of the sound task."""
        state: TaskState = self.sound.reset(key, self.asked(level))
        return replace(state, observation=self.seen(state.observation))

    def step(self, state: TaskState, action: Float[Array, " action"]) -> TaskState:
        """Act in the sound task; random numbers follow from the observation, since a step has no key."""
        following: TaskState = self.sound.step(state, self.done(fitting(self.sound, action)))
        bits = jax.lax.bitcast_convert_type(jnp.sum(following.observation) + jnp.sum(action), jnp.uint32)
        return replace(
            following,
            observation=self.seen(following.observation),
            reward=self.paid(following.reward, jax.random.fold_in(jax.random.key(0), bits)),
        )

    def episode(self, policy: PolicyFn, key: PRNGKeyArray, level: Int[Array, ""]) -> Episode:
        """Run a training episode of the sound task."""
        return self._settled(self.sound.episode(self._between(policy), key, self.asked(level)), key)

    def examine(self, policy: PolicyFn, key: PRNGKeyArray, level: Int[Array, ""]) -> Episode:
        """Run an examination of the sound task."""
        return self._settled(self.sound.examine(self._between(policy), key, self.asked(level)), key)

    def _between(self, policy: PolicyFn) -> PolicyFn:
        """Return the policy as the sound task calls it."""
        return lambda observation: self.done(fitting(self.sound, policy(self.seen(observation))))

    def _settled(self, episode: Episode, key: PRNGKeyArray) -> Episode:
        """Return an episode with its fitness replaced."""
        return replace(episode, fitness=self.paid(episode.fitness, stream(key, "paid")))


class Blind(FaultyTask):
    """Every observation is 0."""

    says: ClassVar[str] = "shows nothing"

    def seen(self, observation: Float[Array, " observation"]) -> Float[Array, " observation"]:
        """Return zeros."""
        return jnp.zeros_like(observation)


class Paralysed(FaultyTask):
    """Every action is 0."""

    says: ClassVar[str] = "takes no action"

    def done(self, action: Float[Array, " action"]) -> Float[Array, " action"]:
        """Return zeros."""
        return jnp.zeros_like(action)


class PaysNothing(FaultyTask):
    """Every reward is 0."""

    says: ClassVar[str] = "pays nothing"

    def paid(self, reward: Float[Array, ""], key: PRNGKeyArray) -> Float[Array, ""]:
        """Return 0."""
        return jnp.zeros_like(reward)


class ReversesReward(FaultyTask):
    """Every reward has the other sign."""

    says: ClassVar[str] = "reverses rewards"

    def paid(self, reward: Float[Array, ""], key: PRNGKeyArray) -> Float[Array, ""]:
        """Return the negative."""
        return -reward


class PaysAtRandom(FaultyTask):
    """Rewards are drawn from [0, 1)."""

    says: ClassVar[str] = "pays at random"

    def paid(self, reward: Float[Array, ""], key: PRNGKeyArray) -> Float[Array, ""]:
        """Return a random number."""
        return jax.random.uniform(key)


class StaysAtFirstLevel(FaultyTask):
    """Every episode is on the first level."""

    says: ClassVar[str] = "stays at the first level"

    def asked(self, level: Int[Array, ""]) -> Int[Array, ""]:
        """Return 0."""
        return jnp.minimum(level, 0)  # the engine refuses a reset that does not read the level


class IgnoresAnInput(Fault):
    """A circuit whose truth table treats the first input that is ever 1 as 0."""

    says: ClassVar[str] = "ignores an input"

    @property
    def table(self) -> TruthTable:
        """The table, where each row has the targets of the row with that input at 0, if there is one."""
        right: TruthTable = self.sound.table
        first = int(np.argmax(right.inputs.any(axis=0)))
        index = {row.tobytes(): number for number, row in enumerate(right.inputs)}
        without = right.inputs.copy()
        without[:, first] = 0.0
        taken = [index.get(row.tobytes(), number) for number, row in enumerate(without)]
        return replace(right, targets=right.targets[taken])


class HasAWrongRow(Fault):
    """A circuit whose truth table has the opposite targets in the last row of the first level."""

    says: ClassVar[str] = "has a wrong row"

    @property
    def table(self) -> TruthTable:
        """The table with one wrong row."""
        right: TruthTable = self.sound.table
        targets = right.targets.copy()
        targets[right.rows_at_level[0] - 1] ^= True
        return replace(right, targets=targets)
