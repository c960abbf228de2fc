"""The real TensorNEAT's HyperNEAT (Stanley et al. 2009), if it is installed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from evoclaims.core.foreign import implicit_promotions
from evoclaims.envs.base import Task
from evoclaims.methods.hyperneat import PAPER, check_weights
from evoclaims.methods.neat.settings import Settings
from evoclaims.methods.tensorneat import NeatTensorneat, library, neat
from evoclaims.networks.activations import ACTIVATIONS
from evoclaims.networks.substrate import Extent, layered


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
        """Check the substrate and the weights."""
        layered((1, *self.hidden, 1), self.extent)
        check_weights(self.threshold, self.max_weight)

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
