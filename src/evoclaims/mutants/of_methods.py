"""Faults of methods: bugs in how an algorithm learns, selects and remembers."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Int, PRNGKeyArray

from evoclaims.envs.base import Task
from evoclaims.methods.base import Policy, Progress
from evoclaims.methods.cma_es import CmaEsState
from evoclaims.mutants.of_tasks import PaysAtRandom, ReversesReward
from evoclaims.mutants.planting import Fault, plant


class LearnsNothing(Fault):
    """Every step is discarded."""

    says: ClassVar[str] = "learns nothing"

    def step(self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: Any) -> tuple[Any, Progress]:
        """Take a step, but keep the old state."""
        return state, self.sound.step(key, task, level, state)[1]


class Minimizes(Fault):
    """Fitness is minimized instead of maximized."""

    says: ClassVar[str] = "minimizes"

    def step(self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: Any) -> tuple[Any, Progress]:
        """Train on the reversed reward."""
        stepped: tuple[Any, Progress] = self.sound.step(key, plant(ReversesReward, task), level, state)
        return stepped


class SelectsAtRandom(Fault):
    """Selection, or the gradient, uses random numbers instead of rewards."""

    says: ClassVar[str] = "selects at random"

    def step(self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: Any) -> tuple[Any, Progress]:
        """Train on random rewards."""
        stepped: tuple[Any, Progress] = self.sound.step(key, plant(PaysAtRandom, task), level, state)
        return stepped


class ForgetsChampion(Fault):
    """The untrained policy is judged in the end."""

    says: ClassVar[str] = "forgets its champion"

    def best(self, task: Task, state: Any) -> Policy:
        """Return the policy of an untrained state."""
        policy: Policy = self.sound.best(task, self.sound.init(jax.random.key(0), task))
        return policy


class HasOneSeed(Fault):
    """All trials draw the same random numbers, whatever their seeds."""

    says: ClassVar[str] = "has one seed"

    def init(self, key: PRNGKeyArray, task: Task) -> tuple[Int[Array, ""], Any]:
        """Start from a fixed key, and count steps from now on."""
        return jnp.zeros((), jnp.int32), self.sound.init(jax.random.key(0), task)

    def step(
        self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: tuple[Int[Array, ""], Any]
    ) -> tuple[tuple[Int[Array, ""], Any], Progress]:
        """Take a step with a key that depends only on its number."""
        number, inner = state
        inner, progress = self.sound.step(jax.random.fold_in(jax.random.key(1), number), task, level, inner)
        return (number + 1, inner), progress

    def best(self, task: Task, state: tuple[Int[Array, ""], Any]) -> Policy:
        """Return the policy of the sound method's state."""
        policy: Policy = self.sound.best(task, state[1])
        return policy


class KeepsItsStepSize(Fault):
    """CMA-ES whose step size never changes."""

    says: ClassVar[str] = "keeps its step size"

    def step(
        self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: CmaEsState
    ) -> tuple[CmaEsState, Progress]:
        """Take a step, and restore the step size."""
        after, progress = self.sound.step(key, task, level, state)
        return replace(after, distribution=after.distribution.replace(std=state.distribution.std)), progress
