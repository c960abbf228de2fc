"""What a task is: a list of levels, an environment to act in, and an examination that scores a policy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field, replace
from typing import Any, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from evoclaims.core.errors import UserError
from evoclaims.core.pytree import pytree, select

PolicyFn = Callable[[Float[Array, " observation"]], Float[Array, " action"]]
"""A policy with its parameters bound: one observation in, one action out; vmap it for batches."""


@pytree
class TaskState:
    """The state of one episode.

    Attributes:
        observation: what the policy sees, shape [observation_size].
        reward: reward of the last step.
        terminated: the task itself ended the episode.
        truncated: the horizon ended it.
        inner: the task's own state.
    """

    observation: Float[Array, " observation"]
    reward: Float[Array, ""]
    terminated: Bool[Array, ""]
    truncated: Bool[Array, ""]
    inner: Any


@pytree
class Episode:
    """The result of a policy on a task.

    Attributes:
        fitness: the episode's reward as evolution maximizes it.
        success: share of the level solved, in [0, 1]; the level is solved at exactly 1.
        metrics: other scalars measured by the task; the same names in all its training episodes, and in all its
            examinations, which may have more.
    """

    fitness: Float[Array, ""]
    success: Float[Array, ""]
    metrics: Mapping[str, Float[Array, ""]] = field(default_factory=dict)

    @property
    def score(self) -> Episode:
        """The episode without the task's own metrics, as kept in a method's state."""
        return Episode(fitness=self.fitness, success=self.success)


def share(part: Int[Array, ""], whole: Int[Array, ""]) -> Float[Array, ""]:
    """Return part / whole of two counts: exactly 1 if and only if they are equal.

    XLA turns division by a constant into multiplication by the rounded reciprocal. 41 of 41 would then be 0.99999994,
    and a solved level would never count as solved.
    """
    return jnp.where(part == whole, 1.0, part.astype(jnp.float32) / whole.astype(jnp.float32))


def averaged(episodes: Episode) -> Episode:
    """Return the mean of episodes, leaves [episodes]; its success is exactly 1 where theirs are (see `share`)."""
    mean: Episode = jax.tree.map(jnp.mean, episodes)
    return replace(mean, success=jnp.where(jnp.all(episodes.success == 1.0), 1.0, mean.success))


class MisfitError(UserError):
    """The output of a policy, method or task does not fit what receives it; `clause` says what, and where."""

    def __init__(self, clause: str) -> None:
        """Make the clause a sentence."""
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
        """Increased whenever the task's results change."""

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
        """Act once. The caller resets a terminated or truncated state."""

    def episode(self, policy: PolicyFn, key: PRNGKeyArray, level: Int[Array, ""]) -> Episode:
        """Run one whole training episode of `policy`: one evaluation of an individual."""

    def examine(self, policy: PolicyFn, key: PRNGKeyArray, level: Int[Array, ""]) -> Episode:
        """Score `policy` on `level`: the test that decides level-ups and final results, the same for every method."""


def fitting(task: Task, action: Float[Array, " action"]) -> Float[Array, " action"]:
    """Return an action unchanged, after checking it; every task checks every action during tracing.

    jax would broadcast an action of another shape: a good policy with actions of shape [] would score nothing.

    Raises:
        MisfitError: when its shape or dtype is not that of the task's actions.
    """
    wanted = (task.action_size,)
    try:
        found = jnp.asarray(action)
    except (TypeError, ValueError) as error:  # None, a word, rows of different lengths
        raise MisfitError(
            f"an action is {action!r}, which is not an array, and {task.name!r} takes shape {wanted} and type float32"
        ) from error
    if found.shape != wanted or found.dtype != jnp.float32:
        raise MisfitError(
            f"an action has shape {found.shape} and type {found.dtype}, and {task.name!r} takes shape {wanted} and "
            "type float32"
        )
    return found


def played(
    task: Task, policy: PolicyFn, start: TaskState, note: Callable[[TaskState], Any] | None = None
) -> tuple[TaskState, Float[Array, ""], Any]:
    """Play from `start` to the end of the episode; each step is computed up to the horizon, and counts until the end.

    Returns:
        The last state; the sum of rewards; and, leaves [horizon, …], what `note` returns of each state that was
        reached, with whether the step belongs to the episode (None without `note`).
    """
    (state, total, _), way = played_on(task, policy, (start, jnp.zeros(()), jnp.ones((), bool)), note)
    return state, total, way


Played = tuple[TaskState, Float[Array, ""], Bool[Array, ""]]
"""An episode so far: its state, the sum of its rewards, and whether it goes on."""


def played_on(
    task: Task, policy: PolicyFn, so_far: Played, note: Callable[[TaskState], Any] | None = None
) -> tuple[Played, Any]:
    """Play `horizon` steps; see `played`."""

    def step(before: Played, _: None) -> tuple[Played, Any]:
        following = task.step(before[0], policy(before[0].observation))
        noted = None if note is None else (note(following), before[2])
        return counted(before, following), noted

    made: tuple[Played, Any] = jax.lax.scan(step, so_far, None, length=task.horizon)
    return made


def counted(before: Played, following: TaskState) -> Played:
    """Return an episode after a step to `following`, which counts if the episode has not ended before."""
    state, total, alive = before
    total = total + jnp.where(alive, following.reward, 0.0)
    ended = following.terminated | following.truncated
    return select(alive, following, state), total, alive & ~ended


@runtime_checkable
class Checked(Protocol):
    """A task that may be refused before anything is traced, also when it is only planned."""

    def check(self) -> None:
        """Raise a `UserError` when the task cannot be run as it is written."""


@runtime_checkable
class Numbered(Protocol):
    """A task with numbers that programs take as data instead of constants.

    Conditions that differ only in these share their compiled programs: obstacles of three heights compile once.
    """

    @property
    def numbers(self) -> Any:
        """The numbers: a tree of arrays."""

    def with_numbers(self, numbers: Any) -> Task:
        """Return the task with these numbers, which may be traced, instead of its own."""
