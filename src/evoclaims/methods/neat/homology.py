"""Which genes of two genomes are homologous (Stanley and Miikkulainen 2002, §3.2), found without sorting."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from evoclaims.core.pytree import pytree
from evoclaims.networks.genome import Genome, Nodes


@pytree
class Index:
    """A genome prepared for looking up its genes.

    Attributes:
        nodes: its node genes.
        weights: weights[i, j] of the connection from slot j to slot i; NaN where there is none.
    """

    nodes: Nodes
    weights: Float[Array, "nodes nodes"]


@pytree
class Counterparts:
    """For each gene of one genome, the homologous gene of another.

    Attributes:
        nodes: the other's node genes; arbitrary where there is no counterpart.
        has_node: whether a node has a counterpart.
        weight: the weight of the other's connection; NaN where there is none.
    """

    nodes: Nodes
    has_node: Bool[Array, " nodes"]
    weight: Float[Array, " connections"]

    @property
    def has_connection(self) -> Bool[Array, " connections"]:
        """Whether a connection has a counterpart."""
        return ~jnp.isnan(self.weight)


def index(genome: Genome) -> Index:
    """Write a genome's connections into a matrix."""
    size = genome.nodes.key.shape[0]
    genes = genome.connections
    target = jnp.where(genome.has_connection, genes.target, size)
    weights = jnp.full((size, size), jnp.nan).at[target, genes.source].set(genes.weight, mode="drop")
    return Index(nodes=genome.nodes, weights=weights)


def counterparts(genome: Genome, other: Index) -> Counterparts:
    """Find the counterparts of `genome`'s genes in `other`."""
    same = (genome.nodes.key[:, None] == other.nodes.key[None, :]) & genome.has_node[:, None]
    # One reduction; the comparison is never written to memory. -1 where nothing matches.
    slot: Int[Array, " nodes"] = jnp.max(jnp.where(same, jnp.arange(same.shape[1]), -1), axis=1)
    has_node = slot >= 0
    source, target = genome.connections.source, genome.connections.target
    there = genome.has_connection & has_node[source] & has_node[target]
    weight = jnp.where(there, other.weights[slot[target], slot[source]], jnp.nan)
    return Counterparts(
        nodes=Nodes(
            key=other.nodes.key[slot],
            bias=other.nodes.bias[slot],
            response=other.nodes.response[slot],
            activation=other.nodes.activation[slot],
        ),
        has_node=has_node,
        weight=weight,
    )
