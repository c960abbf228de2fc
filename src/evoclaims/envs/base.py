"""What a task is: a list of levels, an environment to act in, and an examination that says how well a policy does."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from typing import Any, Protocol, runtime_checkable

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from evoclaims.core.errors import UserError
from evoclaims.core.pytree import pytree

PolicyFn = Callable[[Float[Array, " observation"]], Float[Array, " action"]]
"""A policy with its parameters bound: one observation in, one action out; vmap it for batches."""


@pytree
class TaskState:
    """The state of one episode.

    Attributes:
        observation: what the policy sees, shape [observation_size].
        reward: reward of the step just made.
        terminated: the task itself ended the episode.
        truncated: the horizon ended it.
        inner: whatever the task needs to go on.
    """

    observation: Float[Array, " observation"]
    reward: Float[Array, ""]
    terminated: Bool[Array, ""]
    truncated: Bool[Array, ""]
    inner: Any


@pytree
class Episode:
    """What a policy got out of a task.

    Attributes:
        fitness: the episode's reward as evolution maximizes it.
        success: share of the level that is right, in [0, 1]; the level is solved at exactly 1.
        metrics: further scalars that the task measures; the same names in all its episodes.
    """

    fitness: Float[Array, ""]
    success: Float[Array, ""]
    metrics: Mapping[str, Float[Array, ""]] = field(default_factory=dict)

    @property
    def score(self) -> Episode:
        """The episode without the task's own metrics: what a method's state remembers of it."""
        return Episode(fitness=self.fitness, success=self.success)


def share(part: Int[Array, ""], whole: Int[Array, ""]) -> Float[Array, ""]:
    """Return part / whole of two counts: exactly 1 when they are equal, and only then.

    XLA turns a division by what it knows to be constant into a product with the rounded reciprocal, by which 41 of 41
    would be 0.99999994: a solved level that nobody ever leaves.
    """
    return jnp.where(part == whole, 1.0, part.astype(jnp.float32) / whole.astype(jnp.float32))


class MisfitError(UserError):
    """What a policy, a method or a task gives is not what the other side takes; `clause` says what, and where."""

    def __init__(self, clause: str) -> None:
        """Make a sentence of the clause."""
        super().__init__(f"{clause[0].upper()}{clause[1:]}.")
        self.clause = clause


class Task(Protocol):
    """A task, as pure functions of explicit state; frozen and hashable, so that programs can close over it.

    Levels are counted from 0. `level` arguments are traced integers of shape [].
    """

    @property
    def name(self) -> str:
        """The registered name."""

    @property
    def revision(self) -> int:
        """Raised whenever the task computes something else."""

    @property
    def levels(self) -> int:
        """Number of levels."""

    @property
    def observation_size(self) -> int:
        """Length of an observation."""

    @property
    def action_size(self) -> int:
        """Length of an action."""

    @property
    def horizon(self) -> int:
        """Most environment steps in an episode."""

    def reset(self, key: PRNGKeyArray, level: Int[Array, ""]) -> TaskState:
        """Start an episode at `level`."""

    def step(self, state: TaskState, action: Float[Array, " action"]) -> TaskState:
        """Act once. The caller resets a state that is terminated or truncated."""

    def episode(self, policy: PolicyFn, key: PRNGKeyArray, level: Int[Array, ""]) -> Episode:
        """Run one whole training episode of `policy`: one evaluation of an individual in evolution."""

    def examine(self, policy: PolicyFn, key: PRNGKeyArray, level: Int[Array, ""]) -> Episode:
        """Score `policy` on `level`: the test that decides level-ups and final results, the same for every method."""


def fitting(task: Task, action: Float[Array, " action"]) -> Float[Array, " action"]:
    """Return an action as it is; every task asks this of every action, while its program is traced.

    jax would broadcast one of another shape: a policy whose only fault is an action of shape [] scores nothing.

    Raises:
        MisfitError: when its shape or type is not that of the task's actions.
    """
    found, wanted = jnp.asarray(action), (task.action_size,)
    if found.shape != wanted or found.dtype != jnp.float32:
        raise MisfitError(
            f"an action has shape {found.shape} and type {found.dtype}, and {task.name!r} takes shape {wanted} and "
            "type float32"
        )
    return found


@runtime_checkable
class Numbered(Protocol):
    """A task with numbers that programs take as data, and do not embed.

    Conditions that differ in nothing else share their compiled programs: obstacles of three heights compile once.
    """

    @property
    def numbers(self) -> Any:
        """The numbers: a tree of arrays."""

    def with_numbers(self, numbers: Any) -> Task:
        """Return the task with these numbers, which may be traced, in the place of its own."""
