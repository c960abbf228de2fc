"""The real TensorNEAT's HyperNEAT (Stanley et al. 2009), if it is installed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, get_args

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.core.foreign import implicit_promotions
from evoclaims.envs.base import Task
from evoclaims.methods.hyperneat import PAPER
from evoclaims.methods.neat.settings import Settings
from evoclaims.methods.tensorneat import NeatTensorneat, library, neat
from evoclaims.networks.activations import ACTIVATIONS
from evoclaims.networks.substrate import Extent


@dataclass(frozen=True)
class HyperneatTensorneat(NeatTensorneat):
    """TensorNEAT's HyperNEAT on a layered substrate.

    Attributes:
        settings: NEAT's settings for the CPPN.
        hidden: neurons in each hidden layer.
        extent: see `networks.substrate.layered`.
        threshold: a connection exists where the CPPN's |q| exceeds it.
        max_weight: weight at |q| = 1.
    """

    name: ClassVar[str] = "hyperneat_tensorneat"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ("llvmlite", "tensorneat")

    settings: Settings = PAPER
    hidden: tuple[int, ...] = (16,)
    extent: Extent = "largest_layer"
    threshold: float = 0.3
    max_weight: float = 5.0

    def __post_init__(self) -> None:
        """Check the substrate."""
        if self.extent not in get_args(Extent):
            raise UnknownNameError("extent of a substrate", self.extent, get_args(Extent))
        if min(self.hidden, default=1) < 1 or not 0 <= self.threshold < 1 or self.max_weight <= 0:
            raise UserError(
                "HyperNEAT's hidden layers have at least one neuron each, its threshold lies in [0, 1) and its largest "
                f"weight above 0; {self.hidden}, {self.threshold} and {self.max_weight} do not."
            )

    def _algorithm(self, task: Task) -> Any:
        """Build TensorNEAT's algorithm for a substrate of the task's size."""
        library()
        from tensorneat.algorithm.hyperneat import HyperNEATFeedForward, MLPSubstrate

        layers = [task.observation_size + 1, *self.hidden, task.action_size]
        edge = float({"largest_layer": max(layers), "unit": 1}[self.extent])
        with implicit_promotions():
            algorithm = HyperNEATFeedForward(
                MLPSubstrate(layers, (-edge, edge, -edge, edge)),
                neat(self.settings, 4, 1),
                weight_threshold=self.threshold,
                max_weight=self.max_weight,
                output_transform=ACTIVATIONS["tanh"],
            )
        # TensorNEAT's node gene does not accept the arguments that its genome passes (commit ee20490).
        algorithm.hyper_genome.node_gene = _neuron()
        return algorithm


def _neuron() -> Any:
    """Make the node gene for a substrate: hidden nodes give tanh of the sum, outputs the sum."""
    from tensorneat.genome import BaseNode

    class Neuron(BaseNode):  # type: ignore[misc]
        def forward(
            self,
            state: Any,
            attrs: Array,
            inputs: Float[Array, " nodes"],
            is_output_node: Bool[Array, ""],
            valid_mask: Bool[Array, " nodes"],
        ) -> Float[Array, ""]:
            """Return a neuron's output; `inputs` are weighted and valid where `valid_mask` is true."""
            z = jnp.sum(inputs, where=valid_mask)
            return jnp.where(is_output_node, z, jnp.tanh(z))

    return Neuron()
