"""The interface of a method: pure functions of an explicit state, so that one engine can run all."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, TypeVar, runtime_checkable

from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from evoclaims.core.pytree import pytree, static
from evoclaims.envs.base import Task

S = TypeVar("S")


@pytree
class Policy:
    """A trained policy: its parameters are data (leaves), the function that uses them is static.

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
    """What one step of a method reports to the engine.

    Attributes:
        fitness: of the best candidate of this step, on the current level.
        success: its success on the current level, in the task's examination or training episode; exactly 1 moves
            the trial up a level.
        healthy: False if a relevant number is not finite; the trial then ends as diverged, as it does for such a
            fitness or success.
        metrics: more scalars for the training curve; the same names at every step.
    """

    fitness: Float[Array, ""]
    success: Float[Array, ""]
    healthy: Bool[Array, ""]
    metrics: Mapping[str, Float[Array, ""]]


class Method(Protocol[S]):
    """An algorithm with its frozen hyperparameters.

    The state is a pytree whose structure, shapes and dtypes never change. `step` gets a fresh key each time and must
    derive all randomness from it. A method without randomness, such as a control, says so: `deterministic = True`.
    """

    @property
    def name(self) -> str:
        """The registered name."""

    @property
    def revision(self) -> int:
        """Raised whenever the method's results change."""

    def init(self, key: PRNGKeyArray, task: Task) -> S:
        """Return the state before the first step."""

    def step(self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: S) -> tuple[S, Progress]:
        """Train for one generation (evolution) or one training step (reinforcement learning) on `level`."""

    def best(self, task: Task, state: S) -> Policy:
        """Return the policy to judge: the champion, or the current deterministic policy."""

    def cost(self, task: Task) -> int:
        """Return the environment steps that one step spends, counting the longest episode.

        Of the methods here, those that evaluate a champion again beside their population leave that episode out.
        """


@runtime_checkable
class Resizable(Protocol):
    """A method whose steps are cheaper in smaller arrays, while its state fits them; the size makes no difference.

    A subclass with another state overrides the three functions, or sets them to None and works in the largest arrays.
    """

    def sizes(self, task: Task) -> Sequence[Any]:
        """Return the sizes, smallest first; every state fits the last."""

    def size_for(self, task: Task, state: Any) -> Int[Array, ""]:
        """Return the place of the smallest size that the next step fits, the same whatever arrays the state is in."""

    def in_size(self, size: Any, state: Any) -> Any:
        """Return the state in arrays of a size, which `step` keeps; None for the state as everywhere else."""


@runtime_checkable
class SeldomTested(Protocol):
    """A method that reports a success above 0 after some of its steps alone."""

    @property
    def tested_every(self) -> int:
        """Steps from one report of success to the next; 0: none is reported."""


@runtime_checkable
class PartlyUsed(Protocol):
    """A method whose policies do not use all their parameters: some are padding, or only stored with the champion.

    All used parameters must be finite; otherwise the trial ends as diverged.
    """

    def used(self, parameters: Any) -> Any:
        """Return the used arrays of a policy's parameters (on the host); other methods use all of them."""
