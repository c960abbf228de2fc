"""HyperNEAT (Stanley, D'Ambrosio and Gauci 2009): NEAT evolves a network that draws another network's weights."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from evoclaims.core.errors import UserError
from evoclaims.envs.base import Task
from evoclaims.methods.neat import settings as neat
from evoclaims.methods.neat.evolution import GenomeMethod
from evoclaims.methods.neat.settings import Settings
from evoclaims.networks.genome import Genome
from evoclaims.networks.graph import GraphNetwork
from evoclaims.networks.substrate import Extent, Substrate, layered

CPPN_FUNCTIONS = ("tanh", "gauss", "sin", "abs", "identity")
"""The usual set of a CPPN (Stanley 2007): symmetry by the Gaussian and |x|, repetition by the sine."""

PAPER = replace(neat.PAPER, activations=CPPN_FUNCTIONS)
"""The paper's values: NEAT's, for a network whose activation functions evolve too (§4)."""


@dataclass(frozen=True)
class SubstrateNetwork:
    """Policies whose weights a genome's network (the CPPN) computes from the neurons' positions.

    The CPPN maps the coordinates of a connection's ends to q; the connection's weight is 0 for |q| < threshold,
    else sign(q) (|q| - threshold) / (1 - threshold) · max_weight (Stanley et al. 2009, §3.2). All neurons are tanh.
    """

    substrate: Substrate
    cppn: GraphNetwork
    threshold: float
    max_weight: float

    def express(self, genome: Genome) -> list[Float[Array, "to from"]]:
        """Return the weights into each layer except the first."""
        queries = jnp.asarray(self.substrate.queries)
        q = jax.vmap(partial(self.cppn.apply, self.cppn.express(genome)))(queries)[:, 0]
        size = jnp.maximum(jnp.abs(q) - self.threshold, 0.0) / (1 - self.threshold) * self.max_weight
        weights = jnp.sign(q) * size
        shapes = self.substrate.shapes
        ends = np.cumsum([to * fro for to, fro in shapes])[:-1].tolist()
        return [part.reshape(shape) for part, shape in zip(jnp.split(weights, ends), shapes, strict=True)]

    def apply(
        self, phenotype: list[Float[Array, "to from"]], observation: Float[Array, " observation"]
    ) -> Float[Array, " action"]:
        """Map one observation to one action in (-1, 1)."""
        signal = jnp.append(observation, jnp.ones((), observation.dtype))
        for weights in phenotype:
            signal = jnp.tanh(weights @ signal)
        return signal


@dataclass(frozen=True)
class HyperNeat(GenomeMethod):
    """HyperNEAT on a layered substrate, or on one whose neurons are placed by hand.

    Attributes:
        settings: NEAT's settings for the CPPN.
        hidden: neurons in each hidden layer of a layered substrate.
        extent: see `layered`.
        substrate: neurons placed by hand; if given, `hidden` and `extent` are unused.
        threshold: a connection exists where the CPPN's |q| exceeds it.
        max_weight: weight at |q| = 1.
    """

    name: ClassVar[str] = "hyperneat"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ("llvmlite",)

    settings: Settings = PAPER
    hidden: tuple[int, ...] = (16,)
    extent: Extent = "largest_layer"
    substrate: Substrate | None = None
    threshold: float = 0.3
    max_weight: float = 5.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_weights(self.threshold, self.max_weight)

    def network(self, task: Task) -> GraphNetwork:
        """Return the CPPN, whose inputs are the coordinates of a connection's ends."""
        return GraphNetwork(4, 1, self.settings.activations, self.settings.output)

    def encoding(self, task: Task) -> SubstrateNetwork:
        """Return how a genome encodes a policy of the task's size; a `UserError` says when they do not fit."""
        inputs, outputs = task.observation_size + 1, task.action_size
        substrate = self.substrate or layered((inputs, *self.hidden, outputs), self.extent)
        ends = len(substrate.layers[0]), len(substrate.layers[-1])
        if ends != (inputs, outputs):
            raise UserError(
                f"The substrate has {ends[0]} inputs and {ends[1]} outputs, but {task.name} needs {inputs} (one of "
                f"them the bias) and {outputs}. Write a substrate of this size, or leave it out."
            )
        return SubstrateNetwork(substrate, self.network(task), self.threshold, self.max_weight)


def check_weights(threshold: float, max_weight: float) -> None:
    """Raise a `UserError` for numbers by which no weight can be drawn."""
    if not 0 <= threshold < 1 or not 0 < max_weight < math.inf:
        raise UserError(
            f"HyperNEAT has threshold={threshold} and max_weight={max_weight}. Write a threshold from 0 to below 1, "
            "and a finite largest weight above 0."
        )
