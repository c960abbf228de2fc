"""A network of fixed shape: a flat vector of parameters and a function."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from jaxtyping import Array, Float


class Network(Protocol):
    """A frozen dataclass that describes a network whose parameters are one flat vector.

    Its fields are part of the ids of its trials, and so is the name of its class, unless it is one of this package.
    """

    def size(self, inputs: int, outputs: int) -> int:
        """Return the number of parameters."""

    def apply(
        self, parameters: Float[Array, " parameters"], observation: Float[Array, " inputs"], outputs: int
    ) -> Float[Array, " outputs"]:
        """Map one observation to one output."""


@dataclass(frozen=True, eq=False)  # so that it has a hash, as functions do, and jax takes it for one
class Bound:
    """A network with its parameters: a policy.

    Attributes:
        network: what computes actions.
        parameters: its flat vector, shape [parameters].
        outputs: numbers in an action.
    """

    network: Network
    parameters: Float[Array, " parameters"]
    outputs: int

    def __call__(self, observation: Float[Array, " inputs"]) -> Float[Array, " outputs"]:
        """Return the action."""
        return self.network.apply(self.parameters, observation, self.outputs)
