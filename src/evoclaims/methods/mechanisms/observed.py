"""What every observation of a mechanism needs: a method around another one, and a task whose fitness is known."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PRNGKeyArray

from evoclaims.envs.base import Episode, PolicyFn, Task, TaskState, fitting
from evoclaims.methods.base import PartlyUsed, Policy, Progress


class Observed(ABC):
    """Takes the steps of the method `of` and reports what they did; a subclass is a frozen dataclass.

    Attributes:
        of: the method whose mechanisms are observed.
    """

    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ()

    of: Any

    @abstractmethod
    def seen(
        self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], before: Any, after: Any
    ) -> Mapping[str, Float[Array, ""]]:
        """Return numbers that show what a step did, from the method's states before and after it."""

    @property
    def name(self) -> str:
        """The method's name and revision: this method's trials run again when that one computes something else."""
        return f"{self.of.name} (revision {self.of.revision}), observed"

    def init(self, key: PRNGKeyArray, task: Task) -> Any:
        """Start the method."""
        return self.of.init(key, task)

    def step(self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: Any) -> tuple[Any, Progress]:
        """Take one step of the method, and add what it did to its metrics."""
        after, progress = self.of.step(key, task, level, state)
        return after, replace(progress, metrics={**progress.metrics, **self.seen(key, task, level, state, after)})

    def best(self, task: Task, state: Any) -> Policy:
        """Return the method's policy."""
        policy: Policy = self.of.best(task, state)
        return policy

    def used(self, parameters: Any) -> Any:
        """Return what the method's policies use of their parameters."""
        return self.of.used(parameters) if isinstance(self.of, PartlyUsed) else parameters

    def cost(self, task: Task) -> int:
        """Return the method's cost."""
        return int(self.of.cost(task))


class Question(ABC):
    """A task of one step that always shows the same: fitness is a known function of the policy's answer.

    A subclass is a frozen dataclass.
    """

    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ()
    levels: ClassVar[int] = 1
    observation_size: ClassVar[int] = 1
    horizon: ClassVar[int] = 1

    name: ClassVar[str]
    action_size: int

    @abstractmethod
    def scored(self, answer: Float[Array, " action"]) -> Episode:
        """Return what an answer earns."""

    def reset(self, key: PRNGKeyArray, level: Int[Array, ""]) -> TaskState:
        """Ask."""
        return self._state(jnp.zeros(()), ended=False)

    def step(self, state: TaskState, action: Float[Array, " action"]) -> TaskState:
        """Take the answer."""
        return self._state(self.scored(fitting(self, action)).fitness, ended=True)

    def episode(self, policy: PolicyFn, key: PRNGKeyArray, level: Int[Array, ""]) -> Episode:
        """Ask once."""
        return self.scored(fitting(self, policy(jnp.ones(self.observation_size))))

    def examine(self, policy: PolicyFn, key: PRNGKeyArray, level: Int[Array, ""]) -> Episode:
        """Ask once: every answer is the same."""
        return self.episode(policy, key, level)

    def _state(self, reward: Float[Array, ""], *, ended: bool) -> TaskState:
        no = jnp.zeros((), bool)
        return TaskState(jnp.ones(self.observation_size), reward, jnp.full((), ended), no, ())
