"""A network written down by hand, one neuron per row of the truth table: the positive control of the gates.

It learns nothing; it goes through the same engine and the same judging as every method, so that a harness in which a
right circuit fails, or a wrong one passes, gives itself away (control C2).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PRNGKeyArray

from evoclaims.core.errors import UserError
from evoclaims.envs.base import Task
from evoclaims.envs.gates.circuit import Circuit
from evoclaims.methods.base import Policy, Progress


@dataclass(frozen=True)
class HandBuilt:
    """A two-layer threshold network that answers every row rightly.

    Hidden neuron r fires on row r alone: x · (2 row_r − 1) exceeds Σ row_r − ½ for no other bits x. Output o sums the
    firing neurons with weight +1 where the wanted bit is 1, else −1.

    Attributes:
        negated: whether the outputs are negated: wrong on every active output of every row.
    """

    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ()

    negated: bool = False

    @property
    def name(self) -> str:
        """The registered name, which tells the network from its negation."""
        return "hand_built_negated" if self.negated else "hand_built"

    def init(self, key: PRNGKeyArray, task: Task) -> Int[Array, ""]:
        """Return a state that counts steps."""
        return jnp.zeros((), jnp.int32)

    def step(
        self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: Int[Array, ""]
    ) -> tuple[Int[Array, ""], Progress]:
        """Examine the network and change nothing."""
        episode = task.examine(self.best(task, state), key, level)
        progress = Progress(fitness=episode.fitness, success=episode.success, healthy=jnp.ones((), bool), metrics={})
        return state + 1, progress

    def best(self, task: Task, state: Int[Array, ""]) -> Policy:
        """Return the network."""
        return threshold_network(task, -1.0 if self.negated else 1.0)

    def cost(self, task: Task) -> int:
        """Return the environment steps of one examination."""
        return task.horizon


def threshold_network(task: Task, sign: float) -> Policy:
    """Build the network for a circuit's truth table; its outputs are ±1 times `sign`.

    Raises:
        UserError: for a task without a truth table.
    """
    if not isinstance(task, Circuit):
        raise UserError(f"A network is built by hand from a truth table, which the task {task.name!r} does not have.")
    table = task.table
    weights = jnp.asarray(2 * table.inputs - 1)
    thresholds = jnp.asarray(table.inputs.sum(axis=1) - 0.5)
    readout = jnp.where(jnp.asarray(table.targets), sign, -sign)

    def function(parameters: Any, observation: Float[Array, " inputs"]) -> Float[Array, " outputs"]:
        weights, thresholds, readout = parameters
        return (weights @ observation > thresholds).astype(jnp.float32) @ readout

    return Policy(parameters=(weights, thresholds, readout), function=function)
