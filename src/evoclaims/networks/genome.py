"""NEAT's genome (Stanley and Miikkulainen 2002, §3.1) as arrays of fixed size.

The node slots are always in a topological order of the network: every connection leads from a lower slot to a higher
one. Every change of a genome keeps this order, and nothing ever sorts.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from evoclaims.core.pytree import pytree

EMPTY = -1


@pytree
class Nodes:
    """Node genes, packed into the first slots.

    Slots 0 … inputs - 1 hold the inputs; outputs and hidden nodes follow in topological order.

    Attributes:
        key: the historical marking: inputs 0 … I - 1, outputs I … I + O - 1, then hidden nodes; `EMPTY` beyond the
            count. Two nodes of two genomes are homologous when their keys are equal.
        bias, response: see `networks.graph`.
        activation: index into the method's set of activation functions.
    """

    key: Int[Array, " nodes"]
    bias: Float[Array, " nodes"]
    response: Float[Array, " nodes"]
    activation: Int[Array, " nodes"]


@pytree
class Connections:
    """Connection genes, packed, in no particular order.

    Attributes:
        source, target: node slots, source < target; 0 beyond the count. Two connections are homologous when the keys
            of both their ends are equal.
        weight: 0 beyond the count.
    """

    source: Int[Array, " connections"]
    target: Int[Array, " connections"]
    weight: Float[Array, " connections"]


@pytree
class Genome:
    """One genome; a population is the same with a leading axis on every leaf.

    Attributes:
        nodes: leaves [nodes], the maximum number.
        connections: leaves [connections], the maximum number.
        node_count, connection_count: the current numbers.
    """

    nodes: Nodes
    connections: Connections
    node_count: Int[Array, ""]
    connection_count: Int[Array, ""]

    @property
    def has_node(self) -> Bool[Array, " nodes"]:
        """Which slots hold a node."""
        return jnp.arange(self.nodes.key.shape[-1]) < self.node_count

    @property
    def has_connection(self) -> Bool[Array, " connections"]:
        """Which places hold a connection."""
        return jnp.arange(self.connections.weight.shape[-1]) < self.connection_count

    def slots_of_outputs(self, inputs: int, outputs: int) -> Int[Array, " outputs"]:
        """Return the slot of each output."""
        keys = inputs + jnp.arange(outputs, dtype=jnp.int32)
        return jnp.argmax(self.nodes.key[None, :] == keys[:, None], axis=1).astype(jnp.int32)


def resized(genomes: Genome, nodes: int, connections: int) -> Genome:
    """Cut or pad the last axis of every gene to these capacities; what is cut off must be empty."""

    def resize(size: int, leaf: Array, empty: int = 0) -> Array:
        missing = size - leaf.shape[-1]
        if missing <= 0:
            return leaf[..., :size]
        return jnp.concatenate([leaf, jnp.full((*leaf.shape[:-1], missing), empty, leaf.dtype)], axis=-1)

    fillers: Any = (EMPTY, 0, 0, 0)
    return replace(
        genomes,
        nodes=jax.tree.map(partial(resize, nodes), genomes.nodes, Nodes(*fillers)),
        connections=jax.tree.map(partial(resize, connections), genomes.connections),
    )
