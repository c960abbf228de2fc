"""A feedforward network in which every neuron is fed by all earlier ones (the paper's CMA-ES network, §A.3)."""

from __future__ import annotations

from dataclasses import dataclass, field

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from evoclaims.core.errors import UserError


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
            raise UserError(f"A network has 0 or more hidden neurons, not {self.hidden}.")

    def size(self, inputs: int, outputs: int) -> int:
        """Return the number of parameters."""
        return (self.hidden + outputs) * (inputs + 1) + outputs * self.hidden + self.hidden * (self.hidden - 1) // 2

    def apply(
        self, parameters: Float[Array, " parameters"], observation: Float[Array, " inputs"], outputs: int
    ) -> Float[Array, " outputs"]:
        """Map one observation to outputs in (-1, 1)."""
        inputs = observation.shape[-1]
        neurons = self.hidden + outputs
        first, second = neurons * (inputs + 1), neurons * (inputs + 1) + outputs * self.hidden
        feed = parameters[:first].reshape(neurons, inputs + 1)
        readout = parameters[first:second].reshape(outputs, self.hidden)
        rows, columns = jnp.tril_indices(self.hidden, -1)
        between = jnp.zeros((self.hidden, self.hidden)).at[rows, columns].set(parameters[second:])

        # Inputs feed every neuron at once; then each hidden neuron in turn adds its share to all later ones.
        potential = feed[:, :-1] @ observation + feed[:, -1]
        recurrence = jnp.concatenate([between, readout])

        def fire(potential: Array, neuron: tuple[Array, Array]) -> tuple[Array, None]:
            index, outgoing = neuron
            return potential + outgoing * jnp.tanh(potential[index]), None

        potential, _ = jax.lax.scan(fire, potential, (jnp.arange(self.hidden), recurrence.T))
        return jnp.tanh(potential[self.hidden :])
