"""Multilayer perceptrons, with or without a direct path from inputs to outputs."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import jax.numpy as jnp
from jaxtyping import Array, Float

from evoclaims.core.errors import UserError


@dataclass(frozen=True)
class Mlp:
    """Dense tanh layers of the given widths, tanh output.

    Parameters, layer by layer: weights [outputs, inputs] row by row, then biases; with `skip` the weights from
    observation to outputs, [outputs, inputs], come last.

    Attributes:
        layers: widths of the hidden layers.
        skip: whether the observation also feeds the outputs directly.
    """

    name: str = field(default="mlp", init=False)
    layers: tuple[int, ...] = (32, 32, 32, 32)
    skip: bool = False

    def __post_init__(self) -> None:
        """Check the widths."""
        object.__setattr__(self, "layers", tuple(self.layers))  # a list has no hash
        if any(width < 1 for width in self.layers):
            raise UserError(f"A perceptron has layers={self.layers}. Write at least 1 neuron for each hidden layer.")

    def size(self, inputs: int, outputs: int) -> int:
        """Return the number of parameters."""
        widths = (inputs, *self.layers, outputs)
        dense = sum((fan_in + 1) * fan_out for fan_in, fan_out in pairwise(widths))
        return dense + inputs * outputs * self.skip

    def apply(
        self, parameters: Float[Array, " parameters"], observation: Float[Array, " inputs"], outputs: int
    ) -> Float[Array, " outputs"]:
        """Map one observation to outputs in (-1, 1).

        Raises:
            UserError: when there are more or fewer parameters than these sizes take.
        """
        inputs = observation.shape[-1]
        if parameters.shape != (self.size(inputs, outputs),):
            raise UserError(
                f"A perceptron with layers={self.layers}, skip={self.skip} was given {parameters.size} parameters. "
                f"From {inputs} inputs to {outputs} outputs it takes {self.size(inputs, outputs)}, the number that "
                "its `size` returns."
            )
        signal, start = observation, 0
        widths = (*self.layers, outputs)
        for depth, width in enumerate(widths):
            fan_in = signal.shape[-1]
            weights = parameters[start : start + fan_in * width].reshape(width, fan_in)
            start += fan_in * width
            potential = weights @ signal + parameters[start : start + width]
            start += width
            if self.skip and depth == len(widths) - 1:
                potential = potential + parameters[start:].reshape(outputs, observation.shape[-1]) @ observation
            signal = jnp.tanh(potential)
        return signal
