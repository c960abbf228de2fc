"""What a method is: pure functions of an explicit state, so that one engine runs them all."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol, TypeVar, runtime_checkable

from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from evoclaims.core.pytree import pytree, static
from evoclaims.envs.base import Task

S = TypeVar("S")


@pytree
class Policy:
    """A trained policy: its parameters as data, and the function that uses them as structure.

    Attributes:
        parameters: any tree of arrays.
        function: `(parameters, observation [observation]) -> action [action]`, deterministic.
    """

    parameters: Any
    function: Callable[[Any, Array], Array] = static()

    def __call__(self, observation: Float[Array, " observation"]) -> Float[Array, " action"]:
        """Act on one observation."""
        return self.function(self.parameters, observation)


@pytree
class Progress:
    """What one step of a method tells the engine.

    Attributes:
        fitness: of the best candidate of this step, on the current level.
        success: its success on the current level, by the task's examination or training episode; exactly 1 moves the
            trial up a level.
        healthy: False once a number that matters has stopped being finite; ends the trial as diverged.
        metrics: further scalars for the training curve; the same names at every step.
    """

    fitness: Float[Array, ""]
    success: Float[Array, ""]
    healthy: Bool[Array, ""]
    metrics: Mapping[str, Float[Array, ""]]


class Method(Protocol[S]):
    """An algorithm with its frozen hyperparameters.

    The state is a pytree whose structure, shapes and dtypes never change. `step` gets a fresh key each time and must
    derive all randomness from it.
    """

    @property
    def name(self) -> str:
        """The registered name."""

    @property
    def revision(self) -> int:
        """Raised whenever the method computes something else."""

    def init(self, key: PRNGKeyArray, task: Task) -> S:
        """Return the state before the first step."""

    def step(self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: S) -> tuple[S, Progress]:
        """Train for one generation (evolution) or one training step (reinforcement learning) on `level`."""

    def best(self, task: Task, state: S) -> Policy:
        """Return the policy to judge: the champion, or the current deterministic policy."""

    def cost(self, task: Task) -> int:
        """Return the environment steps that one step spends, counting the longest episode."""


@runtime_checkable
class PartlyUsed(Protocol):
    """A method whose policies' parameters hold more than the numbers they act by: padding, or what is stored beside.

    All numbers that a policy acts by are finite; a trial whose champion has others ends as diverged.
    """

    def used(self, parameters: Any) -> Any:
        """Return the arrays of a policy's parameters (on the host) that it acts by; of another method, all are."""
