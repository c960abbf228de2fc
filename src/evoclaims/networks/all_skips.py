"""A feedforward network in which every neuron is fed by all earlier ones (the paper's CMA-ES network, §A.3).

Processors and GPUs compute it in different ways. A loop over neurons is quick to compile, and fast on a processor; on a
GPU each of its rounds is some launches, in every step of a robot, and writing the triangle of weights is one more.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from evoclaims.core.errors import UserError
from evoclaims.kernels import by_platform


@dataclass(frozen=True)
class AllSkips:
    """Tanh neurons in a fixed order, each fed by the inputs, a bias and every earlier neuron; tanh outputs fed by all.

    Parameters, in order: weights from inputs and bias to hidden and outputs, [hidden + outputs, inputs + 1]; weights
    from hidden neurons to outputs, [outputs, hidden]; weights between hidden neurons, the strict lower triangle
    of [hidden, hidden] row by row.
    """

    name: str = field(default="all_skips", init=False)
    hidden: int = 24

    def __post_init__(self) -> None:
        """Check the size."""
        if self.hidden < 0:
            raise UserError(f"AllSkips has hidden={self.hidden}. Write 0 or more neurons.")

    def size(self, inputs: int, outputs: int) -> int:
        """Return the number of parameters."""
        return (self.hidden + outputs) * (inputs + 1) + outputs * self.hidden + self.hidden * (self.hidden - 1) // 2

    def apply(
        self, parameters: Float[Array, " parameters"], observation: Float[Array, " inputs"], outputs: int
    ) -> Float[Array, " outputs"]:
        """Map one observation to outputs in (-1, 1)."""
        forward = by_platform(partial(scanned, self.hidden, outputs), partial(unrolled, self.hidden, outputs))
        answer: Array = forward(parameters, observation)
        return answer


def scanned(hidden: int, outputs: int, parameters: Array, observation: Array) -> Array:
    """Return the outputs of an `AllSkips` by a loop over its hidden neurons; for its arguments see `AllSkips.apply`."""
    feed, readout, rest = _weights(hidden, outputs, parameters, observation)
    rows, columns = jnp.tril_indices(hidden, -1)
    between = jnp.zeros((hidden, hidden)).at[rows, columns].set(parameters[rest:])

    # Inputs feed every neuron at once; then each hidden neuron in turn adds its share to all later ones.
    potential = feed[:, :-1] @ observation + feed[:, -1]
    recurrence = jnp.concatenate([between, readout])

    def fire(potential: Array, neuron: tuple[Array, Array]) -> tuple[Array, None]:
        index, outgoing = neuron
        return potential + outgoing * jnp.tanh(potential[index]), None

    potential, _ = jax.lax.scan(fire, potential, (jnp.arange(hidden), recurrence.T))
    return jnp.tanh(potential[hidden:])


def unrolled(hidden: int, outputs: int, parameters: Array, observation: Array) -> Array:
    """Return what `scanned` does, up to rounding, without a loop: sums of numbers that XLA can fuse."""
    feed, readout, rest = _weights(hidden, outputs, parameters, observation)

    potential = jnp.sum(feed[:, :-1] * observation[None], axis=1) + feed[:, -1]
    answer, place = potential[hidden:], rest
    fired: list[Array] = []
    for neuron in range(hidden):
        own = _number(potential, neuron)
        for signal in fired:
            own, place = own + _number(parameters, place) * signal, place + 1
        fired.append(jnp.tanh(own))
        answer = answer + readout[:, neuron] * fired[-1]
    return jnp.tanh(answer)


def _weights(hidden: int, outputs: int, parameters: Array, observation: Array) -> tuple[Array, Array, int]:
    """Return the weights from inputs and bias, those from hidden neurons to outputs, and where the others begin."""
    inputs = observation.shape[-1]
    neurons = hidden + outputs
    first, second = neurons * (inputs + 1), neurons * (inputs + 1) + outputs * hidden
    return parameters[:first].reshape(neurons, inputs + 1), parameters[first:second].reshape(outputs, hidden), second


def _number(array: Array, place: int) -> Array:
    """Return the number at a known place; as an index in brackets, it would be traced for longer."""
    number: Array = jax.lax.index_in_dim(array, place, keepdims=False)
    return number
