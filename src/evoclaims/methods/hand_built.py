"""Circuits built by hand from the definitions of the gates: the positive control (C2).

They learn nothing, but use the same engine and judging as every method. A harness in which a correct circuit fails, or
a wrong one passes, is thus exposed. They never read the task's own truth table, so an error there is exposed as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PRNGKeyArray
from numpy.typing import NDArray

from evoclaims.core.errors import UserError
from evoclaims.envs.base import Task
from evoclaims.envs.gates.alu import SimpleAlu
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.base import Policy, Progress


@dataclass(frozen=True)
class HandBuilt:
    """A circuit that answers every row correctly, or its negation.

    Attributes:
        negated: whether to negate the outputs: then every active output of every row is wrong.
    """

    revision: ClassVar[int] = 2
    packages: ClassVar[tuple[str, ...]] = ()
    deterministic: ClassVar[bool] = True

    negated: bool = False

    @property
    def name(self) -> str:
        """The registered name; the negated circuit has its own."""
        return "hand_built_negated" if self.negated else "hand_built"

    def init(self, key: PRNGKeyArray, task: Task) -> Int[Array, ""]:
        """Return a state that counts steps."""
        return jnp.zeros((), jnp.int32)

    def step(
        self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: Int[Array, ""]
    ) -> tuple[Int[Array, ""], Progress]:
        """Examine the circuit and change nothing."""
        episode = task.examine(self.best(task, state), key, level)
        progress = Progress(fitness=episode.fitness, success=episode.success, healthy=jnp.ones((), bool), metrics={})
        return state + 1, progress

    def best(self, task: Task, state: Int[Array, ""]) -> Policy:
        """Return the circuit."""
        return circuit_for(task).policy(-1.0 if self.negated else 1.0)

    def cost(self, task: Task) -> int:
        """Return the environment steps of one examination."""
        return task.horizon


@dataclass(frozen=True)
class ThresholdCircuit:
    """Two layers: neuron h fires where weights_h · x > thresholds_h, and outputs sum the readouts of what fires.

    Attributes:
        weights: shape [neurons, inputs].
        thresholds: shape [neurons].
        readout: shape [neurons, outputs].
    """

    weights: NDArray[np.float32]
    thresholds: NDArray[np.float32]
    readout: NDArray[np.float32]

    def policy(self, sign: float) -> Policy:
        """Return the circuit as a policy whose outputs are multiplied by `sign`."""

        def function(parameters: Any, observation: Float[Array, " inputs"]) -> Float[Array, " outputs"]:
            weights, thresholds, readout = parameters
            answers: Array = (weights @ observation > thresholds).astype(jnp.float32) @ readout
            return answers

        parts = self.weights, self.thresholds, sign * self.readout
        return Policy(parameters=jax.tree.map(jnp.asarray, parts), function=function)


def parity_circuit(bits: int) -> ThresholdCircuit:
    """Return the circuit that counts ones: neuron k fires at k ones or more, and the signs alternate (§3.1.1).

    These sum to 1 for an odd number of ones and to 0 for an even one; a neuron that always fires subtracts ½.
    """
    counts = np.arange(bits + 1, dtype=np.float32)  # at least 0, 1, ..., bits ones
    readout = np.where(counts % 2 == 1, 1.0, -1.0).astype(np.float32)
    readout[0] = -0.5
    return ThresholdCircuit(np.ones((bits + 1, bits), np.float32), counts - 0.5, readout[:, None])


_ANSWERS: Final[dict[str, str]] = {
    "multiplexer": "0 1 0 1 0 0 1 1",  # (select, a, b): b where select is 0, a where it is 1
    "multiplexer that ignores its select bit": "0 0 1 1 0 0 1 1",
    "nand": "1 1 1 0",
    "not": "1 0",
    "and": "0 0 0 1",
    "xor": "0 1 1 0",
    "xax": "0 0 1 0 0 1 0 0",  # 1 where both pairs of neighbours differ
    "increment": "0001 0010 0011 0100 0101 0110 0111 1000 1001 1010 1011 1100 1101 1110 1111 0000",
    "decrement": "1111 0000 0001 0010 0011 0100 0101 0110 0111 1000 1001 1010 1011 1100 1101 1110",
    "shift left": "0000 0010 0100 0110 1000 1010 1100 1110 0000 0010 0100 0110 1000 1010 1100 1110",
    "shift right": "0000 0000 0001 0001 0010 0010 0011 0011 0100 0100 0101 0101 0110 0110 0111 0111",
}
"""Each operation's outputs for its inputs in counting order, taken from §3.1.2 and not computed by the task."""

_LISTS: Final = {
    "paper": ("multiplexer", "nand", "not", "and", "xor", "increment", "decrement", "shift left", "shift right"),
    "published_code": ("multiplexer", "nand", "not", "and", "xor", "xax", "increment", "decrement", "shift left"),
}
_MULTIPLEXERS: Final = {"paper": "multiplexer", "published_code": "multiplexer that ignores its select bit"}


def alu_circuit(operations: Sequence[str]) -> ThresholdCircuit:
    """Return the circuit with one neuron per operation and value of its inputs (§3.1.2).

    A neuron fires only on its own eight bits: x · (2 bits − 1) exceeds Σ bits − ½ for no others. It adds +1 to the
    outputs that must be 1, and −1 to the others. The names are in the order of their indices in the four control bits.
    """
    shown, wanted = [], []
    for index, operation in enumerate(operations):
        for number, answer in enumerate(_ANSWERS[operation].split()):
            shown.append(f"{index:04b}{number:04b}")
            wanted.append(answer.ljust(4, "0"))
    bits = np.array([[int(bit) for bit in row] for row in shown], np.float32)
    readout = np.array([[2 * int(bit) - 1 for bit in row] for row in wanted], np.float32)
    return ThresholdCircuit(2 * bits - 1, bits.sum(axis=1) - 0.5, readout)


def circuit_for(task: Task) -> ThresholdCircuit:
    """Return the hand-built circuit for a task.

    Raises:
        UserError: when it does not exist.
    """
    if isinstance(task, NParity):
        return parity_circuit(task.bits)
    if isinstance(task, SimpleAlu):
        names = (_MULTIPLEXERS[task.multiplexer], *_LISTS[task.operations][1:])
        return alu_circuit(names[: task.level_count])
    raise UserError(f"There is no circuit built by hand for the task {task.name!r}. Use N-parity or Simple ALU.")
