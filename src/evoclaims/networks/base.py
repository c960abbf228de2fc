"""A network of fixed shape: a flat vector of parameters and a function."""

from __future__ import annotations

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
